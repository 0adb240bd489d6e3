"""Keeps outputs and journal in step: what is written is recorded, and what is replaced is removed."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter
from typing import Any

from ffseg import __version__
from ffseg.batch.plan.jobs import Plan
from ffseg.batch.plan.reading import place_of
from ffseg.batch.plan.sources import Job, order_key
from ffseg.batch.record.journal import Journal, read_header, state_folder, tables_of
from ffseg.batch.record.tables import TIME_COLUMN
from ffseg.batch.tar.members import Member, output_digest
from ffseg.batch.tar.writer import Store
from ffseg.batch.values import Mark, Record
from ffseg.batch.workers.freshness import mark_of
from ffseg.batch.workers.messages import Done, Failed, Reply
from ffseg.errors import OutputError
from ffseg.io.files import printable, require_replaceable

Outputs = Mapping[str, tuple[str, Mark]]


@dataclass(slots=True)
class Keeper:
    """Writes what replies bring and remembers it."""

    plan: Plan
    journal: Journal
    header: Mapping[str, Any]
    """What all records have in common."""
    method: str
    """For the rows of images that failed."""
    tell: Callable[[str], None]
    """Hears of problems that belong to no image."""
    store: Store
    """Takes the outputs."""
    tables_before: list[str]
    """Tables that an earlier run wrote."""
    _places: dict[str, Member] = field(default_factory=dict)
    """Of the outputs that were written last."""

    @property
    def settings(self) -> str:
        """Digest of the parameters of this run."""
        return str(self.header["settings"])

    @property
    def state(self) -> str:
        """State folder of this run."""
        return state_folder(self.plan.out, self.plan.shard)

    def close(self) -> None:
        """Close what is written to."""
        self.store.close()
        self.journal.close()

    def adopt(self, reply: Done) -> None:
        """Remember what a run had made that did not live to do so; whether it is right is found out as for any record."""
        if not reply.unchanged:
            before = self.journal.get(self.plan.jobs[reply.index].source.name)
            record = self._done(reply, before, 0.0)
            self._remember(record if before is None else replace(record, left=self._left(before, record)))

    def complete(self, replies: Sequence[Reply]) -> list[Record]:
        """Write the outputs of replies together, then remember each: as its record."""
        begin = perf_counter()
        self._places.clear()
        done = [reply for reply in replies if isinstance(reply, Done)]
        problems = self._written(done)
        spent = (perf_counter() - begin) * 1e3 / max(1, len(done))
        return [self._completed(reply, problems.get(reply.index, ""), spent) for reply in replies]

    def _written(self, replies: Sequence[Done]) -> dict[int, str]:
        """Write the outputs of images, all of them at once where that works; the problems of the others by index."""
        try:
            files = [(one.path, one.data) for reply in replies for one in reply.outputs if one.data is not None]
            self._places |= self.store.write(files)
        except OutputError as error:
            if len(replies) == 1:
                return {replies[0].index: str(error)}
            return {index: text for reply in replies for index, text in self._written([reply]).items()}
        return {}

    def _path(self, output: str) -> str:
        return os.path.join(self.plan.out, output)

    def _completed(self, reply: Reply, problem: str, spent: float) -> Record:
        before = self.journal.get(self.plan.jobs[reply.index].source.name)
        if isinstance(reply, Done) and not problem:
            record = self._done(reply, before, spent)
        else:
            record = self._failure(reply, problem, before)
            new = reply.outputs if isinstance(reply, Done) else ()  # some of them may be written
            retire(self.plan.out, {one.path: one.digest for one in new if one.path not in record.outputs}, {})
        if before is not None:
            record = replace(record, left=self._left(before, record))
        if record != before:
            self.journal.forget(record.name)  # whatever happens now, the earlier line is no longer true
            self._remember(record)
        return record

    def _remember(self, record: Record) -> None:
        try:
            self.journal.add(record)
        except OutputError as error:
            self.tell(str(error))

    def _done(self, reply: Done, before: Record | None, spent: float) -> Record:
        """Record of an image whose outputs are written, in so many milliseconds."""
        job, row = self.plan.jobs[reply.index], dict(reply.row)
        extra: Sequence[Mapping[str, Any]] = reply.extra
        if reply.unchanged and before is not None:
            row, extra = {**before.row, **row}, before.extra
            if not job.truth and (before.status != "ok" or self.plan.with_truth):
                row.pop("iou", None)  # its true mask was wrong, and is not asked for, or is not among those asked for
        else:
            row = {"status": "ok", "error": "", **row, **_time_of(job)}
            row["write_ms"] += spent
            row["total_ms"] += spent
            row = {column: round(cell, 3) if column.endswith("_ms") else cell for column, cell in row.items()}
        new = {one.path: one.member or self._places.get(one.path) for one in reply.outputs}
        members = {path: member for path, member in new.items() if member is not None}
        written = {
            one.path: (one.digest, (members[one.path][2], 0) if one.path in members else mark_of(self._path(one.path)))
            for one in reply.outputs
        }
        known: Outputs = {} if before is None else before.outputs
        kept = {path: known[path] for path in reply.kept if path in known}
        record = replace(
            self._record(job, before, {**kept, **written}, row),
            content=reply.digests.content,
            extra=extra,
            truth=reply.digests.truth,
            files=reply.digests.files,
            members={**_members_of(before, kept), **members},
        )
        if not (job.truth or self.plan.with_truth) and before is not None and before.status == "ok":
            result, earlier = ((one.content, one.settings, one.version) for one in (record, before))
            record = _with_truth_of(record, before) if result == earlier else record
        status = "failed" if reply.problem else "ok"  # for something that leaves its outputs right
        return replace(record, status=status, row={**record.row, "status": status, "error": reply.problem})

    def _failure(self, reply: Reply, problem: str, before: Record | None) -> Record:
        job = self.plan.jobs[reply.index]
        if isinstance(reply, Failed):
            reason, message = reply.reason, reply.message
            if reply.traceback:
                self._log(f"{printable(job.source.display_path)}\n{reason}: {message}\n{reply.traceback}\n")
                message += f"; see {os.path.relpath(self._log_path, self.plan.out)} in the output folder"
        else:
            reason, message = "output", problem
        row = {"status": "failed", "error": f"{reason}: {message}", "method": self.method, **_time_of(job)}
        path = place_of(job.source.content)
        left = before.outputs if before is not None and reason == "output" else {}
        record = self._record(job, before, left, row)
        return replace(record, files={"image": (path, "", mark_of(path))}, members=_members_of(before, left))

    def _record(self, job: Job, before: Record | None, outputs: Outputs, row: Mapping[str, Any]) -> Record:
        """Record of an image of this run, of which nothing is known but its outputs and its row."""
        order = before.order if before is not None else order_key(job.source.place, job.source.name)
        return Record(job.source.name, row["status"], __version__, self.settings, "", outputs, row, order=order)

    def _left(self, before: Record, now: Record) -> tuple[str, ...]:
        """Remove the outputs an image no longer has; those that hold something else than was written are left."""
        files = now.outputs.keys() - now.members.keys()
        lost = before.outputs.keys() - before.members.keys() - files
        retired = {path: before.outputs[path][0] for path in lost}
        stale = {*retire(self.plan.out, retired, {})[1], *before.left} - files
        return tuple(sorted(path for path in stale if os.path.lexists(self._path(path))))

    @property
    def _log_path(self) -> str:
        return os.path.join(self.state, "errors.log")

    def _log(self, text: str) -> None:
        path = self._log_path
        try:
            require_replaceable(path)
            with Path(path).open("a", encoding="utf-8", errors="backslashreplace") as file:
                file.write(f"{datetime.now(UTC).isoformat(timespec='seconds')} {text}\n")
        except OSError as error:
            self.tell(f"{printable(path)} cannot be written ({os.strerror(error.errno or 0)})")
        except OutputError as error:
            self.tell(str(error))


def open_keeper(
    plan: Plan, header: Mapping[str, Any], method: str, tell: Callable[[str], None], joint: Iterable[str]
) -> Keeper:
    """A keeper of a plan's outputs, and of files for all images, which takes over the journal of an earlier run."""
    state = state_folder(plan.out, plan.shard)
    before = tables_of(read_header(state))
    header = {**header, "tables": sorted({*before, *joint}), **({"pack": True} if plan.tars else {})}
    store = Store(plan.out, state, packed=bool(plan.tars))
    return Keeper(plan, Journal(state, header), header, method, tell, store, before)


def _time_of(job: Job) -> dict[str, float]:
    return {} if job.source.time is None else {TIME_COLUMN: job.source.time}


def _members_of(record: Record | None, outputs: Mapping[str, Any]) -> dict[str, Member]:
    """Where those of the outputs lie that are no files of their own."""
    known = {} if record is None else record.members
    return {path: member for path, member in known.items() if path in outputs}


def _with_truth_of(record: Record, before: Record) -> Record:
    """A record with what was measured when a true mask was asked for: the mask is the same."""
    row = {**record.row, **{key: before.row[key] for key in ("iou",) if key in before.row}}
    files = {**record.files, **{role: file for role, file in before.files.items() if role == "truth"}}
    return replace(record, row=row, truth=before.truth, files=files)


def retire(out: str, outputs: Mapping[str, str], members: Mapping[str, Member]) -> tuple[int, list[str]]:
    """Remove outputs that no record holds any longer; those in tar files are gone with the record.

    Parameters
    ----------
    outputs : mapping of str to str
        Path below `out` to the digest of what was written there.
    members : mapping of str to Member
        Where those of them lie that are no files of their own.

    Returns
    -------
    int
        How many were removed.
    list of str
        Paths that hold something else by now: not ours to remove.
    """
    removed, stale = 0, []
    for path, digest in outputs.items():
        found = output_digest(out, path, members.get(path))
        if path in members:
            removed += found == digest
        elif found == digest:
            with contextlib.suppress(OSError):
                os.unlink(os.path.join(out, path))
                removed += 1
        elif os.path.lexists(os.path.join(out, path)):
            stale.append(path)
    return removed, stale
