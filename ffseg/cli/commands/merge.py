"""``ffseg merge``: the tables of one run out of those of its shards."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated

import typer

from ffseg.cli import console
from ffseg.cli.checks import folder as named
from ffseg.cli.checks import refuse_others
from ffseg.cli.options import AsJson, Report, Table


def merge(
    folder: Annotated[Path, typer.Argument(metavar="DIR", parser=named, help="Output folder of runs with --shard.")],
    table: Table = "csv",
    report: Report = False,
    as_json: AsJson = False,
) -> None:
    """Write the tables of DIR as one run over all its shards would have.

    Exit code: 0 every image done; 2 nothing was written; 3 an image failed, or a shard never ran or did not finish: it is
    named, and the tables hold what is there.
    """
    from ffseg.batch.outputs.table import REPORT
    from ffseg.batch.report.write import write_report
    from ffseg.batch.shards.merge import merge_shards
    from ffseg.cli.commands.run import read_tables

    if report:
        refuse_others([(os.fspath(folder / REPORT), "report")], "move it")
    done = merge_shards(str(folder), parquet=read_tables(table))
    if report:
        write_report(folder)
    for problem in (*done.problems, *done.notes):
        console.message(f"ffseg: {problem}")
    if done.num_stale:
        shown = "image is" if done.num_stale == 1 else "images are"
        console.message(f"ffseg: {done.num_stale} {shown} no longer what was segmented; see stale in run.json")
    if as_json:
        counts = {**done.counts, "stale": done.num_stale}
        console.data(json.dumps({"out": done.out, "counts": counts, "problems": done.problems}, indent=2))
    else:
        for label, count in (("images", "total"), ("done", "ok"), ("failed", "failed")):
            console.data(f"{label:6}  {done.counts[count]}")
    if done.problems or done.counts["failed"]:
        raise typer.Exit(console.FAILED_IMAGES)
