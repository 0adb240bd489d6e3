"""The last line of each image, in the order of the tables, of more lines than memory holds: an index in a file."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing, suppress

from ffseg.errors import OutputError
from ffseg.io.files import printable, temporary_path

_MEMORY_KB = 65_536
"""Of the index that is held in memory."""


def last_lines(lines: Iterable[tuple[bytes, int, bytes]], folder: str) -> Iterator[tuple[bytes, bytes]]:
    """Of each key the last line of rank 0 and the last of rank 1, empty where there is none, in the order of the keys.

    Parameters
    ----------
    lines : iterable of (key, rank, line)
    folder : str
        Where the index is as long as it is needed.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    path = temporary_path(os.path.join(folder, "lines"))
    try:
        with closing(sqlite3.connect(path, isolation_level=None)) as store:
            for what in ("journal_mode=OFF", "synchronous=OFF", f"cache_size=-{_MEMORY_KB}"):  # nobody resumes it
                store.execute(f"PRAGMA {what}")
            store.execute("CREATE TABLE lines (key BLOB, rank INT, line BLOB, PRIMARY KEY (key, rank))")
            store.execute("BEGIN")
            store.executemany("INSERT OR REPLACE INTO lines VALUES (?, ?, ?)", lines)
            pair = ", ".join(f"coalesce(max(CASE rank WHEN {rank} THEN line END), x'')" for rank in (0, 1))
            yield from store.execute(f"SELECT {pair} FROM lines GROUP BY key ORDER BY key")  # noqa: S608 - numbers only
    except sqlite3.Error as error:
        raise OutputError(f"{printable(folder)} cannot be written ({error}); free some space") from error
    finally:
        with suppress(OSError):
            os.unlink(path)
