"""Files of any length written piece by piece, whole or absent like those of `ffseg.io.files`."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator
from typing import BinaryIO

from ffseg.io.files import replacement

_BUFFER = 1 << 20


@contextlib.contextmanager
def atomic_stream(path: str) -> Iterator[BinaryIO]:
    """Open a file for writing that gets its name when the block ends, and leaves nothing when the block fails.

    Raises
    ------
    OutputError
        Naming the path and the system's reason, when something cannot be written.
    """
    with replacement(path) as temporary, open(temporary, "xb", buffering=_BUFFER) as file:  # noqa: PTH123 - like its sibling
        yield file
        file.flush()
        os.fsync(file.fileno())


def write_stream(path: str, pieces: Iterable[bytes]) -> None:
    """Write pieces to a file, whole or not at all; as `atomic_stream`."""
    with atomic_stream(path) as file:
        for piece in pieces:
            file.write(piece)
