"""Child processes: wall time, processor time and peak memory of a command."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from ffseg.bench.measure import Sample, Timer
from ffseg.errors import FfsegError

KILOBYTE = 1 if sys.platform == "darwin" else 1024
"""Bytes in the unit the system counts peak memory in."""
TAIL = 300
"""Characters of a failed command's last words that are shown."""


@dataclass(frozen=True, slots=True)
class Ended:
    """A child that ended well.

    Attributes
    ----------
    wall_ms : float
    processor_ms : float
        Of the child and all its own children.
    """

    wall_ms: float
    processor_ms: float


def run_child(command: Sequence[str]) -> Ended:
    """Run a command of this Python to its end; modules are compiled once and kept, as an installation has them.

    Raises
    ------
    FfsegError
        If it ends with another exit code than 0; with its last words.
    """
    begin = perf_counter()
    with subprocess.Popen(  # noqa: S603 - this Python with arguments made here
        [sys.executable, *command],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"},
    ) as child:
        words = child.stderr.read() if child.stderr else b""
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    wall = perf_counter() - begin
    if child.returncode != 0:
        last = words.decode("utf-8", "backslashreplace").strip()[-TAIL:]
        raise FfsegError(f"python {' '.join(command)} ended with exit code {child.returncode}: {last}")
    return Ended(wall * 1e3, (used.ru_utime + used.ru_stime) * 1e3)


def timed_child(command: Callable[[], Sequence[str]], per: float = 1.0) -> Timer:
    """A timer of a command that is made anew for every sample, in milliseconds divided by `per`."""

    def sample() -> Sample:
        ended = run_child(command())
        return Sample(ended.wall_ms / per, ended.processor_ms / per)

    return sample


_WATCH = (
    "import resource, subprocess, sys; code = subprocess.call([sys.executable, *sys.argv[1:]]); "
    "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss); sys.exit(code)"
)
"""A process that the system counts begins with the size of the one that starts it: this one, which is small."""


def measured_child(command: Callable[[], Sequence[str]]) -> Timer:
    """Peak memory of a command in megabytes: the largest of its processes."""

    def sample() -> Sample:
        done = subprocess.run(  # noqa: S603 - this Python with arguments made here
            [sys.executable, "-I", "-S", "-c", _WATCH, *command()], check=True, capture_output=True
        )
        peak = int(done.stdout.split()[-1]) * KILOBYTE / 1e6
        return Sample(peak, peak)

    return sample


class FreshFolders:
    """Names of folders that do not exist yet.

    Parameters
    ----------
    work : Path
    keep : bool
        Leave what was written into the one before. Otherwise it is removed, and the next files take longer: ext4 will not
        use the inode of a file that was removed in the last minutes and looks for another, 0.3 ms a file.
    """

    def __init__(self, work: Path, *, keep: bool = False) -> None:
        self._work, self._count, self._keep = work, 0, keep

    def __call__(self) -> Path:
        """Name of the next folder."""
        import shutil

        if not self._keep:
            shutil.rmtree(self._work / f"out-{self._count}", ignore_errors=True)
        self._count += 1
        return self._work / f"out-{self._count}"
