"""Reading an input wherever it is: a file, a part of one, or a URL."""

from __future__ import annotations

import os

from ffseg.errors import ImageReadError
from ffseg.formats.files import read_bytes

Span = tuple[int, int]
"""Offset and length of a member inside an archive."""


def read_input(path: str, max_bytes: int, span: Span | None = None) -> bytes:
    """Content of an input.

    Raises
    ------
    ImageReadError
        As `read_bytes`.
    """
    if "://" in path:
        from ffseg.batch.inputs.remote import is_remote, read_remote

        if is_remote(path):
            return read_remote(path, max_bytes)
    return read_bytes(path, max_bytes) if span is None else _part(path, span, max_bytes)


def _part(path: str, span: Span, max_bytes: int) -> bytes:
    offset, length = span
    if not length:
        raise ImageReadError("empty", "the member is empty; pack it again")
    if length > max_bytes:
        raise ImageReadError("too-many-bytes", f"the member has {length} bytes, the limit is {max_bytes}")
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
    except OSError as error:
        raise ImageReadError("unreadable", f"the archive cannot be read ({os.strerror(error.errno or 0)})") from error
    try:
        data = os.pread(descriptor, length, offset)
    except OSError as error:
        raise ImageReadError("unreadable", f"the archive cannot be read ({os.strerror(error.errno or 0)})") from error
    finally:
        os.close(descriptor)
    if len(data) < length:
        raise ImageReadError("truncated", "the archive ends before the member does; copy it again")
    return data


def place_of(path: str) -> str:
    """Where an input is, independent of the working folder."""
    return path if "://" in path else os.path.abspath(path)
