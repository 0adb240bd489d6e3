"""What a run would do, found out without doing it: nothing is written, no worker started."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass

from ffseg import __version__
from ffseg.batch.plan.jobs import Job, Plan
from ffseg.batch.record.header import refuse_other_packing, refuse_other_parameters, run_header
from ffseg.batch.record.journal import last_records, refuse_special, state_folder
from ffseg.batch.record.lock import take
from ffseg.batch.record.values import Record
from ffseg.batch.runner import refuse_foreign
from ffseg.batch.workers.freshness import kept_outputs, read_task
from ffseg.batch.workers.messages import Setup, Task
from ffseg.errors import ImageReadError, OutputError, UsageError
from ffseg.io.files import OWN, printable, unwritten
from ffseg.io.images import Limits, inspect


@dataclass(frozen=True, slots=True)
class Preview:
    """What a run would do with an image.

    Attributes
    ----------
    status : str
        ``unchanged``, ``failed`` (it cannot be read, or its header says that it will not be) or ``to do``.
    error : str
        ``reason: text`` of a failed one.
    missing : tuple of str
        Outputs that would be made.
    """

    job: Job
    status: str
    error: str = ""
    missing: tuple[str, ...] = ()


def preview(plan: Plan, setup: Setup, *, overwrite: bool = False) -> Iterator[Preview]:
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
    if not overwrite:
        refuse_foreign(plan)
    _refuse_locked(plan.out, folder)
    if not overwrite:
        refuse_other_parameters(plan.out, folder, header)
        refuse_other_packing(plan.out, folder, pack=plan.products.pack)
    _refuse_unwritable(plan.out)
    known = {} if overwrite else last_records(folder)
    for job in plan.jobs:
        yield _preview(plan, job, setup, _fitting(known.get(job.source.name), header["settings"]))


def _fitting(record: Record | None, settings: str) -> Record | None:
    fits = record is not None and record.made and (record.version, record.settings) == (__version__, settings)
    return record if fits else None


def _preview(plan: Plan, job: Job, setup: Setup, record: Record | None) -> Preview:
    if job.source.problem:
        return Preview(job, "failed", job.source.problem)
    outputs = plan.outputs(job)
    files = (job.source.path, job.truth, plan.out, outputs)
    task = Task(job.index, *files, None, job.source.name, job.earlier, job.start, job.depends, span=job.source.span)
    try:
        read = read_task(task, setup)
    except ImageReadError as error:
        return Preview(job, "failed", f"{error.reason}: {error}")
    if record is None or record.content != read.digests.content:
        wrong = _header_problem(read.data, setup)
        return Preview(job, "failed", wrong) if wrong else Preview(job, "to do", missing=outputs)
    kept = set(kept_outputs(plan.out, record.recorded))
    missing = tuple(path for path in outputs if path not in kept)
    if missing or (job.truth and read.digests.truth != record.truth):
        return Preview(job, "to do", missing=missing)
    return Preview(job, "unchanged")


def _header_problem(data: bytes, setup: Setup) -> str:
    """Why no decoder would be given the bytes of an image; empty if one would, which may refuse them still."""
    try:
        inspect(data, Limits(setup.max_bytes, setup.max_pixels))
    except ImageReadError as error:
        return f"{error.reason}: {error}"
    return ""


def _refuse_locked(out: str, folder: str) -> None:
    path = os.path.join(folder, "lock")
    refuse_special(path)
    try:
        descriptor = os.open(path, os.O_RDWR | OWN)
    except FileNotFoundError:
        return
    except OSError as error:
        raise unwritten(path, error) from error
    try:
        take(descriptor)
    except OSError as error:
        raise UsageError(
            f"another ffseg run is writing to {printable(out)}; wait for it or choose another folder"
        ) from error
    finally:
        os.close(descriptor)


def _refuse_unwritable(out: str) -> None:
    folder = os.path.abspath(out)
    while not os.path.lexists(folder):
        folder = os.path.dirname(folder)
    if not os.path.isdir(folder):
        raise OutputError(f"the folder {printable(out)} cannot be made; {printable(folder)} is not a folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"{printable(folder)} cannot be written; check its permissions")
