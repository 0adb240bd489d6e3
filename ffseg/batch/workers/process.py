"""The worker process: reads tasks from one pipe, writes replies to another, and touches no output."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_KEPT_BYTES, _MAX_KEPT_BLOCK = 128 << 20, 32 << 20
"""Freed memory that stays with the process, and the largest block that is kept so, which is the largest the library
allows: the buffers of an image of 8 Mpx. Returned to the system after every image, they cost 440 page faults for the
next one of 800x600, a tenth of its time. More than the largest image needed at once is never held."""


def main(tasks: int, replies: int, parent: int) -> None:
    """Serve until the pipe of tasks ends.

    Parameters
    ----------
    tasks, replies : int
        File descriptors.
    parent : int
        Process that this one must not outlive.
    """
    for name in ("SIGINT", "SIGHUP"):  # they go to the whole group of a terminal; the run ends its workers itself
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    _die_with(parent)
    _keep_memory()
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its threads would be started and never used
    from ffseg.batch.workers.messages import Ready, Refused, received_messages, send
    from ffseg.batch.workers.work import Workbench
    from ffseg.errors import FfsegError

    messages = received_messages(tasks)
    setup = next(messages, None)
    if setup is None:
        return
    try:
        bench = Workbench(setup)
    except FfsegError as error:
        send(replies, Refused(str(error)))
        return
    send(replies, Ready(bench.versions()))
    _limit_memory(setup.memory_bytes)
    for task in messages:
        send(replies, bench.reply(task))


def _die_with(parent: int) -> None:
    """Ask Linux to kill this process when the run is killed; elsewhere it ends with its current image."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it died before this one could ask
        os._exit(1)


def _keep_memory() -> None:
    """Let the C library keep what one image has freed for the next, where it can be told so."""
    tell = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if tell is not None:
        tell(_M_TRIM_THRESHOLD, _KEPT_BYTES)
        tell(_M_MMAP_THRESHOLD, _MAX_KEPT_BLOCK)


def _limit_memory(more: int) -> None:
    """Let this process grow by so many bytes at most; 0 for no limit, which other systems than Linux do not keep."""
    if more and sys.platform == "linux":
        import resource
        from pathlib import Path

        size = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        soft = size + more
        resource.setrlimit(resource.RLIMIT_AS, (soft if hard < 0 else min(soft, hard), hard))
