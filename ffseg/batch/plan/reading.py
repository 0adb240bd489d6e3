"""Reading an input from a file, a member of a tar file, a frame of a film or bag, or a URL."""

from __future__ import annotations

import os
import re

from ffseg.batch.plan.remote import is_remote, read_remote
from ffseg.errors import ImageReadError
from ffseg.io.bags import MARK, bag_image, in_bag
from ffseg.io.files import AT_ONCE, read_at, read_bytes
from ffseg.io.films import ANIMATIONS, FILMS, frame_bytes

Span = tuple[int, int]
"""Offset and length of a member inside an archive; number of a frame in a film, and 1."""

_MEMBER = re.compile(r"(.+)#([0-9]+)\+([0-9]+)", re.DOTALL)
_ARCHIVE = re.compile(rf"({'|'.join(map(re.escape, ('.tar', *FILMS, *ANIMATIONS)))})/", re.IGNORECASE)


def member_path(archive: str, name: str, span: Span) -> str:
    """One text for a member of a tar file, ``photos.tar/a.png#1536+2048``, or a frame, that is read like a file's path."""
    return f"{archive}/{name}#{span[0]}+{span[1]}"


def split_member_path(path: str) -> tuple[str, str, Span | None]:
    """File that a path leads to, and name and span of the member it stands for; the name is empty for a whole file."""
    found = _MEMBER.fullmatch(path)
    if found is None:
        return path, "", None
    if MARK in found[1]:
        topic, _, name = found[1].rpartition("/")
        return topic, name, (int(found[2]), int(found[3]))
    for place in _ARCHIVE.finditer(found[1]):
        file = path[: place.end() - 1]
        if os.path.isfile(file):  # a folder may have such a name, and a member
            return file, path[place.end() : found.end(1)], (int(found[2]), int(found[3]))
    return path, "", None


def display_path(path: str) -> str:
    """A path as people know it."""
    file, name, _ = split_member_path(path)
    return f"{file}/{name}" if name else file


def read_input(path: str, max_bytes: int, span: Span | None = None, *, redirects: bool = False) -> bytes:
    """Content of an input; without a span that of a file, or of the member that the path stands for."""
    if is_remote(path):
        return read_remote(path, max_bytes, redirects=redirects)
    if span is None:
        path, _, span = split_member_path(path)
    if span is None:
        return read_bytes(path, max_bytes)
    if in_bag(path):
        return bag_image(path, span[0], max_bytes)
    return _part(path, span, max_bytes) if path.lower().endswith(".tar") else frame_bytes(path, span[0], max_bytes)


def _part(path: str, span: Span, max_bytes: int) -> bytes:
    offset, length = span
    if not length:
        raise ImageReadError("empty", "the member is empty; pack it again")
    if length > max_bytes:
        raise ImageReadError("too-many-bytes", f"the member has {length} bytes, the limit is {max_bytes}")
    try:
        with os.fdopen(os.open(path, os.O_RDONLY | AT_ONCE), "rb", buffering=0) as file:
            data = read_at(file.fileno(), length, offset)
    except OSError as error:
        raise ImageReadError("unreadable", f"the archive cannot be read ({os.strerror(error.errno or 0)})") from error
    if len(data) < length:
        raise ImageReadError("truncated", "the archive ends before the member does; copy it again")
    return data


def place_of(path: str) -> str:
    """Where an input is, independent of the working folder."""
    return path if "://" in path else os.path.abspath(path)
