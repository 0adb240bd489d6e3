"""A run over many images: each is whole or absent, done once, and its failure costs nobody else anything."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter
from types import TracebackType
from typing import Any, Protocol

from ffseg import __version__
from ffseg.batch.discover import STATE_FOLDER
from ffseg.batch.jobs import Job, Plan, foreign_outputs, prepare_output
from ffseg.batch.journal import Journal, Record, read_header
from ffseg.batch.lock import OutputLock
from ffseg.batch.workers.launch import Process
from ffseg.batch.workers.messages import Reply, Setup, Task
from ffseg.batch.workers.outputs import COCO
from ffseg.batch.workers.pool import Pool
from ffseg.errors import FfsegError, ImageReadError, OutputError, UsageError
from ffseg.formats.files import (
    is_temporary,
    printable,
    read_bytes,
    sync_folders,
    write_all_atomic,
    write_bytes_atomic,
)  # fmt: skip
from ffseg.formats.tables import csv_table

TIMING_COLUMNS = (
    "image", "status", "error", "width", "height", "method", "initial_points", "final_points", "patches", "iterations",
    "splits", "flips", "components", "holes", "area_px", "decode_ms", "edges_ms", "evolve_ms", "obstacles_ms",
    "write_ms", "total_ms",
)  # fmt: skip
START_COLUMNS = ("start_x", "start_y", "start_radius")
"""With ``--starts``: the start circle of the image, in pixels."""
OBSTACLE_COLUMNS = (
    "image", "component", "area_px", "centroid_x", "centroid_y", "matched_points", "max_altitude_m", "verdict",
    "against", "ground_x_m", "ground_y_m", "track",
)  # fmt: skip

JOB_REASONS = {
    "segmentation": "the image was read but cannot be segmented as asked",
    "parameters": "the parameters do not suit this image",
    "calibration": "the image does not fit the camera file",
    "truth": "the true mask has another size",
    "output": "an output could not be written",
    "crash": "the worker process died",
    "timeout": "it took longer than --timeout allows",
    "out-of-memory": "it needed more memory than --memory allows",
    "internal": "a defect of ffseg; the traceback is in the error log",
}
"""Reasons of a failed row beside those of ``ffseg.formats.images.REASONS``."""


_TOGETHER_MS = 20
"""Milliseconds a reply waits for those of other workers."""


class Stop(Protocol):
    """Tells a run to end early.

    Attributes
    ----------
    signal : int
        0, or the signal that asks for the end.
    descriptor : int
        Becomes readable when `signal` is set.
    """

    @property
    def signal(self) -> int:
        """As above."""

    @property
    def descriptor(self) -> int:
        """As above."""


class Observer(Protocol):
    """Hears of the progress of a run."""

    def finished(self, job: Job, status: str, told: str) -> None:
        """An image ended as ``ok``, ``same`` (done before) or ``failed``; what there is to tell of it."""

    def note(self, text: str) -> None:
        """Something the user should know that belongs to no image."""


@dataclass(frozen=True, slots=True)
class Options:
    """How a run goes about its plan.

    Attributes
    ----------
    num_workers : int
    timeout : float
        Seconds an image may take, 0 for no limit.
    overwrite : bool
        Do everything again, whatever an earlier run left.
    report : bool
        Write the report page at the end.
    """

    num_workers: int = 1
    timeout: float = 0.0
    overwrite: bool = False
    report: bool = False


@dataclass(slots=True)
class Summary:
    """How a run ended."""

    total: int
    done: int = 0
    same: int = 0
    failed: int = 0
    seconds: float = 0.0
    signal: int = 0
    problems: list[str] = field(default_factory=list)


class Run:
    """One run into one output folder, a context manager that holds the folder's lock from `execute` to its end.

    Parameters
    ----------
    plan : Plan
    setup : Setup
    options : Options
    stop : Stop
    observer : Observer
    """

    def __init__(self, plan: Plan, setup: Setup, options: Options, stop: Stop, observer: Observer) -> None:
        self._plan, self._setup, self._options = plan, setup, options
        self._stop, self._observer = stop, observer
        self.summary = Summary(len(plan.jobs))
        self._started = datetime.now(UTC)
        self._versions: Mapping[str, str] = {}
        self._finished = bytearray(len(plan.jobs))
        self._journal: Journal
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
        foreign = "" if self._options.overwrite else foreign_outputs(self._plan)
        if foreign:
            raise UsageError(
                f"{printable(foreign)} exists and no run made it; choose another folder or use --overwrite"
            )
        begin = perf_counter()
        header = self._header()
        self._held.enter_context(OutputLock(self._plan.out))
        if not self._options.overwrite:
            _refuse_other_parameters(self._plan.out, header)
        prepare_output(self._plan)
        self._sweep()
        names = [job.source.name for job in self._plan.jobs]
        self._journal = Journal(self._plan.out, header, names, keep=not self._options.overwrite)
        self._held.callback(self._journal.close)
        self._work(started)
        self.summary.seconds = perf_counter() - begin
        self._write_tables()
        if self._options.report:
            self._write_report()
        return self.summary

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of ``timings.csv`` of the images that are finished, in input order."""
        for job in self._plan.jobs:
            record = self._journal.get(job.index) if self._finished[job.index] else None
            if record is not None:
                yield {"image": printable(job.source.name), **record.row}

    def _obstacle_cells(self) -> Iterator[list[Any]]:
        from ffseg.batch.sightings import numbered

        records = {
            job.source.name: self._journal.get(job.index) for job in self._plan.jobs if self._finished[job.index]
        }
        lines = {printable(name): record.extra for name, record in records.items() if record is not None}
        order = self._setup.views.in_time(records) if self._setup.views else ()
        found = numbered(map(printable, order), lines)
        for name in map(printable, records):
            yield from ([name, *(line[column] for column in OBSTACLE_COLUMNS[1:])] for line in found[name])

    def _header(self) -> dict[str, Any]:
        params = self._setup.params
        files = {"domain.mask": params.domain.mask, "init.mask": params.init.mask}
        files["init.background_mask"] = params.init.background_mask
        digests = {key: _digest_of(key, path, self._setup.max_bytes) for key, path in files.items()}
        views = self._setup.views
        digests["camera"] = hashlib.blake2b(views.camera_text().encode(), digest_size=16).hexdigest() if views else ""
        header = {"parameters": asdict(params), "files": digests}
        return dict(json.loads(json.dumps(header)))

    def _folders(self) -> list[str]:
        below = {os.path.dirname(output) for job in self._plan.jobs for output in self._plan.outputs(job)}
        return [os.path.join(self._plan.out, folder) for folder in ("", STATE_FOLDER, *sorted(below))]

    def _sweep(self) -> None:
        """Remove the temporaries of a run that was killed; under the lock nobody else can be writing one."""
        for folder in self._folders():
            with os.scandir(folder) as entries:
                left = [entry.path for entry in entries if is_temporary(entry.name)]
            for path in left:
                with contextlib.suppress(OSError):
                    os.unlink(path)

    def _work(self, started: Sequence[Process]) -> None:
        """Feed the workers and write what they reply, one reply of each together: the disk is waited for less often."""
        workers = self._options.num_workers
        pool = Pool(self._setup, workers, self._options.timeout, started)
        jobs = iter(self._plan.jobs)
        held: list[Reply] = []
        try:
            pool.watch(self._stop.descriptor)
            while not self._stop.signal:
                while pool.room > 0 and (job := next(jobs, None)) is not None:
                    self._offer(pool, job)
                if pool.idle:
                    break
                came = list(pool.replies(_TOGETHER_MS if held else None))
                held += came
                if len(held) >= workers or not came:
                    together, held = held, []
                    self._take(together)
        finally:
            self._take(held)
            pool.close()
        self._versions = pool.versions
        self.summary.signal = self._stop.signal

    def _offer(self, pool: Pool, job: Job) -> None:
        if job.source.problem:
            reason, message = job.source.problem.split(": ", 1)
            self._take([Reply(job.index, "failed", reason=reason, message=message)])
            return
        record = self._journal.get(job.index)
        known = None
        if record is not None and record.status == "ok" and record.version == __version__:
            known = (record.content, dict(record.outputs))
        outputs = self._plan.outputs(job)
        files = (job.source.path, job.truth, self._plan.out, outputs)
        pool.put(Task(job.index, *files, known, job.source.name, job.earlier, job.start))

    def _take(self, replies: Sequence[Reply]) -> None:
        """Write what replies bring and remember it: never more images at once than there are workers."""
        most = self._options.num_workers
        for first in range(0, len(replies), most):
            self._settle(replies[first : first + most])

    def _settle(self, replies: Sequence[Reply]) -> None:
        for reply in replies:
            if reply.status != "same":
                self._journal.forget(reply.index)
        begin = perf_counter()
        done = [reply for reply in replies if reply.status == "ok"]
        problems = self._written(done)
        spent = (perf_counter() - begin) * 1e3 / max(1, len(done))
        for reply in replies:
            if reply.status == "same":
                self._finished[reply.index] = 1
                self.summary.same += 1
                self._observer.finished(self._plan.jobs[reply.index], "same", "")
            else:
                self._remember(reply.index, self._record(reply, problems.get(reply.index, ""), spent))

    def _written(self, replies: Sequence[Reply]) -> dict[int, str]:
        """Write the outputs of images, all of them at once where that works; the problems of the others by index."""
        try:
            write_all_atomic(
                [(os.path.join(self._plan.out, path), data) for reply in replies for path, data, _ in reply.outputs]
            )
        except OutputError as error:
            if len(replies) == 1:
                return {replies[0].index: str(error)}
            return {index: text for reply in replies for index, text in self._written([reply]).items()}
        return {}

    def _remember(self, index: int, record: Record) -> None:
        try:
            self._journal.add(index, record)
        except OutputError as error:
            self._problem(str(error))
        self._finished[index] = 1
        if record.status == "ok":
            self.summary.done += 1
        else:
            self.summary.failed += 1
        told = record.row["error"] or ("" if self._setup.views else record.row.get("note", ""))
        self._observer.finished(self._plan.jobs[index], record.status, told)

    def _record(self, reply: Reply, problem: str, spent: float) -> Record:
        """Record of an image whose outputs are written, unless there was a problem, in so many milliseconds."""
        job = self._plan.jobs[reply.index]
        if reply.status == "failed":
            return self._failure(job, reply.reason, reply.message, reply.traceback)
        if problem:
            return self._failure(job, "output", problem)
        row = {"status": "ok", "error": "", **reply.row}
        row["write_ms"] += spent
        row["total_ms"] += spent
        rounded = {column: round(cell, 3) if column.endswith("_ms") else cell for column, cell in row.items()}
        digests = {path: digest for path, _, digest in reply.outputs}
        return Record(job.source.name, "ok", __version__, reply.content, digests, rounded, reply.extra)

    def _failure(self, job: Job, reason: str, message: str, trace: str = "") -> Record:
        if trace:
            self._log(f"{printable(job.source.path)}\n{reason}: {message}\n{trace}\n")
            message += f"; see {STATE_FOLDER}/errors.log in the output folder"
        row = {"status": "failed", "error": f"{reason}: {message}", "method": self._setup.params.method}
        return Record(job.source.name, "failed", __version__, "", {}, row)

    def _log(self, text: str) -> None:
        path = os.path.join(self._plan.out, STATE_FOLDER, "errors.log")
        try:
            with Path(path).open("a", encoding="utf-8", errors="backslashreplace") as file:
                file.write(f"{datetime.now(UTC).isoformat(timespec='seconds')} {text}\n")
        except OSError as error:
            self._problem(f"{printable(path)} cannot be written ({os.strerror(error.errno or 0)})")

    def _problem(self, text: str) -> None:
        if text not in self.summary.problems:
            self.summary.problems.append(text)
            self._observer.note(text)

    def _write_tables(self) -> None:
        extra = ("iou",) if self._plan.with_truth else ()
        starts = START_COLUMNS if any(job.start for job in self._plan.jobs) else ()
        columns = (*TIMING_COLUMNS, *extra, "stop_reason", "note", *(("pair",) if self._setup.views else ()), *starts)
        timings = csv_table(columns, ([row.get(column) for column in columns] for row in self.rows()))
        tables = [("timings.csv", timings), ("run.json", self._run_json())]
        if self._setup.views:
            tables.append(("obstacles.csv", csv_table(OBSTACLE_COLUMNS, self._obstacle_cells())))
        if "coco" in self._plan.wanted.exports:
            tables.append(("coco.json", self._coco()))
        files = [(os.path.join(self._plan.out, name), content) for name, content in tables]
        try:
            write_all_atomic(files)  # at once, the disk is waited for once
        except OutputError:
            self._write_each(files)
        sync_folders(self._folders())

    def _write_each(self, files: Sequence[tuple[str, bytes]]) -> None:
        """Write what can be written, and name each of the others."""
        for path, content in files:
            try:
                write_bytes_atomic(path, content)
            except OutputError as error:
                self._problem(str(error))

    def _coco(self) -> bytes:
        """The COCO documents of all finished images as one."""
        from ffseg.formats.exports import json_text, merge_coco

        finished = (job for job in self._plan.jobs if self._finished[job.index])
        records = ((job, self._journal.get(job.index)) for job in finished)
        done = (job for job, record in records if record is not None and record.status == "ok")
        paths = (Path(self._plan.out, COCO[0], job.stem + COCO[1]) for job in done)
        return json_text(merge_coco(json.loads(path.read_bytes()) for path in paths)).encode("ascii")

    def _write_report(self) -> None:
        from ffseg.batch.report import write_report

        try:
            write_report(self._plan.out)
        except FfsegError as error:  # the images are done all the same
            self._problem(str(error))

    def _run_json(self) -> bytes:
        summary = self.summary
        value = {
            "ffseg": __version__,
            "status": "interrupted" if summary.signal else "finished",
            "started": self._started.isoformat(timespec="seconds"),
            "ended": datetime.now(UTC).isoformat(timespec="seconds"),
            "seconds": round(summary.seconds, 3),
            "counts": {name: getattr(summary, name) for name in ("total", "done", "same", "failed")},
            "inputs": list(self._plan.inputs),
            "parameters": asdict(self._setup.params),
            "versions": dict(self._versions),
            "problems": summary.problems,
        }
        return (json.dumps(value, indent=2, default=str) + "\n").encode("utf-8")


def _digest_of(key: str, path: str | None, max_bytes: int) -> str:
    if path is None:
        return ""
    try:
        return hashlib.blake2b(read_bytes(path, max_bytes), digest_size=16).hexdigest()
    except ImageReadError as error:
        raise UsageError(f"{key}: {printable(path)}: {error}") from error


def _refuse_other_parameters(out: str, header: Mapping[str, Any]) -> None:
    old = read_header(out)
    if old is None:
        return
    changes = [*_differences(old.get("parameters", {}), header["parameters"]), *_changed_files(old, header)]
    if changes:
        shown = "; ".join(changes[:5]) + ("; ..." if len(changes) > 5 else "")
        raise UsageError(
            f"{printable(out)} holds results with other parameters ({shown}); "
            "use --overwrite to do them again, or another output folder"
        )


def _differences(old: Any, new: Any, key: str = "") -> list[str]:  # noqa: ANN401 - JSON values
    if isinstance(old, dict) and isinstance(new, dict):
        keys: Sequence[str] = sorted({*old, *new})
        return [
            text for name in keys for text in _differences(old.get(name), new.get(name), f"{key}.{name}".strip("."))
        ]
    return [] if old == new else [f"{key} was {json.dumps(old)}, is {json.dumps(new)}"]


def _changed_files(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    before = old.get("files", {})
    return [f"the file of {key} has changed" for key in new["files"] if before.get(key, "") != new["files"][key]]
