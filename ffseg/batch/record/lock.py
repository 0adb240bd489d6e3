"""One run at a time in an output folder: a lock that is released with the process that holds it."""

from __future__ import annotations

import errno
import os
import sys

from ffseg.batch.plan.sources import STATE_FOLDER
from ffseg.batch.record.journal import refuse_special
from ffseg.errors import OutputError, UsageError
from ffseg.io.files import OWN, make_folder, printable, unwritten

if sys.platform == "win32":
    from msvcrt import LK_NBLCK, locking

    def take(descriptor: int) -> None:
        """Lock an open file, or raise an ``OSError``: ``EACCES`` or ``EAGAIN`` if another process has."""
        locking(descriptor, LK_NBLCK, 1)
else:
    from fcntl import LOCK_EX, LOCK_NB, lockf

    def take(descriptor: int) -> None:
        """Lock an open file, or raise an ``OSError``: ``EACCES`` or ``EAGAIN`` if another process has."""
        lockf(descriptor, LOCK_EX | LOCK_NB)


class OutputLock:
    """Context manager that holds the lock of an output folder, or of one of the state folders in it.

    A record lock of the operating system: it is gone when the process is, however it ended, and child processes do not
    inherit it. The file that carries it stays behind and means nothing by itself.

    Raises
    ------
    UsageError
        If another process holds it, or this one already does.
    OutputError
        If the lock file cannot be made.
    """

    def __init__(self, out: str, folder: str = "") -> None:
        self._out, self._folder = out, folder or os.path.join(out, STATE_FOLDER)
        self._descriptor = -1

    def __enter__(self) -> OutputLock:
        make_folder(self._folder)
        self._descriptor = _locked(self._out, os.path.join(self._folder, "lock"))
        _held.add(_identity(os.fstat(self._descriptor)))
        return self

    def __exit__(self, *_: object) -> None:
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            _held.discard(_identity(os.fstat(descriptor)))
            os.close(descriptor)  # gives the lock up as well


_held: set[tuple[int, int, int]] = set()
"""Locks of this process, which the operating system keeps from others only; closing any descriptor of one gives it up."""


def _identity(file: os.stat_result) -> tuple[int, int, int]:
    return os.getpid(), file.st_dev, file.st_ino


def refuse_locked(out: str, folder: str) -> None:
    """Refuse, without making anything, what `OutputLock` of these would refuse."""
    path = os.path.join(folder, "lock")
    if os.path.lexists(path):
        os.close(_locked(out, path))


def _locked(out: str, path: str) -> int:
    refuse_special(path)
    busy = f"another ffseg run is writing to {printable(out)}; wait for it or choose another folder"
    try:
        if os.path.exists(path) and _identity(os.stat(path)) in _held:
            raise UsageError(busy)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | OWN, 0o666)
    except OSError as error:
        raise unwritten(path, error) from error
    try:
        take(descriptor)
    except OSError as error:
        os.close(descriptor)
        if error.errno in (errno.EACCES, errno.EAGAIN):
            raise UsageError(busy) from error
        raise OutputError(f"{printable(path)} cannot be locked ({os.strerror(error.errno or 0)})") from error
    return descriptor
