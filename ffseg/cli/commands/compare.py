"""``ffseg compare``: several methods on the same images."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ffseg.cli import completion, console, options
from ffseg.cli.checks import ready_params, require_truth
from ffseg.errors import UsageError
from ffseg.io.tables import without_nan

if TYPE_CHECKING:
    from ffseg.compare.values import Row


def compare(  # noqa: PLR0913 - the options of the command
    inputs: options.Inputs,
    out: options.Out,
    methods: Annotated[
        str,
        typer.Option(
            metavar="A,B,C",
            autocompletion=completion.methods,
            help="Methods and peers; 'peers' or 'all' for every one.",
        ),
    ] = "freeform,snake,levelset",
    truth: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder or .tar of true masks: 255 inside, 128 ignored."),
    ] = None,
    truth_label: options.TruthLabel = None,
    repeat: Annotated[int, typer.Option(min=1, help="Runs of each; the median time counts.")] = 1,
    config: options.Config = None,
    settings: options.Settings = None,
    allow_code: options.AllowCode = False,
    starts: options.Starts = None,
    evidence: options.Evidence = None,
    peers: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Parameters of the peers, like configs/peers.yaml.")
    ] = None,
    own_edges: Annotated[
        bool, typer.Option("--own-edges", help="Each method makes its own edges and moves its own starts, as in a run.")
    ] = False,
    min_iou: Annotated[
        list[str] | None,
        typer.Option(metavar="X|METHOD=X", help="Least IoU on every image; exit code 4 when missed."),
    ] = None,
    as_json: options.AsJson = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No messages, no table; errors only.")] = False,
) -> None:
    """Compare methods on the same images: times, agreement with truth, panels side by side.

    Writes compare.csv, compare.md and panels/; interrupted, it goes on when it is run again. Exit code: 0 done; 2 nothing was
    run; 3 a method failed on an image, or an output could not be written; 4 a gate was missed. Peers that are not
    installed are named and skipped.
    """
    from ffseg.cli.interruption import Interruption
    from ffseg.cli.reporting import DISAGREE, disagree
    from ffseg.compare import run as work
    from ffseg.compare.text import SUMMARY, summary_cells
    from ffseg.compare.values import Comparison
    from ffseg.peer_parameters import load_peer_parameters
    from ffseg.plugins import methods_named

    require_truth(truth, truth_label)
    chosen = methods_named(methods)
    gates = _gates(min_iou or [], chosen, with_truth=truth is not None)
    params = ready_params(config, settings, evidence, allow_code=allow_code)
    peer_params, starting = load_peer_parameters(peers), options.starts_file(starts, params)
    folder, truths, maps = (os.fspath(path) if path else "" for path in (out, truth, evidence))
    jobs = work.plan_comparison(inputs, folder, truths, starting, maps, params.domain.masks or "")
    task = Comparison(jobs, folder, chosen, params, peer_params, repeat, truth_label, own_edges)
    with Interruption():
        rows = work.compare(task, partial(_tell, failed_only=quiet), None if quiet else partial(_pace, len(jobs)))
    if not quiet and disagree(row.iou for row in rows):
        console.message(f"ffseg: {DISAGREE}")
    missed = work.missed_gates(rows, gates)
    if as_json:
        plain = [without_nan(asdict(row)) for row in rows]
        console.data(json.dumps({"out": folder, "missed": missed, "rows": plain}, indent=2))
    elif not quiet:
        cells = summary_cells(task, rows)
        shown = [place for place in range(len(SUMMARY)) if any(line[place] for line in cells)]  # no IoU without truth
        console.table([SUMMARY[place] for place in shown], [[line[place] for place in shown] for line in cells])
        console.data(f"every image: {console.escape(os.path.join(folder, 'compare.md'))}")
    for sentence in missed:
        console.error(sentence)
    if any(row.status == "failed" for row in rows):
        raise typer.Exit(console.FAILED_IMAGES)
    if missed:
        raise typer.Exit(console.MISSED_GATE)


def _gates(texts: Sequence[str], methods: Sequence[str], *, with_truth: bool) -> dict[str, float]:
    """Least IoU by method; the empty name stands for all."""
    gates = {}
    for text in texts:
        method, equals, value = text.rpartition("=")
        if equals and method not in methods:
            raise UsageError(f"--min-iou {text}: the method is not compared; choose one of {', '.join(methods)}")
        try:
            gates[method] = float(value)
        except ValueError:
            gates[method] = -1.0
        if not 0 <= gates[method] <= 1:
            raise UsageError(f"--min-iou {text}: {value!r} is not a number from 0 to 1; write 0.99 or freeform=0.99")
    if gates and not with_truth:
        raise UsageError("--min-iou needs truth to measure against; add --truth DIR")
    return gates


def _tell(row: Row, *, failed_only: bool) -> None:
    if failed_only and row.status != "failed":
        return
    figures = f"{row.evolve_ms:.1f} ms" if row.evolve_ms is not None else row.error
    overlap = "" if row.iou is None else f", IoU {row.iou:.4f}"
    console.message(f"ffseg: {row.image}: {row.method} {row.status}: {figures}{overlap}")


def _pace(total: int, done: int, seconds: float) -> None:
    if done < total:
        left = f"{seconds / 60:.0f} min" if seconds >= 90 else f"{seconds:.0f} s"
        console.message(f"ffseg: {done} of {total} images; about {left} to go")
