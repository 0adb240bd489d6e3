"""``ffseg tune``: the settings that suit a few masks best, if any are better than the current ones."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from ffseg.cli import console, options
from ffseg.cli.checks import number, output_file, ready_params
from ffseg.cli.commands.telling import progress, warn_of_passed_over, warn_of_seen, warn_of_starts
from ffseg.errors import UsageError


def tune(  # noqa: PLR0913 - the options of the command
    inputs: options.Inputs,
    truth: options.Masks,
    out: Annotated[Path, typer.Option(metavar="FILE", help="Parameter file to write, for --config.")],
    page: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also write a page with each image before and after.")
    ] = None,
    budget: Annotated[
        float,
        typer.Option(min=1, max=86400, callback=number, metavar="SECONDS", help="How long to look.", show_default=True),
    ] = 25.0,
    truth_label: options.TruthLabel = None,
    starts: options.Starts = None,
    config: options.Config = None,
    settings: options.Settings = None,
    as_json: options.AsJsonOrSentences = False,
    quiet: options.FiguresOnly = False,
) -> None:
    """Look for settings that agree with a few masks, and keep those at hand where none is better.

    Writes a YAML file of the setting it takes and of all else that differs from the defaults, with what was measured on
    images left out. Exit code: 0 done; 2 nothing was written.
    """
    if out.suffix not in (".yaml", ".yml"):
        raise UsageError(f"--out {out}: the settings are a YAML file; name it .yaml")
    if page is not None and page.suffix not in (".html", ".htm"):
        raise UsageError(f"--page {page}: the page is an HTML file; name it .html")
    for option, path, kind in (("--out", out, "settings"), ("--page", page, "before and after")):
        if path is not None:
            output_file(option, path, kind)
    params = ready_params(config, settings)
    from ffseg.io.files import write_all_atomic
    from ffseg.learning.gather import gather
    from ffseg.learning.page import not_tried, summary_lines, to_html, to_yaml
    from ffseg.learning.tune import before_and_after
    from ffseg.learning.tune import tune as search
    from ffseg.parameter_text import non_defaults
    from ffseg.plugins import METHODS

    if params.method in METHODS and not METHODS[params.method].uses_edges:
        what = f"method: {params.method} does not look at the edge map, which tune is for"
        raise UsageError(f"{what}; choose another method")
    found = gather(inputs, os.fspath(truth), params, options.starts_file(starts, params), truth_label)
    warn_of_passed_over(found.passed_over)
    warn_of_starts(found.labelled)
    warn_of_seen(found.labelled)
    tuned = search(found.labelled, budget, progress(quiet=quiet))
    text = to_yaml(tuned, params)
    files = [(os.fspath(out), text.encode())]
    if page is not None:
        masks = before_and_after(found.labelled, tuned)
        files.append((os.fspath(page), to_html(tuned, found.labelled, masks, text).encode()))
    write_all_atomic(files)
    if as_json:
        console.data(json.dumps({"out": os.fspath(out), **asdict(tuned)}, indent=2))
    else:
        use = f"use it with --config {out}" if tuned.setting or non_defaults(params) else f"{out} changes nothing"
        console.data("\n".join([*summary_lines(tuned), use, *not_tried(tuned)]))
