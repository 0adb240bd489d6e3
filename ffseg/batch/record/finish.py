"""The end of a packed run: its outputs in tar files in the order of the tables, and what a merge has moved found again."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from ffseg.batch.plan.jobs import Plan
from ffseg.batch.record.journal import Journal, read_records, state_folder
from ffseg.batch.record.ordered import OrderedPacks, in_order, packs_of, publish, remove_packs
from ffseg.batch.record.survey import Survey
from ffseg.batch.tar.members import Member, is_ordered, pack_path
from ffseg.batch.values import Record


class StoppedError(Exception):
    """The end was asked for while outputs were put in order: the next run does it."""


def put_in_order(
    out: str, journal: Journal, survey: Survey, header: Mapping[str, Any], stopped: Callable[[], bool]
) -> list[str]:
    """Copy all outputs into tar files in the order of the tables, unless they lie so already.

    Outputs of images that no longer stand in the tables come last. Whatever happens meanwhile, the journal names whole
    files: the earlier until the new ones are on the disk.

    Returns
    -------
    list of str
        Names of the tar files in the output folder.

    Raises
    ------
    OutputError
        Naming a file that cannot be written.
    StoppedError
        If the end is asked for.
    """
    entries = [*survey.entries]
    known = {entry for entry in entries if isinstance(entry, str)}
    entries += sorted(record.name for record in journal.others() if record.name not in known)

    def records() -> Iterator[tuple[int | str, Record]]:
        for entry in entries:
            if stopped():
                raise StoppedError
            record = journal.get(entry)
            if record is not None:
                yield entry, record

    packs = in_order(out, (record for _, record in records()))
    if packs is None:
        packs = []
        with OrderedPacks(out) as ordered:

            def moved() -> Iterator[tuple[int | str, Record]]:
                for entry, record in records():
                    yield entry, ordered.move(record)[0]
                packs.extend(ordered.complete())

            journal.rewrite(header, moved())
    names = publish(out, packs)
    remove_packs(packs_of(state_folder(out)))
    return names


def find_moved(out: str, journal: Journal, plan: Plan) -> None:
    """Let the journal of a shard know where a merge has moved the outputs of its images."""
    indices = {job.source.name: job.index for job in plan.jobs}
    for record in read_records(state_folder(out)):
        mine = journal.get(indices[record.name]) if record.name in indices else None
        if mine is not None:
            found = relocated(out, mine, record)
            if found is not mine:
                journal.add(indices[record.name], found)


def relocated(out: str, record: Record, merged: Record) -> Record:
    """A shard's record with the places that a merged one of the same image knows, where its own are gone."""
    members: dict[str, Member] = {}
    for path, member in record.members.items():
        same = path in merged.members and merged.outputs[path][0] == record.outputs[path][0]
        if same and is_gone(out, member):
            members[path] = merged.members[path]
    return replace(record, members={**record.members, **members}) if members else record


def is_gone(out: str, member: Member) -> bool:
    """Whether a shard no longer has the tar file of an output: a merge made one in order of it, or has made another."""
    return is_ordered(member[0]) or not os.path.lexists(pack_path(out, member[0]))
