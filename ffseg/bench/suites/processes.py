"""Suites of whole processes: ``startup``, ``batch`` and ``memory``."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from ffseg.bench.measure import Comparison, Group, Sample, Skipped, Task, Timer
from ffseg.bench.suites.bare import reading
from ffseg.bench.suites.children import FreshFolders, measured_child, timed_child
from ffseg.bench.suites.drawing import Drawing, draw
from ffseg.bench.suites.pictures import QUICK_WIDTHS, WIDTHS
from ffseg.bench.suites.settings import Settings
from ffseg.io.masks import encode_png

NUM_IMAGES, QUICK_IMAGES = 500, 2
NUM_DISTINCT = 20
"""Drawn images of a batch; the others are the same files under other names."""
LENGTHS, QUICK_LENGTHS = (50, 150, 450), (2, 4)
"""Images of the batches whose memory is compared."""
EMPTY_PROGRAM = """\
import typer
app = typer.Typer()
@app.command()
def main() -> None:
    pass
app()
"""
IMPORTS = "import typer, numpy, cv2, yaml"
FEW = 3
"""Rounds for memory and batches: memory hardly varies, and a batch is many images already."""
_FFSEG = ("-m", "ffseg")


def startup(settings: Settings) -> Iterator[Group | Skipped]:
    """Start of the command line beside an empty Typer program and the imports any such program has."""
    empty, image = settings.work / "empty.py", settings.work / "one" / "0000.png"
    empty.write_text(EMPTY_PROGRAM, encoding="utf-8")
    write_images(image.parent, 1, settings)
    folders = FreshFolders(settings.work)
    commands: dict[str, Callable[[], tuple[str, ...]]] = {
        "empty Typer program": lambda: (str(empty),),
        "--version": lambda: (*_FFSEG, "--version"),
        "--help": lambda: (*_FFSEG, "--help"),
        IMPORTS: lambda: ("-c", IMPORTS),
        "run, one image": lambda: (*_FFSEG, "run", str(image), "--quiet", "--out", str(folders())),
    }
    tasks = [Task(name, "start", timed_child(command)) for name, command in commands.items()]
    comparisons = [
        Comparison("--version over the empty program", "--version", "empty Typer program"),
        Comparison("--help over the empty program", "--help", "empty Typer program"),
        Comparison("run of one image over the imports", "run, one image", IMPORTS),
    ]
    yield Group("startup", "commands", draw(1).image, tasks, {}, comparisons)


def batch(settings: Settings) -> Iterator[Group | Skipped]:
    """Milliseconds an image of ``ffseg run`` with durable writes, beside the bare pipeline."""
    images = settings.work / "images"
    count = QUICK_IMAGES if settings.quick else NUM_IMAGES
    masks = write_images(images, count, settings)
    folders = FreshFolders(settings.work, keep=True)
    bare = ("-m", "ffseg.bench.suites.bare", str(images), str(masks))
    tasks = [Task("bare", "image", timed_child(lambda: (*bare, str(folders())), count))]
    comparisons = [Comparison("rate of --jobs 1 in rates of the bare pipeline", "bare", "jobs, 1")]
    for jobs in (jobs for jobs in (1, 2, 4, 8) if jobs <= _cores()):
        timer = timed_child(_run_command(images, folders, jobs), count)
        tasks.append(Task(f"jobs, {jobs}", "image", timer, x=jobs))
        if jobs > 1:
            comparisons.append(Comparison(f"rate of --jobs {jobs} in rates of --jobs 1", "jobs, 1", f"jobs, {jobs}"))
    files = sorted(images.iterdir())[:NUM_DISTINCT]
    guarded, plain = "guarded reading", "cv2.imread"
    tasks += [Task(case, "image", timer) for case, timer in zip((guarded, plain), reading(files), strict=True)]
    comparisons.append(Comparison(f"{guarded} beyond {plain}, in images of --jobs 1", guarded, "jobs, 1", minus=plain))
    facts = {"images": count, "cores": _cores()}
    yield Group("batch", "images", draw(1).image, tasks, facts, comparisons, rounds=FEW)


def memory(settings: Settings) -> Iterator[Group | Skipped]:
    """Peak of a segmentation above the decoded image, and of batches of growing length."""
    grey = draw(1).image
    if find_spec("resource") is None:
        yield Skipped("memory", "all", "this system does not count peak memory")
        return
    for width in QUICK_WIDTHS[:1] if settings.quick else WIDTHS:
        drawing = draw(1, width, width * 3 // 4)
        path = settings.work / f"{width}.npy"
        np.save(path, drawing.image)
        timer = _above_image(path, drawing)
        case = f"segment, {width}x{width * 3 // 4}"
        task = Task(case, "peak above image", timer, x=drawing.image.size, unit="B/px")
        yield Group("memory", case, grey, [task], {}, rounds=FEW)
        path.unlink()
    yield _batches(settings)


def _batches(settings: Settings) -> Group:
    folders, tasks = FreshFolders(settings.work), []
    lengths = QUICK_LENGTHS if settings.quick else LENGTHS
    for length in lengths:
        images = settings.work / f"batch-{length}"
        write_images(images, length, settings)
        timer = measured_child(_run_command(images, folders, 1))
        tasks.append(Task(f"batch, {length}", "peak", timer, x=length, unit="MB"))
    longest = Comparison(f"memory of {lengths[-1]} images over {lengths[0]}", tasks[-1].case, tasks[0].case)
    return Group("memory", "batches", draw(1).image, tasks, {}, [longest], rounds=FEW)


def _run_command(images: Path, folders: FreshFolders, jobs: int) -> Callable[[], tuple[str, ...]]:
    run = (*_FFSEG, "run", str(images), "--quiet", "--jobs", str(jobs), "--out")
    return lambda: (*run, str(folders()))


def _above_image(path: Path, drawing: Drawing) -> Timer:
    command = [sys.executable, "-m", "ffseg.bench.suites.peak", str(path), str(drawing.start_radius)]

    def sample() -> Sample:
        done = subprocess.run(command, check=True, capture_output=True)  # noqa: S603 - our own module
        seen = json.loads(done.stdout)
        above = (seen["peak"] - seen["before"]) / drawing.image.size
        return Sample(above, above)

    return sample


def write_images(folder: Path, count: int, settings: Settings) -> Path:
    """Write `count` drawn images and the ``.npy`` file of their grounds, whose path is returned."""
    folder.mkdir()
    width, height = (160, 120) if settings.quick else (800, 600)
    drawings = [draw(seed, width, height) for seed in range(min(count, NUM_DISTINCT))]
    for index in range(count):
        path = folder / f"{index:04d}.png"
        if index < len(drawings):
            path.write_bytes(encode_png(drawings[index].image, []))
        else:
            os.link(folder / f"{index % len(drawings):04d}.png", path)
    masks = settings.work / f"{folder.name}.npy"
    np.save(masks, np.stack([drawing.ground for drawing in drawings]))
    return masks


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
