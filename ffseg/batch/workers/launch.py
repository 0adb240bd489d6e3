"""Start of a worker process; imports little, so that the process can start before anything else is imported."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import subprocess

_START = "import sys; sys.path[:] = {path!r}; from ffseg.batch.workers.process import main; main({tasks}, {replies}, {parent})"

_FIRST_OWN = 3
"""File descriptors below are stdin, stdout and stderr."""


@dataclass(eq=False, slots=True)
class Forked:
    """A copy of this process that became a worker, with as much of `subprocess.Popen` as is asked of it."""

    pid: int
    code: int | None = None

    def kill(self) -> None:
        """End it at once; nothing happens when it has been waited for."""
        if self.code is None:
            os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> int:
        """Its exit code, negative for a signal, once it has ended."""
        if self.code is None:
            self.code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return self.code


@dataclass(eq=False, slots=True)
class Process:
    """A worker process and the pipes to it."""

    handle: Forked | subprocess.Popen[bytes]
    tasks: int
    replies: int
    log: int
    """File descriptors: tasks are written, replies read; the log is what the process wrote to stdout and stderr."""

    def end(self) -> None:
        """Kill the process, which holds nothing that would have to be put away, and close its pipes."""
        if self.tasks < 0:
            return
        self.handle.kill()
        self.handle.wait()
        for descriptor in (self.tasks, self.replies, self.log):
            os.close(descriptor)
        self.tasks = -1


def launch() -> Process:
    """Start a process that loads OpenCV and the core and waits for its setup.

    Raises
    ------
    OSError
        When the system has no more descriptors or processes to give; nothing is left open.
    """
    with contextlib.ExitStack() as theirs, contextlib.ExitStack() as ours:
        task_out, task_in = _pipe(theirs, ours)
        reply_out, reply_in = _pipe(ours, theirs)
        log = _anonymous_file()
        ours.callback(os.close, log)
        standard = min(task_out, reply_in, log) < _FIRST_OWN  # this process was started without one of its streams
        start = _fork if can_fork() and not standard else _spawn
        handle = start(task_out, reply_in, log)
        ours.pop_all()  # the process is there: they stay open
    return Process(handle, task_in, reply_out, log)


def _pipe(reader: contextlib.ExitStack, writer: contextlib.ExitStack) -> tuple[int, int]:
    """A pipe whose ends are closed with two stacks."""
    read, write = os.pipe()
    reader.callback(os.close, read)
    writer.callback(os.close, write)
    return read, write


def can_fork() -> bool:
    """Whether a copy of this process can be a worker: on Linux, while it has one thread and neither NumPy nor OpenCV.

    The copy has Python and the parameters loaded, a third of what a worker needs. Locks that other threads hold, and the
    thread pools of OpenCV and of a linear algebra library, would not survive the copying.
    """
    if sys.platform != "linux" or "numpy" in sys.modules or "cv2" in sys.modules:
        return False
    try:
        return len(os.listdir("/proc/self/task")) == 1
    except OSError:
        return False


def _spawn(tasks: int, replies: int, log: int) -> Forked | subprocess.Popen[bytes]:
    import subprocess

    # The same modules as here, wherever they come from, and nothing from the working directory that is not one of them.
    code = _START.format(path=sys.path, tasks=tasks, replies=replies, parent=os.getpid())
    return subprocess.Popen(  # noqa: S603 - our own interpreter with our own code
        [sys.executable, "-P", "-c", code],
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=log,
        pass_fds=(tasks, replies),
    )


def _fork(tasks: int, replies: int, log: int) -> Forked:
    # What both need: loaded here, the copy has it too.
    import datetime  # noqa: F401
    import hashlib  # noqa: F401

    import ffseg.batch.workers.messages
    import ffseg.batch.workers.process
    import ffseg.io.files  # noqa: F401

    parent = os.getpid()
    pid = os.fork()
    if pid == 0:
        _become_worker(tasks, replies, log, parent)
    return Forked(pid)


def _become_worker(tasks: int, replies: int, log: int, parent: int) -> None:
    """Be what a new process would be: default signals, own streams, no file of the parent's but the pipes; never returns."""
    code = 1
    try:
        for name in ("SIGINT", "SIGHUP"):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        nothing = os.open(os.devnull, os.O_RDONLY)
        for stream, source in enumerate((nothing, log, log)):
            os.dup2(source, stream)
        for descriptor in map(int, os.listdir("/proc/self/fd")):  # not all there could be: that may be 10^9
            if descriptor >= _FIRST_OWN and descriptor not in (tasks, replies):
                with contextlib.suppress(OSError):  # the one the list was read from
                    os.close(descriptor)
        from ffseg.batch.workers.process import main

        main(tasks, replies, parent)
        code = 0
    except BaseException:  # noqa: BLE001 - as an interpreter ends: the traceback is in the log
        import traceback

        os.write(2, traceback.format_exc().encode("utf-8", "backslashreplace"))
    finally:
        os._exit(code)


def _anonymous_file() -> int:
    """File without a name, always written at its end so that it can be emptied at any time."""
    import fcntl

    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("ffseg-worker")
    else:
        import tempfile

        descriptor, path = tempfile.mkstemp(prefix="ffseg-worker-")
        os.unlink(path)
    fcntl.fcntl(descriptor, fcntl.F_SETFL, fcntl.fcntl(descriptor, fcntl.F_GETFL) | os.O_APPEND)
    return descriptor


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


_early: list[Process] = []


def launch_early() -> None:
    """Start a process now that the next `take_process` hands out; the command line calls this before it loads itself."""
    _early.append(launch())


def take_process() -> Process:
    """Process that was started early, or a new one."""
    return _early.pop() if _early else launch()
