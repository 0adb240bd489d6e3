"""Standard streams that may fail: only what cannot be printed is lost."""

from __future__ import annotations

import errno
import io
import os
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_STANDARD = (0, 1, 2)


class Tolerant(io.FileIO):
    """A file descriptor that swallows what cannot be written, such as into a pipe nobody reads or onto a full disk.

    Attributes
    ----------
    failure : OSError or None
        Why it was lost, other than by a reader that has gone, who knows.
    """

    def __init__(self, descriptor: int) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self.failure: OSError | None = None

    def write(self, data: ReadableBuffer) -> int:
        """Write, or say that it is written."""
        size = memoryview(data).nbytes
        try:
            return super().write(data)
        except OSError as error:
            if error.errno != errno.EPIPE:
                self.failure = error
            return size


def harden() -> None:
    """Give the program standard streams that cannot end it.

    A stream that was closed when the program began becomes ``/dev/null``: otherwise the next file that is opened would
    take its number, and what is printed would go into that file. For stdout it is opened to be read only, so that data
    which is lost there counts as lost.
    """
    for descriptor in _STANDARD:
        try:
            os.fstat(descriptor)
        except OSError:
            flags = os.O_RDONLY if descriptor == 1 else os.O_RDWR
            os.set_inheritable(os.open(os.devnull, flags), True)  # takes the lowest free number: this one
    sys.stdin = sys.stdin or io.TextIOWrapper(io.FileIO(0, closefd=False))
    sys.stdout, sys.stderr = _tolerant(1, sys.stdout), _tolerant(2, sys.stderr)


def lost_output() -> str:
    """Why stdout could not be written, or empty."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        return ""
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    failure = raw.failure if isinstance(raw, Tolerant) else None
    return "" if failure is None else os.strerror(failure.errno or 0)


def _tolerant(descriptor: int, stream: TextIO | None) -> TextIO:
    """The stream over a descriptor that swallows errors, with the encoding of the one there was."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    errors = "backslashreplace" if descriptor == _STANDARD[-1] else getattr(stream, "errors", None) or "strict"
    buffer = io.BufferedWriter(Tolerant(descriptor))
    return io.TextIOWrapper(buffer, encoding=encoding, errors=errors, line_buffering=True)
