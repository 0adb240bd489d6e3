"""The worker process: reads tasks from one pipe, writes replies to another, and touches no output."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1


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


def _limit_memory(more: int) -> None:
    """Let this process grow by so many bytes at most; 0 for no limit, which other systems than Linux do not keep."""
    if more and sys.platform == "linux":
        import resource
        from pathlib import Path

        size = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        soft = size + more
        resource.setrlimit(resource.RLIMIT_AS, (soft if hard < 0 else min(soft, hard), hard))
