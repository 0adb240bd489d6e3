"""Images named one by one in a file."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from ffseg.batch.plan.remote import is_remote
from ffseg.batch.plan.sources import Source
from ffseg.errors import UsageError
from ffseg.io.files import printable

_MOST_BYTES = 1 << 32


def listed(path: str, *, nul: bool = False) -> list[Source]:
    """Sources of a list.

    Parameters
    ----------
    path : str
        File with one path a line; ``-`` for stdin.
    nul : bool
        Paths end with a NUL instead of a line end, as ``find -print0`` writes them.

    Returns
    -------
    list of Source
        In the order of the list. Paths that lead nowhere above the working folder keep their names; else all names are
        relative to the folder that all paths have in common.

    Raises
    ------
    UsageError
        If the list cannot be read, or names nothing.
    """
    end = b"\0" if nul else b"\n"
    paths = [os.fsdecode(line) for line in _content(path).split(end) if line.strip()]
    if any("\0" in one for one in paths):
        raise UsageError(
            f"--list: {printable(path)} holds NUL bytes, which no path does; add -0 if its paths end with them"
        )
    paths = [text if nul else text.rstrip("\r") for text in paths]
    if not paths:
        raise UsageError(f"--list: {printable(path)} names no image; write one path a line")
    names = _names(paths)
    sources = (Source(one, name, place=place) for place, (one, name) in enumerate(zip(paths, names, strict=True)))
    return list({(source.path, source.name): source for source in sources}.values())


def _content(path: str) -> bytes:
    try:
        if path == "-":
            return sys.stdin.buffer.read(_MOST_BYTES)
        with Path(path).open("rb") as file:
            return file.read(_MOST_BYTES)
    except OSError as error:
        reason = os.strerror(error.errno or 0)
        raise UsageError(f"--list: {printable(path)} cannot be read ({reason}); check the name") from error


def _names(paths: list[str]) -> list[str]:
    plain = [path.partition("://")[2] if is_remote(path) else os.path.normpath(path) for path in paths]
    if not any(os.path.isabs(path) or path.split("/")[0] == ".." for path in plain):
        return plain
    whole = [path if is_remote(text) else os.path.abspath(text) for path, text in zip(plain, paths, strict=True)]
    base = os.path.commonpath({os.path.dirname(path) or "." for path in whole})
    return [os.path.relpath(path, base).replace(os.sep, "/") for path in whole]
