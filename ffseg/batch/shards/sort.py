"""Sorting more lines than memory holds: sorted runs in temporary files, merged as they are read."""

from __future__ import annotations

import heapq
import os
import struct
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from typing import BinaryIO

Keyed = tuple[bytes, bytes]
"""Key and line."""

_HEAD = struct.Struct("<II")
_OPEN_AT_ONCE = 64
"""Runs merged at once: each is an open file."""


def sorted_lines(lines: Iterable[Keyed], folder: str, most_bytes: int = 64 << 20) -> Iterator[Keyed]:
    """Lines in the order of their keys; equal keys stay in the order they came in.

    Parameters
    ----------
    lines : iterable of (bytes, bytes)
    folder : str
        Where the temporary files are, which have no names.
    most_bytes : int
        Of keys and lines that are held in memory.
    """
    with ExitStack() as stack:
        runs: list[BinaryIO] = []
        chunk: list[Keyed] = []
        size = 0
        for key, line in lines:
            chunk.append((key, line))
            size += len(key) + len(line) + _OVERHEAD
            if size >= most_bytes:
                runs.append(_stored(sorted(chunk, key=_key), folder, stack))
                chunk, size = [], 0
                if len(runs) == _OPEN_AT_ONCE:
                    runs = [_merged(runs, folder, stack)]
        chunk.sort(key=_key)
        yield from heapq.merge(*map(_read, runs), chunk, key=_key)


_OVERHEAD = 200
"""Bytes Python needs to hold a line beside the line."""


def _key(line: Keyed) -> bytes:
    return line[0]


def _merged(runs: list[BinaryIO], folder: str, stack: ExitStack) -> BinaryIO:
    """One run of several, which are closed."""
    whole = _stored(heapq.merge(*map(_read, runs), key=_key), folder, stack)
    for run in runs:
        run.close()
    return whole


def _stored(lines: Iterable[Keyed], folder: str, stack: ExitStack) -> BinaryIO:
    file = stack.enter_context(tempfile.TemporaryFile(dir=folder))  # noqa: SIM115 - closed with the others
    for key, line in lines:
        file.write(_HEAD.pack(len(key), len(line)) + key + line)
    file.seek(0, os.SEEK_SET)
    return file


def _read(file: BinaryIO) -> Iterator[Keyed]:
    while head := file.read(_HEAD.size):
        key, line = _HEAD.unpack(head)
        yield file.read(key), file.read(line)
