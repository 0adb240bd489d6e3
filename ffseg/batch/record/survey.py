"""Which records are still true of the output folder, and their order in the tables."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain

from ffseg import __version__
from ffseg.batch.plan.jobs import Plan
from ffseg.batch.plan.reading import split_member_path
from ffseg.batch.record.journal import Journal
from ffseg.batch.record.keeper import retire
from ffseg.batch.record.tables import Records
from ffseg.batch.values import Record
from ffseg.batch.workers.freshness import output_stands, still_true, unchanged
from ffseg.errors import OutputError


def stale_reason(record: Record, out: str, settings: str) -> str:
    """Why a record no longer says what is in the output folder; empty when it does."""
    if record.settings != settings:
        return "made with other parameters"
    if record.version != __version__:
        return f"made by ffseg {record.version}"
    image = record.files.get("image", ("",))[0]
    changed = still_true(record.files) or ("" if record.made or os.path.isfile(split_member_path(image)[0]) else image)
    if changed:
        return f"{changed} has changed or is gone"
    outputs = record.outputs.items()
    lost = next((path for path, seen in outputs if not output_stands(out, path, seen, record.members.get(path))), "")
    return f"{lost} has changed or is gone" if lost else ""


def without_old_truth(record: Record) -> Record:
    """A record whose IoU is left out when the true mask it was measured with has changed or is gone."""
    file = record.files.get("truth")
    if file is None or unchanged(*file):
        return record
    row = {column: cell for column, cell in record.row.items() if column != "iou"}
    return replace(record, row=row)


@dataclass(slots=True)
class Survey(Records):
    """The records of a journal that stand in the tables."""

    journal: Journal
    names: list[str] = field(default_factory=list)
    """Of the images, in the order of the tables."""

    def records(self) -> Iterator[Record]:
        """Records in the order of the tables."""
        found = map(self.journal.get, self.names)
        return (without_old_truth(record) for record in found if record is not None)

    def takes(self, record: Record, reason: str) -> bool:
        """Whether a record stands, for there is no reason why it is no longer true; it is taken into account."""
        if record.stale != reason:
            with suppress(OutputError):  # a merge learns of it later
                self.journal.add(replace(record, stale=reason))
        if not reason:
            self.note(record)
        elif record.made:
            self.miss(record.name, reason)
        return not reason


def survey(journal: Journal, plan: Plan, settings: str, finished: bytearray) -> Survey:
    """Go through all records once: those of this run, and those of earlier ones that are still true.

    Rows stand in input order when the run covers all of them, else sorted by the order in which they were found.
    """
    found = Survey(journal)
    planned = {job.source.name: finished[job.index] for job in plan.jobs}
    records = (record for name in planned if (record := journal.get(name)) is not None)
    ordered: list[tuple[str, str]] = []
    others = False
    for record in chain(records, journal.records(without=planned)):
        if found.takes(record, "" if planned.get(record.name) else stale_reason(record, plan.out, settings)):
            ordered.append((record.order, record.name))
            others = others or record.name not in planned
    found.names = [name for _, name in (sorted(ordered) if others else ordered)]
    return found


def _is_gone(record: Record) -> bool:
    """Whether an image has been renamed, removed or changed, as far as its folder is there to tell."""
    image = record.files.get("image", ("",))[0]
    return bool(still_true(record.files)) and os.path.isdir(os.path.dirname(split_member_path(image)[0]) or ".")


def tidy(journal: Journal, plan: Plan, settings: str) -> int:
    """Remove what earlier runs left that belongs to no image any longer: of other parameters, or under another's name.

    To be called when every image of the plan is finished. Of tar files also the members of images that have been renamed,
    removed or changed since: files of theirs are named as stale and can be removed one by one, members cannot. Not where
    their whole folder is gone, as with a disk that is not mounted.

    Returns
    -------
    int
        How many outputs were removed. An image with one that holds something else than was written stays stale.
    """
    planned = {job.source.name for job in plan.jobs}
    others = list(journal.records(without=planned))
    if not others:
        return 0
    records = map(journal.get, planned)
    owned = {path for record in records if record is not None for path in record.outputs}
    removed = 0
    for other in others:
        over = other.settings != settings or (plan.tars and _is_gone(other))
        if over or not owned.isdisjoint(other.outputs):
            retired = {path: digest for path, (digest, _) in other.outputs.items() if path not in owned}
            count, left = retire(plan.out, retired, other.members)
            removed += count
            if not left:
                journal.drop(other)
    return removed
