"""The journal: one line for each finished image, written as soon as its outputs are in place."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ffseg.batch.plan.sources import STATE_FOLDER
from ffseg.batch.values import Record, json_line, parsed_line, parsed_record, record_line
from ffseg.errors import UsageError
from ffseg.io.files import OWN, atomic_stream, printable, read_at, unwritten

FORMAT = 2
"""Version of the lines; a journal of another one is not read."""
JOURNAL = "journal.jsonl"
SHARDS = "shards"
"""Folder below that of a run's state, with one for each shard."""
_ABSENT = -1


def state_folder(out: str, shard: str = "") -> str:
    """Folder of a run's state, or of one shard's."""
    return os.path.join(out, STATE_FOLDER, SHARDS, shard) if shard else os.path.join(out, STATE_FOLDER)


def shard_names(out: str) -> list[str]:
    """Names of the folders of shards, whatever they are."""
    root = os.path.join(state_folder(out), SHARDS)
    return os.listdir(root) if os.path.isdir(root) else []


def tables_of(header: Mapping[str, Any] | None) -> list[str]:
    """Files for all images that the header of a journal names; none without a header."""
    return [name for name in (header or {}).get("tables", ()) if isinstance(name, str)]


def read_header(folder: str) -> dict[str, Any] | None:
    """First line of the journal in a state folder; None when there is none that can be read.

    Raises
    ------
    UsageError
        If something that is no file has its name.
    """
    path = os.path.join(folder, JOURNAL)
    refuse_special(path)
    try:
        with Path(path).open("rb") as file:
            header = parsed_line(file.readline())
    except OSError:
        return None
    return header if header is not None and header.get("format") == FORMAT else None


def journal_lines(folder: str) -> Iterator[bytes]:
    """Lines of the journal in a state folder, without its header; none where there is none that can be read."""
    if read_header(folder) is not None:
        with Path(folder, JOURNAL).open("rb") as file:
            file.readline()
            yield from file


def last_lines(folder: str) -> Iterator[tuple[str, bytes]]:
    """The last line of each name that is not gone, in the order in which the names came first."""
    if read_header(folder) is None:
        return
    last: dict[str, tuple[int, int]] = {}
    with Path(folder, JOURNAL).open("rb") as file:
        start = len(file.readline())
        for line in file:
            name, gone = _subject(line)
            if gone:
                last.pop(name, None)
            elif name:
                last[name] = (start, len(line))
            start += len(line)
        for name, (start, length) in last.items():
            file.seek(start)
            yield name, file.read(length)


def last_records(folder: str) -> dict[str, Record]:
    """The record of each name that is not gone."""
    lines = last_lines(folder)
    return {name: record for name, line in lines if (record := parsed_record(line)) is not None}


def refuse_special(path: str) -> None:
    """Refuse what would block or act when it is opened.

    Raises
    ------
    UsageError
        If a pipe, a device, a socket or a folder has this name.
    """
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return
    if not stat.S_ISREG(mode):
        raise UsageError(f"{printable(path)} is not a regular file; remove it or choose another output folder")


class Journal:
    """Append-only file of records in a state folder; memory holds only the place of each, by the image's name.

    Parameters
    ----------
    folder : str
        State folder.
    header : mapping
        First line: what all records have in common.
    """

    def __init__(self, folder: str, header: Mapping[str, Any]) -> None:
        self._path, self._descriptor = os.path.join(folder, JOURNAL), _ABSENT
        self._unwritten: dict[str, Record] = {}
        refuse_special(self._path)
        self.rewrite(header, last_lines(folder))

    def rewrite(self, header: Mapping[str, Any], lines: Iterable[tuple[str, bytes]]) -> None:
        """Put lines about images of these names in the place of all there are.

        Raises
        ------
        OutputError
            If the file cannot be written; the journal is then as it was.
        """
        places = dict[str, int]()
        with atomic_stream(self._path) as file:
            end = file.write(json_line({"format": FORMAT, **header}))
            for name, line in lines:
                places[name] = end
                end += file.write(line)
        if self._descriptor != _ABSENT:
            os.close(self._descriptor)
        self._descriptor = os.open(self._path, os.O_RDWR | os.O_APPEND | OWN)
        self._places, self._end = places, end
        self._unwritten.clear()

    def get(self, name: str) -> Record | None:
        """Record of an image; None where there is none."""
        if name in self._unwritten:
            return self._unwritten[name]
        line, place = b"", self._places.get(name, _ABSENT)
        while place != _ABSENT and not line.endswith(b"\n"):
            piece = read_at(self._descriptor, 4096, place + len(line))
            if not piece:
                return None
            line += piece[: piece.find(b"\n") + 1 or len(piece)]
        return parsed_record(line)

    def records(self, without: Collection[str] = ()) -> Iterator[Record]:
        """Records of all images but some, in the order in which they came."""
        return (record for name in self._places if name not in without and (record := self.get(name)) is not None)

    def drop(self, record: Record) -> None:
        """Forget an image, in the file as well; a full disk only puts that off."""
        self.forget(record.name)
        with contextlib.suppress(OSError):
            self._append(json_line({"name": record.name, "order": record.order, "gone": True}))

    def add(self, record: Record) -> None:
        """Append a record with one write.

        Raises
        ------
        OutputError
            If it could not be written; the record is then kept in memory.
        """
        try:
            place = self._append(record_line(record))
        except OSError as error:
            self._unwritten[record.name] = record
            raise unwritten(self._path, error) from error
        self._unwritten.pop(record.name, None)
        self._places[record.name] = place

    def _append(self, line: bytes) -> int:
        written = os.write(self._descriptor, line)
        if written != len(line):
            os.ftruncate(self._descriptor, self._end)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        place, self._end = self._end, self._end + len(line)
        return place

    def forget(self, name: str) -> None:
        """Drop what is known of an image in memory: it is about to be done again."""
        self._places.pop(name, None)
        self._unwritten.pop(name, None)

    def close(self) -> None:
        """Flush the file to the disk and close it."""
        try:
            os.fsync(self._descriptor)
        except OSError:  # the outputs are safe; at worst an image is done again
            pass
        finally:
            os.close(self._descriptor)


def _subject(line: bytes) -> tuple[str, bool]:
    """Name a line is about, empty for a line of another shape, and whether it says that the record is gone."""
    record = parsed_record(line)
    if record is not None:
        return record.name, False
    value = parsed_line(line) or {}
    gone = value.get("gone") is True and isinstance(value.get("name"), str)
    return (value["name"], True) if gone else ("", False)
