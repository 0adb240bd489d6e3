"""Suites of whole processes: ``startup``, ``batch``, ``memory`` and ``shards``."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter

import numpy as np

from ffseg.batch.workers.launch import cores
from ffseg.bench.drawing import draw
from ffseg.bench.images import QUICK_WIDTHS, WIDTHS
from ffseg.bench.measure import Sample, Schedule, Skipped, Task, TaskGroup, Timer
from ffseg.errors import FfsegError
from ffseg.io.masks import encode_png

NUM_IMAGES, QUICK_IMAGES = 500, 2
NUM_DISTINCT = 20
"""Drawn images of a batch; the others are the same files under other names."""
LENGTHS, QUICK_LENGTHS = (50, 150, 450), (2, 4)
"""Images of the batches whose memory is compared."""
NUM_SHARDED, QUICK_SHARDED = 4000, 4
"""So many that two Dask workers get chunks of 500, and that the two parts, drawn by name, differ by a hundredth."""
EMPTY_PROGRAM = "import typer\napp = typer.Typer()\n@app.command()\ndef main() -> None:\n    pass\napp()\n"
IMPORTS = "import typer, numpy, cv2, yaml"
FEW_ROUNDS = 3
"""Rounds for memory and batches: memory hardly varies, and a batch is many images already."""
_WATCH = (
    "import resource, subprocess, sys; code = subprocess.call([sys.executable, *sys.argv[1:]]); "
    "unit = 1 if sys.platform == 'darwin' else 1024; "
    "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * unit); sys.exit(code)"
)
"""A process that the system counts begins with the size of the one that starts it: this one, which is small."""
TAIL = 300
"""Characters of a failed command's last words that are shown."""
RUN, HERE = ("-m", "ffseg", "run"), ("-m", "ffseg.bench.programs")

Command = Callable[[], Sequence[str]]


def startup(order: Schedule, work: Path) -> Iterator[TaskGroup]:
    """Start of the command line beside an empty Typer program and the imports any such program has."""
    empty, image = work / "empty.py", work / "one" / "0000.png"
    empty.write_text(EMPTY_PROGRAM, encoding="utf-8")
    write_images(image.parent, 1, quick=order.quick)
    commands: dict[str, Command] = {
        "empty Typer program": lambda: (str(empty),),
        "--version": lambda: ("-m", "ffseg", "--version"),
        "--help": lambda: ("-m", "ffseg", "--help"),
        IMPORTS: lambda: ("-c", IMPORTS),
        "run, one image": _run(image, _fresh_folders(work)),
    }
    tasks = [Task(name, "start", timed_child(command)) for name, command in commands.items()]
    comparisons = [
        ("--version over the empty program", "--version", "empty Typer program"),
        ("--help over the empty program", "--help", "empty Typer program"),
        ("run of one image over the imports", "run, one image", IMPORTS),
    ]
    yield TaskGroup("startup", "commands", draw(1).image, tasks, {}, comparisons)


def batch(order: Schedule, work: Path) -> Iterator[TaskGroup]:
    """Milliseconds an image of ``ffseg run`` with durable writes, beside the bare pipeline."""
    images, folders = work / "images", _fresh_folders(work)
    count = QUICK_IMAGES if order.quick else NUM_IMAGES
    masks = write_images(images, count, quick=order.quick)
    tasks = [Task("bare", "image", timed_child(lambda: (*HERE, "bare", str(images), str(masks), next(folders)), count))]
    comparisons = [("rate of --jobs 1 in rates of the bare pipeline", "bare", "jobs, 1")]
    for jobs in (jobs for jobs in (1, 2, 4, 8) if jobs <= cores()):
        timer = timed_child(_run(images, folders, "--jobs", str(jobs)), count)
        tasks.append(Task(f"jobs, {jobs}", "image", timer, x=jobs))
        if jobs > 1:
            comparisons.append((f"rate of --jobs {jobs} in rates of --jobs 1", "jobs, 1", f"jobs, {jobs}"))
    yield TaskGroup(
        "batch", "images", draw(1).image, tasks, {"images": count, "cores": cores()}, comparisons, FEW_ROUNDS
    )


def memory(order: Schedule, work: Path) -> Iterator[TaskGroup | Skipped]:
    """Peak memory of a run of one image of growing size, and of batches of growing length."""
    if find_spec("resource") is None:
        yield Skipped("memory", "all", "this system does not count peak memory")
        return
    folders, sizes, batches = _fresh_folders(work), [], []
    for width in QUICK_WIDTHS[:2] if order.quick else WIDTHS:
        (work / f"{width}.png").write_bytes(encode_png(draw(1, width, width * 3 // 4).image, []))
        timer = peak_memory(_run(work / f"{width}.png", folders, "--jobs", "1", "--set", f"init.radius={width / 20}"))
        sizes.append(Task(f"image, {width}x{width * 3 // 4}", "peak", timer, width * width * 3 // 4, "MB"))
    for length in QUICK_LENGTHS if order.quick else LENGTHS:
        write_images(work / f"batch-{length}", length, quick=order.quick)
        timer = peak_memory(_run(work / f"batch-{length}", folders, "--jobs", "1"))
        batches.append(Task(f"batch, {length}", "peak", timer, length, "MB"))
    for name, tasks in (("one image", sizes), ("batches", batches)):
        title = f"memory of {tasks[-1].case} over {tasks[0].case}"
        yield TaskGroup("memory", name, draw(1).image, tasks, {}, [(title, tasks[-1].case, tasks[0].case)], FEW_ROUNDS)


def shards(order: Schedule, work: Path) -> Iterator[TaskGroup]:
    """Milliseconds an image of two workers, of two shards side by side and of two Dask workers."""
    images, folders = work / "images", _fresh_folders(work)
    count = QUICK_SHARDED if order.quick else NUM_SHARDED
    write_images(images, count, quick=order.quick)
    whole: dict[str, Command] = {
        "jobs, 2": _run(images, folders, "--jobs", "2"),
        "2 shards": lambda: (*HERE, "shards", str(images), next(folders)),
    }
    titles = {"2 shards": "rate of 2 shards side by side in rates of --jobs 2"}
    if find_spec("distributed") is not None:
        whole["dask, 2 workers"] = _run(images, folders, "--executor", "dask", "--chunk", "500", "--jobs", "2")
        titles["dask, 2 workers"] = "rate of Dask, its start included, in rates of --jobs 2"
    comparisons = [(title, "jobs, 2", case) for case, title in titles.items()]
    tasks = [Task(name, "image", timed_child(command, count)) for name, command in whole.items()]
    yield TaskGroup("shards", "images", draw(1).image, tasks, {"images": count}, comparisons, FEW_ROUNDS)


def write_images(folder: Path, count: int, *, quick: bool) -> Path:
    """Write `count` drawn images and the ``.npy`` file of their grounds, whose path is returned."""
    folder.mkdir()
    drawings = [draw(seed, *((160, 120) if quick else (800, 600))) for seed in range(min(count, NUM_DISTINCT))]
    for index in range(count):
        path = folder / f"{index:04d}.png"
        if index < len(drawings):
            path.write_bytes(encode_png(drawings[index].image, []))
        else:
            os.link(folder / f"{index % len(drawings):04d}.png", path)
    masks = folder.with_suffix(".npy")
    np.save(masks, np.stack([drawing.ground for drawing in drawings]))
    return masks


def _run(images: Path, folders: Iterator[str], *options: str) -> Command:
    return lambda: (*RUN, str(images), "--quiet", *options, "--out", next(folders))


def _fresh_folders(work: Path) -> Iterator[str]:
    """Names of folders that do not exist yet. The others stay: ext4 passes over inodes that were freed, 0.3 ms a file."""
    return (str(work / f"out-{number}") for number in itertools.count(1))


def run_child(command: Sequence[str]) -> tuple[Sample, str]:
    """Milliseconds of a command of this Python and of all its children, and its words; modules are compiled once and kept.

    Raises
    ------
    FfsegError
        If it ends with another exit code than 0; with its last words.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    begin = perf_counter()
    with subprocess.Popen([sys.executable, *command], env=environment, **streams) as child:  # type: ignore[call-overload]  # noqa: S603 - this Python
        words = child.stdout.read().decode("utf-8", "backslashreplace").strip()
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    wall = perf_counter() - begin
    if child.returncode != 0:
        raise FfsegError(f"python {' '.join(command)} ended with exit code {child.returncode}: {words[-TAIL:]}")
    return (wall * 1e3, (used.ru_utime + used.ru_stime) * 1e3), words


def timed_child(command: Command, per: float = 1.0) -> Timer:
    """A timer of a command that is made anew for every sample, in milliseconds divided by `per`."""

    def sample() -> Sample:
        wall, processor = run_child(command())[0]
        return wall / per, processor / per

    return sample


def peak_memory(command: Command) -> Timer:
    """Peak memory of a command in megabytes: the largest of its processes."""
    return lambda: (int(run_child(("-I", "-S", "-c", _WATCH, *command()))[1].split()[-1]) / 1e6,) * 2
