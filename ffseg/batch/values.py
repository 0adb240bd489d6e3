"""The record of one image and its serialisation: a record of another shape counts as unknown."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from ffseg import __version__
from ffseg.batch.tar.members import Member

T = TypeVar("T")
Mark = tuple[int, int]
"""Size and time of change (ns) of a file: while they are the same, its content is not read again."""
File = tuple[str, str, Mark]
"""Path, digest and mark."""


@dataclass(frozen=True, slots=True)
class Record:
    """One finished image."""

    name: str
    """Of the source."""
    status: str
    """``ok`` or ``failed``."""
    version: str
    """Of ffseg when it was made."""
    settings: str
    """Digest of the parameters, and of the files they name, that it was made with."""
    content: str
    """Digest of everything else that went in; empty when it was not made."""
    outputs: Mapping[str, tuple[str, Mark]]
    """Path below the output folder to the digest of its content and its mark. Of a failed image: what is left of an
    earlier run because it could not be replaced."""
    row: Mapping[str, Any]
    """Its line of ``timings.csv`` by column."""
    extra: Sequence[Mapping[str, Any]] = field(default_factory=list)
    """Its lines of ``obstacles.csv``."""
    truth: str = ""
    """Digest of the true mask its IoU was measured with."""
    files: Mapping[str, File] = field(default_factory=dict)
    """What it was made from, by what each file is for (`Digests.files`)."""
    left: Sequence[str] = ()
    """Paths below the output folder where it had an output that now holds something else: not ours to remove, but
    named."""
    order: str = ""
    """Sorts records as their images were found (`ffseg.batch.plan.sources`)."""
    members: Mapping[str, Member] = field(default_factory=dict)
    """Where those of its outputs lie that are no files of their own."""
    stale: str = ""
    """Why it stood in no table at the end of the last run, as that found: a merge cannot ask the disk of its machine."""

    @property
    def made(self) -> bool:
        """Whether there is a result: of a failed image when only its true mask was wrong."""
        return bool(self.content)

    def fits(self, settings: str) -> bool:
        """Whether there is a result of these parameters and this version."""
        return self.made and (self.version, self.settings) == (__version__, settings)


_TEXTS = ("name", "status", "version", "settings", "content", "truth", "order")
_FIELDS = (*_TEXTS, "outputs", "row", "extra", "files", "left")
_OPTIONAL_FIELDS = ("members", "stale")


def record_line(record: Record) -> bytes:
    """A record as one line."""
    value = {name: getattr(record, name) for name in _FIELDS}  # asdict would copy every cell first
    return json_line(value | {name: seldom for name in _OPTIONAL_FIELDS if (seldom := getattr(record, name))})


def json_line(value: Mapping[str, Any]) -> bytes:
    """A value as one line of ASCII JSON."""
    return json.dumps(value, separators=(",", ":")).encode("ascii") + b"\n"


def parsed_line(line: bytes) -> dict[str, Any] | None:
    """Content of a whole line; None for one that a killed run or a full disk left unfinished."""
    if not line.endswith(b"\n"):
        return None
    try:
        value = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, dict) else None


def parsed_record(line: bytes) -> Record | None:
    """Record of a line; None when it is none, or one of another shape."""
    value = parsed_line(line)
    if value is None or value.keys() - {*_OPTIONAL_FIELDS} != set(_FIELDS):
        return None
    if not all(isinstance(value.get(name, ""), str) for name in (*_TEXTS, "stale")):
        return None
    try:
        members = {path: _member(*member) for path, member in value.get("members", {}).items()}
        outputs = {path: (_typed(str, digest), _mark(*mark)) for path, (digest, mark) in value["outputs"].items()}
        files = {
            role: (_typed(str, path), _typed(str, digest), _mark(*mark))
            for role, (path, digest, mark) in value["files"].items()
        }
        row, extra = _cells(value["row"]), [_typed(dict, cells) for cells in value["extra"]]
        left = tuple(_typed(str, path) for path in value["left"])
    except (TypeError, ValueError, AttributeError):
        return None
    if row.get("status") != value["status"] or not isinstance(row.get("error"), str):
        return None
    parts = {"outputs": outputs, "files": files, "row": row, "extra": extra, "left": left, "members": members}
    return Record(**{**value, **parts})


def _typed(kind: type[T], value: object) -> T:
    if type(value) is not kind:  # a truth value is no number
        raise TypeError(type(value).__name__)
    return value


def _member(pack: object, offset: object, length: object) -> Member:
    if min(_typed(int, offset), _typed(int, length)) < 0:
        raise ValueError("before the file's begin")
    return _typed(str, pack), _typed(int, offset), _typed(int, length)


def _mark(size: object, changed: object) -> Mark:
    return _typed(int, size), _typed(int, changed)


def _cells(value: object) -> dict[str, Any]:
    cells: dict[str, Any] = _typed(dict, value)
    if not all(isinstance(cell, str | int | float | None) for cell in cells.values()):
        raise TypeError("a cell is no text, number or nothing")
    return cells
