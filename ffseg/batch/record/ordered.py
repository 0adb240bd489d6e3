"""Tar files in the order of the tables, one for each kind of output, with the same bytes for any division of the work.

They are made at the end of a packed run, and of a merge; what a merge has moved its shards find again.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from ffseg.batch.outputs.table import PACKS
from ffseg.batch.plan.sources import STATE_FOLDER
from ffseg.batch.record.journal import Journal, journal_lines, state_folder
from ffseg.batch.record.survey import Survey
from ffseg.batch.tar.members import (
    END,
    NOWHERE,
    Member,
    digest,
    final_name,
    is_ordered,
    kind_of,
    ordered_pack,
    pack_path,
    padding,
)
from ffseg.batch.tar.writer import PackWriter, head_size, unwritable
from ffseg.batch.values import Record, parsed_record, record_line
from ffseg.io.files import AT_ONCE, read_at, remove_files, require_replaceable, sync_folders

_MAX_OPEN = 64
"""Tar files read from at once."""
_FOLDER = f"{STATE_FOLDER}/{PACKS}"
MAX_NAMED = 20
"""Outputs that are missing and are named."""


class OrderedPacks:
    """Tar files of all outputs, one for each kind, that get their names together.

    Nothing refers to them before the journal does that is written from what `moved` gives; `publish` comes after it. A
    context manager that leaves nothing behind unless they were completed.

    Attributes
    ----------
    packs : list of str
        The tar files, as records name them, once they are whole.
    lost : list of str
        Outputs that are not what was written, and are left out: no more than `MAX_NAMED` of them.
    """

    def __init__(self, out: str) -> None:
        self._out = out
        self._token = os.urandom(6).hex()
        self._tars: dict[str, PackWriter] = {}
        self._sources: dict[str, int] = {}
        self.packs: list[str] = []
        self.lost: list[str] = []

    def __enter__(self) -> OrderedPacks:
        return self

    def __exit__(self, *_: object) -> None:
        self._close_sources()
        for tar in self._tars.values():
            tar.close()
        if not self.packs:
            remove_files(os.path.join(self._out, tar.pack) for tar in self._tars.values())

    def moved(self, records: Iterable[Record]) -> Iterator[Record]:
        """Copy the outputs of records, then put everything on the disk.

        Yields
        ------
        Record
            With the places of the copies, and `NOWHERE` for what is left out.
        """
        for record in records:
            members = dict[str, Member]()
            for path in sorted(record.outputs):
                data = self._content(record.members.get(path))
                if data is not None and digest(data) == record.outputs[path][0]:
                    members |= self._tar(kind_of(path)).append([(path, data)], sync=False)
                else:
                    members[path] = NOWHERE
                    self.lost += [path] * (len(self.lost) < MAX_NAMED)
            yield replace(record, members=members)
        self.complete()

    def _tar(self, kind: str) -> PackWriter:
        if kind not in self._tars:
            self._tars[kind] = PackWriter(self._out, ordered_pack(_FOLDER, kind, self._token))
        return self._tars[kind]

    def _content(self, member: Member | None) -> bytes | None:
        if member is None or member == NOWHERE:
            return None
        pack, offset, length = member
        try:
            return read_at(self._source(pack), length, offset)
        except OSError:
            return None

    def _source(self, pack: str) -> int:
        if pack not in self._sources:
            if len(self._sources) >= _MAX_OPEN:
                self._close_sources()
            self._sources[pack] = os.open(pack_path(self._out, pack), os.O_RDONLY | AT_ONCE)
        return self._sources[pack]

    def _close_sources(self) -> None:
        for descriptor in self._sources.values():
            os.close(descriptor)
        self._sources.clear()

    def complete(self) -> None:
        """Put everything on the disk."""
        for tar in self._tars.values():
            tar.finish()
        sync_folders([os.path.join(self._out, _FOLDER)] if self._tars else [])
        self.packs = [tar.pack for tar in self._tars.values()]


def in_order(out: str, records: Iterable[Record]) -> list[str] | None:
    """The tar files of records whose outputs lie there just as `OrderedPacks` would write them; else None."""
    ends: dict[str, tuple[str, int]] = {}
    for record in records:
        for path in sorted(record.outputs):
            member = record.members.get(path)
            if member == NOWHERE:
                continue
            pack, offset, length = member or NOWHERE
            before, end = ends.get(kind_of(path), (pack, 0))
            if not is_ordered(pack) or pack != before or offset != end + head_size(path):
                return None
            ends[kind_of(path)] = (pack, offset + length + padding(length))
    whole = all(_size(pack_path(out, pack)) == end + len(END) for pack, end in ends.values())
    return [pack for pack, _ in ends.values()] if whole else None


def _size(path: str) -> int:
    try:
        return os.stat(path).st_size
    except OSError:
        return -1


def publish(out: str, packs: Iterable[str]) -> list[str]:
    """Give tar files that are in order their names in the output folder; those that have them are left alone.

    Returns
    -------
    list of str
        The names of all of them.

    Raises
    ------
    OutputError
        Naming one that cannot get its name; the journal knows where it is, and the next run tries again.
    """
    names = []
    for pack in sorted(packs):
        source, name = os.path.join(out, pack), final_name(pack)
        names.append(name)
        target = os.path.join(out, name)
        if os.path.lexists(source):
            require_replaceable(target)
            try:
                os.replace(source, target)
            except OSError as error:
                raise unwritable(target, error) from error
    sync_folders([out])
    return names


def packs_of(state: str) -> list[str]:
    """Paths of the tar files below a state folder."""
    folder = os.path.join(state, PACKS)
    try:
        return [os.path.join(folder, name) for name in os.listdir(folder)]
    except OSError:
        return []


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
    names = survey.names
    names = [*names, *sorted(record.name for record in journal.records(without=frozenset(names)))]

    def records() -> Iterator[Record]:
        for record in filter(None, map(journal.get, names)):
            if stopped():
                raise StoppedError
            yield record

    packs = in_order(out, records())
    if packs is None:
        with OrderedPacks(out) as ordered:
            moved = ordered.moved(records())
            journal.rewrite(header, ((record.name, record_line(record)) for record in moved))
        packs = ordered.packs
    published = publish(out, packs)
    remove_files(packs_of(state_folder(out)))
    return published


def moved_records(out: str, mine: Callable[[str], Record | None]) -> Iterator[Record]:
    """Records of a shard, which `mine` gives by their names, whose outputs a merge has moved: with the places they have now."""
    for merged in filter(None, map(parsed_record, journal_lines(state_folder(out)))):
        record = mine(merged.name)
        if record is not None and (found := relocated(out, record, merged)) is not record:
            yield found


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
