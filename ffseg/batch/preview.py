"""Dry run: what a run would do, without writing anything or starting a worker."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass

from ffseg.batch.executors.base import Options
from ffseg.batch.plan.jobs import Plan
from ffseg.batch.plan.sources import Job
from ffseg.batch.record.foreign import refuse_foreign
from ffseg.batch.record.header import refuse_mixing, run_header
from ffseg.batch.record.journal import last_records, state_folder
from ffseg.batch.record.lock import refuse_locked
from ffseg.batch.record.ordered import moved_records
from ffseg.batch.values import Record
from ffseg.batch.workers.freshness import kept_outputs, read_job
from ffseg.batch.workers.messages import Setup
from ffseg.errors import ImageReadError, OutputError
from ffseg.io.files import printable
from ffseg.io.images import Limits, inspect


@dataclass(frozen=True, slots=True)
class Preview:
    """What a run would do with an image."""

    job: Job
    status: str
    """``unchanged``, ``failed`` (it cannot be read, or its header says that it will not be) or ``to do``."""
    error: str = ""
    """``reason: text`` of a failed one."""
    missing: tuple[str, ...] = ()
    """Outputs that would be made."""


def preview(plan: Plan, setup: Setup, options: Options) -> Iterator[Preview]:
    """Go through a plan as a run would.

    Raises
    ------
    UsageError
        Where the run would refuse to start.
    OutputError
        Where the output folder cannot be written.
    """
    header = run_header(setup)
    folder = state_folder(plan.out, plan.shard)
    if not options.overwrite:
        refuse_foreign(plan, setup, options)
    refuse_locked(plan.out, folder)
    if not options.overwrite:
        refuse_mixing(plan.out, folder, header, pack=plan.products.pack)
    _refuse_unwritable(plan.out)
    known = {} if options.overwrite else last_records(folder)
    known |= {record.name: record for record in moved_records(plan.out, known.get)} if plan.shard else {}
    for job in plan.jobs:
        record = known.get(job.source.name)
        yield _preview(plan, job, setup, record if record is not None and record.fits(header["settings"]) else None)


def _preview(plan: Plan, job: Job, setup: Setup, record: Record | None) -> Preview:
    if job.source.problem:
        return Preview(job, "failed", job.source.problem)
    outputs = plan.outputs(job)
    try:
        read = read_job(job, setup)
        kept = kept_outputs(record, read, plan.out)
        if kept is None:  # no decoder is asked, which may refuse it still
            inspect(read.data, Limits(setup.max_bytes, setup.max_pixels))
    except ImageReadError as error:
        return Preview(job, "failed", f"{error.reason}: {error}")
    missing = tuple(path for path in outputs if path not in (kept or ()))
    if missing or record is None or (job.truth and read.digests.truth != record.truth):
        return Preview(job, "to do", missing=missing)
    return Preview(job, "unchanged")


def _refuse_unwritable(out: str) -> None:
    folder = os.path.abspath(out)
    while not os.path.lexists(folder):
        folder = os.path.dirname(folder)
    if not os.path.isdir(folder):
        raise OutputError(f"the folder {printable(out)} cannot be made; {printable(folder)} is not a folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"{printable(folder)} cannot be written; check its permissions")
