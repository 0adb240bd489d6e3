"""Child processes: timers of a command's time and peak memory, and the programs of this room that are measured so.

``python -m ffseg.bench.children PROGRAM ARGUMENT...`` runs one of `PROGRAMS`.
"""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

import numpy as np

from ffseg.bench.measure import Sample, Timer
from ffseg.errors import FfsegError

KILOBYTE = 1 if sys.platform == "darwin" else 1024
"""Bytes in the unit the system counts peak memory in."""
TAIL = 300
"""Characters of a failed command's last words that are shown."""
PARTS = 2
LONG = 1_000_000
"""Iterations: a large image takes as many as it needs."""
HERE = ("-m", "ffseg.bench.children")
RUN = ("-m", "ffseg", "run")

Command = Callable[[], Sequence[str]]


def run_child(command: Sequence[str]) -> Sample:
    """Milliseconds of a command of this Python and of all its children; modules are compiled once and kept.

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
    return wall * 1e3, (used.ru_utime + used.ru_stime) * 1e3


def timed_child(command: Command, per: float = 1.0) -> Timer:
    """A timer of a command that is made anew for every sample, in milliseconds divided by `per`."""

    def sample() -> Sample:
        wall, processor = run_child(command())
        return wall / per, processor / per

    return sample


_WATCH = (
    "import resource, subprocess, sys; code = subprocess.call([sys.executable, *sys.argv[1:]]); "
    "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss); sys.exit(code)"
)
"""A process that the system counts begins with the size of the one that starts it: this one, which is small."""


def measured_child(command: Command) -> Timer:
    """Peak memory of a command in megabytes: the largest of its processes."""
    return lambda: _told(("-I", "-S", "-c", _WATCH, *command()), lambda text: int(text.split()[-1]) * KILOBYTE / 1e6)


def peak_above(path: Path, radius: float, size: int) -> Timer:
    """Peak bytes a pixel of one segmentation above the decoded image, with the program ``peak``."""
    return lambda: _told((*HERE, "peak", str(path), str(radius)), lambda text: int(text) / size)


def _told(command: Sequence[str], read: Callable[[str], float]) -> Sample:
    done = subprocess.run([sys.executable, *command], check=True, capture_output=True, text=True)  # noqa: S603 - our own
    return read(done.stdout), read(done.stdout)


def fresh_folders(work: Path) -> Callable[[], str]:
    """Names of folders that do not exist yet. The others stay.

    ext4 will not use the inode of a file that was removed in the last minutes and looks for another, 0.3 ms a file.
    """
    count = itertools.count(1)
    return lambda: str(work / f"out-{next(count)}")


def bare(images: str, masks: str, out: str) -> None:
    """A plain loop: read every image of a folder, make its edge map, write one of the masks of an ``.npy`` file."""
    from ffseg.image.edges import edge_map
    from ffseg.image.reference import one_thread
    from ffseg.io.images import read_image
    from ffseg.io.masks import encode_mask
    from ffseg.parameters import Parameters

    ready, edges, folder = np.load(masks), Parameters().edges, Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    with one_thread():
        for index, path in enumerate(sorted(Path(images).iterdir())):
            edge_map(read_image(path), edges)
            (folder / f"{path.stem}.png").write_bytes(encode_mask(ready[index % len(ready)]))


def shards(images: str, out: str) -> None:
    """Run two shards with a worker each at the same time."""
    parts = [("--shard", f"{number}/{PARTS}", "--jobs", "1", "--quiet", "--out", out) for number in range(1, PARTS + 1)]
    runs = [subprocess.Popen([sys.executable, *RUN, images, *part]) for part in parts]  # noqa: S603 - our own command
    sys.exit(max(run.wait() for run in runs))


def peak(image_file: str, radius: str) -> None:
    """Segment an image of an ``.npy`` file and write how many bytes the peak lies above what there was before."""
    from ffseg.bench.drawing import draw
    from ffseg.image.reference import one_thread
    from ffseg.parameters import load_params
    from ffseg.pipeline import segment
    from ffseg.scene import Scene

    with one_thread():
        segment(
            Scene(draw(1, 160, 120).image, load_params(None, {"init.radius": 8.0}))
        )  # what is loaded once does not count
        image = np.load(image_file)
        try:
            Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # the peak begins anew
            before = _memory("VmRSS")
        except OSError:
            before = _memory("VmHWM")
        segment(Scene(image, load_params(None, {"init.radius": float(radius), "contour.max_iterations": LONG})))
        sys.stdout.write(str(_memory("VmHWM") - before))


def _memory(name: str) -> int:
    """Bytes the system counts for this process; where there is no ``/proc``, the most so far, with those of its parent."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * KILOBYTE
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{name}:")) * 1024


PROGRAMS: dict[str, Callable[..., None]] = {"bare": bare, "shards": shards, "peak": peak}

if __name__ == "__main__":
    PROGRAMS[sys.argv[1]](*sys.argv[2:])
