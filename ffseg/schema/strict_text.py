"""Bounded reading of small text files, with errors by file and line."""

from __future__ import annotations

import os
import stat

from ffseg.schema.nodes import Problems

MAX_BYTES = 1_000_000


def read_text(path: str | os.PathLike[str], problems: Problems, max_bytes: int = MAX_BYTES) -> str:
    """Read at most so many bytes of UTF-8 from a regular file without waiting on pipes or devices; empty after a problem."""
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0))
        try:
            regular = stat.S_ISREG(os.fstat(handle).st_mode)
            data = os.fdopen(handle, "rb", closefd=False).read(max_bytes + 1) if regular else None
        finally:
            os.close(handle)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a usable file name"
        problems.add(os.fspath(path), f"cannot be read ({reason}); check the path")
        return ""
    if data is None:
        problems.add(os.fspath(path), "not a regular file; give a text file")
        return ""
    return _decode(os.fspath(path), data, problems, max_bytes)


def _decode(path: str, data: bytes, problems: Problems, max_bytes: int) -> str:
    if len(data) > max_bytes:
        problems.add(path, f"larger than {max_bytes} bytes, the most that is read; give a smaller file")
        return ""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        problems.add(f"{path}:{line}", "not UTF-8 text; save the file as UTF-8")
        return ""
