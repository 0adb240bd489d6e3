"""The journal of a run: what is done, from what content, parameters and version, one line an image."""

from __future__ import annotations

import errno
import json
import os
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ffseg.batch.discover import STATE_FOLDER
from ffseg.errors import OutputError
from ffseg.formats.files import printable, write_bytes_atomic

FORMAT = 1
"""Version of the lines below; a journal of another one is not read."""
_ABSENT = -1


@dataclass(frozen=True, slots=True)
class Record:
    """One finished image.

    Attributes
    ----------
    name : str
        Of the source.
    status : str
        ``ok`` or ``failed``; only what is ok is done.
    version : str
        Of ffseg when it was made.
    content : str
        Digest of everything that went in beside the parameters.
    outputs : mapping of str to str
        Path below the output folder to the digest of its content.
    row : mapping
        Its line of ``timings.csv`` by column.
    extra : sequence of mappings
        Its lines of ``obstacles.csv``.
    """

    name: str
    status: str
    version: str
    content: str
    outputs: Mapping[str, str]
    row: Mapping[str, Any]
    extra: Sequence[Mapping[str, Any]] = field(default_factory=list)


_FIELDS = tuple(part.name for part in fields(Record))


def read_header(out: str) -> dict[str, Any] | None:
    """First line of the journal in an output folder; None when there is none that can be read."""
    try:
        with Path(_path(out)).open("rb") as file:
            header = _parsed(file.readline())
    except OSError:
        return None
    return header if header is not None and header.get("format") == FORMAT else None


def _path(out: str) -> str:
    return os.path.join(out, STATE_FOLDER, "journal.jsonl")


def _parsed(line: bytes) -> dict[str, Any] | None:
    """Content of a whole line; None for one that a killed run or a full disk left unfinished."""
    if not line.endswith(b"\n"):
        return None
    try:
        value = json.loads(line)
    except ValueError:
        return None
    return value if isinstance(value, dict) else None


class Journal:
    """Append-only file of records below the output folder.

    Memory holds only the place of each record, in an array that is as long at the first image as at the last.

    Parameters
    ----------
    out : str
        Output folder.
    header : mapping
        First line: what all records have in common.
    names : sequence of str
        Sources of the run, in input order.
    keep : bool
        Take over the records of an earlier run.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """

    def __init__(self, out: str, header: Mapping[str, Any], names: Sequence[str], *, keep: bool) -> None:
        self._path = _path(out)
        self._places = array("q", [_ABSENT]) * len(names)
        self._unwritten: dict[int, Record] = {}
        old = self._old_lines(set(names)) if keep and read_header(out) is not None else {}
        lines = [_line({"format": FORMAT, **header})]
        end = len(lines[0])
        for index, name in enumerate(names):
            if name in old:
                self._places[index] = end
                lines.append(old[name])
                end += len(old[name])
        write_bytes_atomic(self._path, b"".join(lines))
        self._end = end
        self._descriptor = os.open(self._path, os.O_RDWR | os.O_APPEND | os.O_CLOEXEC)

    def _old_lines(self, wanted: set[str]) -> dict[str, bytes]:
        lines = {}
        with Path(self._path).open("rb") as file:
            file.readline()
            for line in file:
                value = _parsed(line)
                if value is not None and value.get("name") in wanted:
                    lines[value["name"]] = line
        return lines

    def get(self, index: int) -> Record | None:
        """Record of an image, if there is one."""
        if index in self._unwritten:
            return self._unwritten[index]
        place = self._places[index]
        if place == _ABSENT:
            return None
        line = b""
        while not line.endswith(b"\n"):
            piece = os.pread(self._descriptor, 4096, place + len(line))
            if not piece:
                return None
            line += piece[: piece.find(b"\n") + 1 or len(piece)]
        value = _parsed(line)
        return None if value is None else Record(**value)

    def add(self, index: int, record: Record) -> None:
        """Append a record with one write.

        Raises
        ------
        OutputError
            If it could not be written; the record is then kept in memory.
        """
        line = _line({name: getattr(record, name) for name in _FIELDS})  # asdict would copy every cell first
        try:
            written = os.write(self._descriptor, line)
            if written != len(line):
                os.ftruncate(self._descriptor, self._end)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            self._unwritten[index] = record
            reason = os.strerror(error.errno or 0)
            raise OutputError(f"{printable(self._path)} cannot be written ({reason}); free some space") from error
        self._places[index] = self._end
        self._end += len(line)

    def forget(self, index: int) -> None:
        """Drop what is known of an image in memory: it is about to be done again."""
        self._places[index] = _ABSENT
        self._unwritten.pop(index, None)

    def close(self) -> None:
        """Flush the file to the disk and close it."""
        try:
            os.fsync(self._descriptor)
        except OSError:  # the outputs are safe; at worst an image is done again
            pass
        finally:
            os.close(self._descriptor)


def _line(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value, separators=(",", ":")).encode("ascii") + b"\n"
