"""``ffseg bench``: measure, report, and compare with an earlier run."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ffseg.cli import completion, console
from ffseg.cli.checks import folder, number

if TYPE_CHECKING:
    from ffseg.bench.session import Measurements


def bench(  # noqa: PLR0913 - the options of the command
    out: Annotated[Path, typer.Option(metavar="DIR", parser=folder, help="Folder for the report; made if absent.")],
    suite: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            autocompletion=completion.suites,
            help="patches, size, method, scenes, peers, batch, startup, memory or shards; may be repeated.",
        ),
    ] = None,
    methods: Annotated[
        str,
        typer.Option(metavar="A,B,C", autocompletion=completion.methods, help="Methods of the suite method."),
    ] = "freeform,levelset,paper,snake",
    images: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Images of scenes and peers, with NAME_truth.png.")
    ] = None,
    repeat: Annotated[int, typer.Option(min=1, help="Rounds of every group.")] = 15,
    budget: Annotated[
        float, typer.Option(min=0, callback=number, help="Seconds after which a group gets no more.")
    ] = 20.0,
    baseline: Annotated[
        Path | None, typer.Option(metavar="FILE", help="bench.json of an earlier run to compare with.")
    ] = None,
    max_ratio: Annotated[
        float,
        typer.Option(min=1, callback=number, metavar="X", help="Exit with 4 when a figure is X times its baseline."),
    ] = 1.15,
    quick: Annotated[bool, typer.Option("--quick", help="Tiny inputs, each once, to see that it runs.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print bench.json instead of the tables.")] = False,
) -> None:
    """Measure speed and memory: medians, ratios to a fixed kernel K, exponents.

    Writes bench.json, bench.csv and bench.md after every suite, so that one that fails loses nothing measured before it.
    Exit code: 2 nothing was measured; 3 a suite failed, or a table could not be written; 4 a figure missed the baseline.
    """
    from ffseg.bench.gate import read_baseline
    from ffseg.bench.measure import Schedule
    from ffseg.bench.session import check, run_bench
    from ffseg.io.files import make_folder
    from ffseg.plugins import methods_named

    known = read_baseline(baseline, max_ratio, quick=quick) if baseline else None
    order = Schedule(suite or (), repeat, budget, images, quick, methods_named(methods))
    check(order)
    make_folder(out)
    outcome = run_bench(order, console.message, known, lambda so_far: _write(out, so_far))
    report = _write(out, outcome)
    if as_json:
        console.data(report["bench.json"].decode("utf-8").rstrip("\n"))
    else:
        console.markdown(report["bench.md"].decode("utf-8").rstrip("\n"))
    for item in outcome.slower:
        console.error(str(item))
    if outcome.slower:
        raise typer.Exit(console.MISSED_GATE)


def _write(out: Path, outcome: Measurements) -> dict[str, bytes]:
    """Write the tables of what is measured so far; their contents by name."""
    from ffseg.bench.report import to_csv, to_json, to_markdown
    from ffseg.io.files import write_all_atomic

    tables = {
        "bench.json": to_json(outcome),
        "bench.csv": to_csv(outcome),
        "bench.md": to_markdown(outcome).encode("utf-8"),
    }
    write_all_atomic([(os.path.join(out, name), content) for name, content in tables.items()])
    return tables
