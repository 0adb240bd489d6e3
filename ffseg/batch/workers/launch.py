"""Start of a worker process; this module loads little, so that the process can start before anything else is loaded."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass

_START = "import sys; sys.path[:] = {path!r}; from ffseg.batch.workers.process import main; main({tasks}, {replies}, {parent})"


@dataclass(eq=False, slots=True)
class Process:
    """A worker process and the pipes to it.

    Attributes
    ----------
    handle : subprocess.Popen
    tasks, replies, log : int
        File descriptors: tasks are written, replies read; the log is what the process wrote to stdout and stderr.
    """

    handle: subprocess.Popen[bytes]
    tasks: int
    replies: int
    log: int

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
    """Start a process that loads OpenCV and the core and waits for its setup."""
    task_out, task_in = os.pipe()
    reply_out, reply_in = os.pipe()
    log = _anonymous_file()
    # The same modules as here, wherever they come from, and nothing from the working directory that is not one of them.
    code = _START.format(path=sys.path, tasks=task_out, replies=reply_in, parent=os.getpid())
    try:
        handle = subprocess.Popen(  # noqa: S603 - our own interpreter with our own code
            [sys.executable, "-P", "-c", code],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            pass_fds=(task_out, reply_in),
        )
    finally:
        os.close(task_out)
        os.close(reply_in)
    return Process(handle, task_in, reply_out, log)


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


_early: list[Process] = []


def launch_early() -> None:
    """Start a process now that the next `take` hands out; the command line calls this before it loads itself."""
    _early.append(launch())


def take() -> Process:
    """Process that was started early, or a new one."""
    return _early.pop() if _early else launch()
