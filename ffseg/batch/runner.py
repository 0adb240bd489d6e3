"""A run over many images: each is whole or absent, done once, and its failure costs nobody else anything."""

from __future__ import annotations

import contextlib
import os
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from itertools import takewhile
from time import perf_counter
from types import TracebackType
from typing import Any, Protocol

from ffseg import __version__
from ffseg.batch.executors.base import Assignment, Do, Executor, Options, served
from ffseg.batch.executors.chunks import left_over, numbered
from ffseg.batch.outputs.table import GROUND, MAP_FILES, OUTPUTS
from ffseg.batch.plan.jobs import Plan, output_folders, prepare_output, refuse_foreign
from ffseg.batch.plan.sources import Job
from ffseg.batch.record.finish import StoppedError, find_moved, put_in_order
from ffseg.batch.record.header import refuse_mixing, run_header
from ffseg.batch.record.journal import Journal, read_header, state_folder
from ffseg.batch.record.keeper import Completed, Keeper
from ffseg.batch.record.lock import OutputLock
from ffseg.batch.record.ordered import packs_of, remove_packs
from ffseg.batch.record.survey import Survey, survey, tidy
from ffseg.batch.record.tables import OBSTACLES, PARQUET, RUN, START_COLUMNS, TIMING_COLUMNS, Tables, remove_old
from ffseg.batch.tar.writer import Store
from ffseg.batch.workers.launch import Process
from ffseg.batch.workers.messages import Failed, Note, Ready, Reply, Setup, Task
from ffseg.errors import FfsegError, OutputError, UsageError
from ffseg.io.files import is_temporary, printable, sync_folders
from ffseg.plugins import find

__all__ = ["JOB_REASONS", "TIMING_COLUMNS", "Observer", "Options", "Run", "Stop", "Summary"]

JOB_REASONS = {
    "segmentation": "the image was read but cannot be segmented as asked",
    "parameters": "the parameters do not suit this image",
    "calibration": "the image does not fit the camera file",
    "truth": "the true mask has another size",
    "evidence": "the map of evidence cannot be used",
    "output": "an output could not be written",
    "crash": "the worker process died",
    "timeout": "it took longer than --timeout allows",
    "out-of-memory": "it needed more memory than --memory allows",
    "internal": "a defect of ffseg; the traceback is in the error log",
}
"""Reasons of a failed row beside those of ``ffseg.io.images.REASONS``."""


_TOGETHER_MS = 20
"""Milliseconds a reply waits for those of other workers."""
_TOLD_FRAMES = 200
"""Frames whose map takes seconds, some 25 ms each: that is said."""


class Stop(Protocol):
    """Tells a run to end early."""

    @property
    def signal(self) -> int:
        """0, or the signal that asks for the end."""

    @property
    def descriptor(self) -> int:
        """Becomes readable when `signal` is set."""


class Observer(Protocol):
    """Hears of the progress of a run."""

    def finished(self, job: Job, status: str, told: str) -> None:
        """An image ended as ``ok``, ``unchanged`` (done before) or ``failed``; what there is to tell of it."""

    def note(self, text: str) -> None:
        """Something the user should know that belongs to no image."""


@dataclass(slots=True)
class Summary:
    """How a run ended.

    Attributes
    ----------
    total, done, unchanged, failed : int
        Images of this run.
    stale : int
        Images of earlier runs, and outputs, that no longer are what their record says: named in ``run.json``.
    removed : int
        Outputs removed because they belonged to no image any longer.
    signal : int
        That ended it early; 0 for none.
    drive : dict
        Figures of the map of all frames, where one is made.
    """

    total: int
    done: int = 0
    unchanged: int = 0
    failed: int = 0
    stale: int = 0
    removed: int = 0
    seconds: float = 0.0
    signal: int = 0
    problems: list[str] = field(default_factory=list)
    drive: dict[str, Any] = field(default_factory=dict)

    def counts(self) -> dict[str, int]:
        """Numbers of images by what became of them."""
        return {name: getattr(self, name) for name in ("total", "done", "unchanged", "failed", "stale")}


class Run:
    """One run into one output folder, a context manager that holds the folder's lock from `execute` to its end."""

    def __init__(self, plan: Plan, setup: Setup, options: Options, stop: Stop, observer: Observer) -> None:
        self._plan, self._setup, self._options = plan, setup, options
        self._stop, self._observer = stop, observer
        self.summary = Summary(len(plan.jobs))
        self._started = datetime.now(UTC)
        self._versions: Mapping[str, str] = {}
        self._finished = bytearray(len(plan.jobs))
        self._state = state_folder(plan.out, plan.shard)
        self._keeper: Keeper
        self._survey: Survey
        self._held = contextlib.ExitStack()

    def __enter__(self) -> Run:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._held.close()

    def execute(self, started: Sequence[Process] = ()) -> Summary:
        """Do the plan.

        Parameters
        ----------
        started : sequence of Process
            Worker processes that have been started already.

        Raises
        ------
        UsageError
            Before the first image: another run is at work here, an earlier one had other parameters, or files that no
            run has made are in the way.
        OutputError
            Before the first image: the output folder cannot be written.
        """
        header = run_header(self._setup)
        if not self._options.overwrite:
            refuse_foreign(self._plan)
        begin = perf_counter()
        self._held.enter_context(OutputLock(self._plan.out, self._state))
        if not self._options.overwrite:
            refuse_mixing(self._plan.out, self._state, header, pack=self._plan.products.pack)
        prepare_output(self._plan, self._state)
        self._sweep()
        self._open(header)
        self._work(started)
        self.summary.seconds = perf_counter() - begin
        self._conclude(header["settings"])
        return self.summary

    def _open(self, header: Mapping[str, Any]) -> None:
        old = read_header(self._state) or {}
        self._tables_before = [name for name in old.get("tables", ()) if isinstance(name, str)]
        merged = {kind.merged for kind in self._plan.products.kinds if kind.merge}
        others = {OBSTACLES: self._setup.views is not None, PARQUET: self._options.parquet}
        merged |= {*MAP_FILES} if self._plan.products.metric and not self._plan.shard else set()
        tables = {*self._tables_before, *merged, *(name for name, asked in others.items() if asked), *self._plan.tars}
        names = [job.source.name for job in self._plan.jobs]
        tables |= {*self._plan.films}
        self._header = {**header, "tables": sorted(tables), **({"pack": True} if self._plan.tars else {})}
        journal = Journal(self._state, self._header, names)
        self._held.callback(journal.close)
        store = Store(self._plan.out, self._state, packed=bool(self._plan.tars))
        self._held.callback(store.close)
        self._keeper = Keeper(self._plan, journal, header["settings"], self._setup.params.method, self._problem, store)
        index = {name: number for number, name in enumerate(names)}
        for name, reply in left_over(self._state, header["settings"]):
            if name in index:
                self._keeper.adopt(numbered(reply, index[name]))
        if self._plan.shard:  # until it has finished, it has not
            if self._plan.tars:
                find_moved(self._plan.out, journal, self._plan)
            with contextlib.suppress(OSError):
                os.unlink(os.path.join(self._state, RUN))

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of ``timings.csv`` of the images of the plan that are finished, in input order."""
        for job in self._plan.jobs:
            record = self._keeper.journal.get(job.index) if self._finished[job.index] else None
            if record is not None:
                yield {"image": printable(job.source.name), **record.row}

    def _tables(self) -> Tables:
        folder, camera = self._state if self._plan.shard else self._plan.out, self._setup.views is not None
        asked, kinds = frozenset(self._asked()), tuple(dict.fromkeys((*OUTPUTS, *self._plan.products.kinds)))
        films = self._plan.products.films
        return Tables(self._plan.out, folder, self._survey, camera, asked, self._options.parquet, kinds, films)

    def _asked(self) -> set[str]:
        """Columns and folders of outputs that were asked for."""
        asked = {kind.folder for kind in self._plan.products.kinds if kind.merge}
        asked |= {"iou"} if self._plan.with_truth else set()
        return asked | ({START_COLUMNS[0]} if any(job.start for job in self._plan.jobs) else set())

    def _sweep(self) -> None:
        """Remove the temporaries of a run that was killed; under the lock nobody else can be writing one.

        A shard leaves those of the images alone: another shard may be writing them.
        """
        folders = [] if self._plan.shard else [self._plan.out, *output_folders(self._plan)]
        for folder in (self._state, *folders):
            with os.scandir(folder) as entries:
                left = [entry.path for entry in entries if is_temporary(entry.name)]
            for path in left:
                with contextlib.suppress(OSError):
                    os.unlink(path)

    def _work(self, started: Sequence[Process]) -> None:
        """Feed the executor and write what it replies."""
        jobs, name = self._plan.jobs, self._options.executor
        self.take([_untried(job) for job in jobs if job.source.problem])
        tasks = (self._task(job) for job in jobs if not job.source.problem)
        chosen = find("executors", name)
        if isinstance(chosen, type) and issubclass(chosen, Executor):
            descriptor, settings = self._stop.descriptor, self._keeper.settings
            executor = chosen(
                Assignment(self._setup, self._options, started, descriptor, len(jobs), self._state, settings)
            )
            try:
                self._feed(executor, tasks)
            finally:
                executor.close()
        else:
            self._map(name, chosen, tasks)
        self.summary.signal = self._stop.signal

    def _feed(self, executor: Executor, tasks: Iterator[Task]) -> None:
        """Write one reply of each worker together: the disk is waited for less. What has come is written in any case."""
        held: list[Reply] = []
        came = 0
        try:
            for event in served(executor, tasks, lambda: not self.stopped, lambda: _TOGETHER_MS if held else None):
                if event is None:
                    if len(held) >= self._options.num_workers or not came:
                        together = held.copy()
                        held.clear()
                        self.take(together)
                    came = 0
                elif isinstance(event, Note):
                    self._observer.note(event.text)
                elif isinstance(event, Ready):
                    self._versions = event.versions
                else:
                    held.append(event)
                    came += 1
        finally:
            self.take(held)

    def _map(self, name: str, executor: Callable[[Do, Iterator[Task]], Iterable[Reply]], tasks: Iterator[Task]) -> None:
        """Let a function do the tasks, in any order; it may draw them from another thread."""
        do = Do(self._setup)
        self._versions = do.bench.versions()
        for reply in executor(do, takewhile(lambda _: not self.stopped, tasks)):
            if not isinstance(reply, Reply):
                raise UsageError(f"--executor: {name} gave {type(reply).__name__}, not what do(task) returned")
            if not self._finished[reply.index]:
                self.take([reply])
            if self.stopped:
                return
        lost = f"the executor {name} gave no reply for it"
        left = (job for job in self._plan.jobs if not (self.stopped or self._finished[job.index]))
        self.take([Failed(job.index, "crash", lost) for job in left])

    @property
    def stopped(self) -> bool:
        """Whether the end has been asked for."""
        return bool(self._stop.signal)

    def _task(self, job: Job) -> Task:
        record = None if self._options.overwrite else self._keeper.journal.get(job.index)
        fits = record is not None and record.fits(self._keeper.settings)
        return Task(job, self._plan.out, self._plan.outputs(job), record if fits else None)

    def take(self, replies: Sequence[Reply]) -> None:
        """Write what replies bring and remember it: never more images at once than there are workers."""
        together = self._options.num_workers
        for first in range(0, len(replies), together):
            for completed in self._keeper.complete(replies[first : first + together]):
                self._count(completed)

    def _count(self, completed: Completed) -> None:
        self._finished[completed.index] = 1
        name = "done" if completed.status == "ok" else completed.status
        setattr(self.summary, name, getattr(self.summary, name) + 1)
        note = completed.note if completed.status == "ok" and not self._setup.views else ""
        self._observer.finished(self._plan.jobs[completed.index], completed.status, completed.error or note)

    def _problem(self, text: str) -> None:
        if text not in self.summary.problems:
            self.summary.problems.append(text)
            self._observer.note(text)

    def _conclude(self, settings: str) -> None:
        """Bring the output folder in step with the journal and write the tables."""
        journal = self._keeper.journal
        if all(self._finished):
            self._sweep()  # workers of other machines may have died
            self.summary.removed = tidy(journal, self._plan, settings)
        self._survey = survey(journal, self._plan, settings, self._finished)
        self.summary.stale = self._survey.num_stale + len(self._survey.left)
        tables = self._tables()
        tars = self._packed()
        fused = self._fused()
        written = tables.write(self._run_json(), self._problem)
        remove_old(tables.folder, self._tables_before, [*written, *tars, *fused])
        if self._options.report:
            self._write_report()
        elif (self.summary.done or self.summary.failed) and os.path.exists(os.path.join(tables.folder, "report.html")):
            out = shlex.quote(printable(self._plan.out))
            self._observer.note(f"report.html shows an earlier state; write it anew with: ffseg report {out}")
        sync_folders([tables.folder, self._state, *output_folders(self._plan)])

    def _fused(self) -> Sequence[str]:
        """Write the map of all frames; names of its files."""
        views, plan = self._setup.views, self._plan
        if views is None or plan.shard or self.stopped or GROUND.folder not in self._survey.with_outputs:
            return MAP_FILES if self.stopped else ()
        from ffseg.batch.drive import drive_of

        if self._survey.count >= _TOLD_FRAMES:
            self._observer.note(f"{self._survey.count} frames are being fused into map/")
        drive = drive_of(self._survey.records(), plan.out, views)
        self.summary.drive = drive.figures()
        try:
            return drive.write(plan.out)
        except OutputError as error:
            self._problem(str(error))
        return MAP_FILES

    def _packed(self) -> list[str]:
        """Put packed outputs in order once all are there; names of the tar files that stay in the output folder."""
        plan, before = self._plan, [name for name in self._tables_before if name.endswith(".tar")]
        if plan.shard or not all(self._finished):
            return [*before, *plan.tars]
        if not plan.tars:
            remove_packs(packs_of(self._state))
            return []
        try:
            return put_in_order(plan.out, self._keeper.journal, self._survey, self._header, lambda: self.stopped)
        except OutputError as error:
            self._problem(str(error))
        except StoppedError:
            self.summary.signal = self._stop.signal
        return [*before, *plan.tars]

    def _write_report(self) -> None:
        from ffseg.batch.report.write import write_report

        try:
            write_report(self._plan.out)
        except FfsegError as error:  # the images are done all the same
            self._problem(str(error))

    def _run_json(self) -> dict[str, Any]:
        summary = self.summary
        stale = [{"image": printable(name), "reason": reason} for name, reason in self._survey.stale]
        left = [{"output": printable(path), "reason": "not what was written"} for path in self._survey.left]
        return {
            "ffseg": __version__,
            "status": "interrupted" if summary.signal else "finished",
            "started": self._started.isoformat(timespec="seconds"),
            "ended": datetime.now(UTC).isoformat(timespec="seconds"),
            "seconds": round(summary.seconds, 3),
            "counts": summary.counts(),
            "inputs": list(self._plan.inputs),
            "parameters": asdict(self._setup.params),
            "versions": dict(self._versions),
            "problems": summary.problems,
            "stale": [*stale, *left],
            **({"map": summary.drive} if summary.drive else {}),
            **self._part(),
        }

    def _part(self) -> dict[str, Any]:
        """What a merge has to know of a shard."""
        plan = self._plan
        return {"shard": plan.shard, "whole": plan.whole, "asked": sorted(self._asked())} if plan.shard else {}


def _untried(job: Job) -> Failed:
    """The reply for an image that cannot even be tried."""
    reason, message = job.source.problem.split(": ", 1)
    return Failed(job.index, reason, message)
