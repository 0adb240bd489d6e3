"""Files that no run has made are not replaced."""

from __future__ import annotations

import os
from collections.abc import Mapping
from itertools import chain
from typing import Any

from ffseg.batch.executors.base import Options
from ffseg.batch.outputs.table import MAP_BAG, MAP_FILES, OBSTACLES, PARQUET, REPORT, RUN, TIMINGS
from ffseg.batch.plan.jobs import Plan
from ffseg.batch.record.journal import JOURNAL, journal_lines, read_header, shard_names, state_folder, tables_of
from ffseg.batch.values import parsed_line, parsed_record
from ffseg.batch.workers.messages import Setup
from ffseg.errors import UsageError
from ffseg.io.files import printable

UNFINISHED = "unfinished"
"""File in a state folder while not all images are done: what a killed run wrote last may be in no journal."""
_EVERY_RUN = {TIMINGS, RUN, REPORT}


def joint_files(plan: Plan, setup: Setup, options: Options) -> set[str]:
    """What is written for all images together beside what every run writes, relative to the output folder."""
    merged = {kind.merged for kind in plan.products.kinds if kind.merge}
    merged |= {*MAP_FILES, MAP_BAG} if plan.products.metric and not plan.shard else set()
    others = {name for name, asked in ((OBSTACLES, setup.views is not None), (PARQUET, options.parquet)) if asked}
    return {*merged, *others, *plan.tars, *plan.films}


def refuse_foreign(plan: Plan, setup: Setup, options: Options) -> None:
    """Refuse to replace what no run has made.

    Raises
    ------
    UsageError
        If a file that the run would write exists, and the journals of the output folder do not name it; naming it. Not
        where an earlier run was cut off, or lines of a journal are damaged: what is there may then be of a run.
    """
    every = {TIMINGS, RUN, *((REPORT,) if options.report else ())}
    each = (path for job in plan.jobs if not (plan.tars or job.source.problem) for path in plan.outputs(job))
    outputs = chain(sorted(every | joint_files(plan, setup, options)), each)
    there = [path for path in outputs if os.path.lexists(os.path.join(plan.out, path))]
    made = _made(plan.out) if there else None
    foreign = next((path for path in there if made is not None and path not in made), "")
    if foreign:
        path = printable(os.path.join(plan.out, foreign))
        raise UsageError(f"{path} exists and no run made it; choose another folder or use --overwrite")


def _made(out: str) -> set[str] | None:
    """What runs have written by the journals of an output folder, relative to it; None where that cannot be told."""
    made: set[str] = set()
    whole = True
    for folder in (state_folder(out, name) for name in ("", *shard_names(out))):
        header = _header(folder)
        if header is not None:
            whole = whole and not os.path.exists(os.path.join(folder, UNFINISHED))
            made |= {*_EVERY_RUN, *tables_of(header)}
        for line in journal_lines(folder):
            record = parsed_record(line)
            if record is not None:
                made.update(record.outputs, record.left)
            whole = whole and (record is not None or "gone" in (parsed_line(line) or ()))
    return made if whole else None


def _header(folder: str) -> Mapping[str, Any] | None:
    header, path = read_header(folder), os.path.join(folder, JOURNAL)
    if header is None and os.path.lexists(path):
        raise UsageError(
            f"{printable(path)} cannot be read, is damaged or of another version, so that nothing says how the outputs "
            "were made; choose another folder or use --overwrite"
        )
    return header
