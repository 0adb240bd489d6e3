"""Tar files in the order of the tables, one for each kind of output: the same bytes however the work was shared out."""

from __future__ import annotations

import contextlib
import os
import uuid
from collections.abc import Iterable, Sequence
from dataclasses import replace

from ffseg.batch.outputs.table import PACKS
from ffseg.batch.plan.sources import STATE_FOLDER
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
from ffseg.batch.values import Record
from ffseg.errors import OutputError
from ffseg.io.files import AT_ONCE, printable, read_at, sync_folders

_MOST_OPEN = 64
"""Tar files read from at once."""
_FOLDER = f"{STATE_FOLDER}/{PACKS}"


class OrderedPacks:
    """Tar files of all outputs, one for each kind, that get their names together.

    Nothing refers to them before the journal does that is written from what `move` gives: `complete` comes before it,
    `publish` after it. A context manager that leaves nothing behind unless they were completed.
    """

    def __init__(self, out: str) -> None:
        self._out = out
        self._token = uuid.uuid4().hex[:12]
        self._tars: dict[str, PackWriter] = {}
        self._sources: dict[str, int] = {}
        self._whole = False

    def __enter__(self) -> OrderedPacks:
        return self

    def __exit__(self, *_: object) -> None:
        self._close_sources()
        for tar in self._tars.values():
            tar.close()
        if not self._whole:
            remove_packs([os.path.join(self._out, tar.pack) for tar in self._tars.values()])

    def move(self, record: Record) -> tuple[Record, list[str]]:
        """Copy the outputs of a record.

        Returns
        -------
        Record
            With the places of the copies, and `NOWHERE` for what is left out.
        list of str
            Outputs that are not what was written, and are left out.

        Raises
        ------
        OutputError
            Naming the tar file that cannot be written.
        """
        members, lost = dict[str, Member](), list[str]()
        for path in sorted(record.outputs):
            data = self._content(record.members.get(path))
            if data is not None and digest(data) == record.outputs[path][0]:
                members |= self._tar(kind_of(path)).append([(path, data)], sync=False)
            else:
                members[path] = NOWHERE
                lost.append(path)
        return replace(record, members=members), lost

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
            if len(self._sources) >= _MOST_OPEN:
                self._close_sources()
            self._sources[pack] = os.open(pack_path(self._out, pack), os.O_RDONLY | AT_ONCE)
        return self._sources[pack]

    def _close_sources(self) -> None:
        for descriptor in self._sources.values():
            os.close(descriptor)
        self._sources.clear()

    def complete(self) -> list[str]:
        """Put everything on the disk; the tar files, as records name them.

        Raises
        ------
        OutputError
            Naming the tar file that cannot be written.
        """
        for tar in self._tars.values():
            tar.finish()
        sync_folders([os.path.join(self._out, _FOLDER)] if self._tars else [])
        self._whole = True
        return [tar.pack for tar in self._tars.values()]


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
            _require_file(target)
            try:
                os.replace(source, target)
            except OSError as error:
                raise unwritable(target, error) from error
    sync_folders([out])
    return names


def _require_file(path: str) -> None:
    if os.path.lexists(path) and not os.path.isfile(path):
        raise OutputError(f"{printable(path)} is not a regular file and is not replaced; remove it, then run again")


def packs_of(state: str) -> list[str]:
    """Paths of the tar files below a state folder."""
    folder = os.path.join(state, PACKS)
    try:
        return [os.path.join(folder, name) for name in os.listdir(folder)]
    except OSError:
        return []


def remove_packs(paths: Sequence[str]) -> None:
    """Remove tar files that nothing refers to any longer."""
    for path in paths:
        with contextlib.suppress(OSError):
            os.unlink(path)
