"""The process that works on images: reads tasks from one pipe, writes replies to another, touches no output."""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys

from ffseg.batch.workers.messages import Ready, Refused, Setup, receive, send
from ffseg.errors import FfsegError

_PR_SET_PDEATHSIG = 1


def main(tasks: int, replies: int) -> None:
    """Serve until the pipe of tasks ends.

    Parameters
    ----------
    tasks, replies : int
        File descriptors.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to the whole group; the run ends its workers itself
    _die_with_parent()
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    from ffseg.batch.workers.work import Workbench

    setup = receive(tasks)
    if setup is None:
        return
    try:
        bench = Workbench(setup)
    except FfsegError as error:
        send(replies, Refused(str(error)))
        return
    send(replies, Ready(bench.versions()))
    _limit_memory(setup)
    while (task := receive(tasks)) is not None:
        send(replies, bench.reply(task))


def _die_with_parent() -> None:
    """Ask Linux to kill this process when the run is killed; elsewhere it ends with its current image."""
    if sys.platform == "linux":
        parent = os.getppid()
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it died in between
            os._exit(1)


def _limit_memory(setup: Setup) -> None:
    if setup.memory_bytes and sys.platform == "linux":
        with open("/proc/self/statm", encoding="ascii") as file:  # noqa: PTH123 - not a path of the user's
            size = int(file.read().split()[0]) * resource.getpagesize()
        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        soft = size + setup.memory_bytes
        resource.setrlimit(resource.RLIMIT_AS, (soft if hard < 0 else min(soft, hard), hard))
