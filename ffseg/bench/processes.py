"""Suites of whole processes: ``startup``, ``batch``, ``memory`` and ``shards``."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from ffseg import __version__
from ffseg.batch.plan.sources import STATE_FOLDER, order_key
from ffseg.batch.record.journal import FORMAT, JOURNAL
from ffseg.batch.record.tables import RUN as RUN_FILE
from ffseg.batch.record.values import Record, json_line, record_line
from ffseg.batch.shards.assign import Shard
from ffseg.batch.shards.merge import SHARDS
from ffseg.bench.children import HERE, PARTS, RUN, Command, fresh_folders, measured_child, peak_above, timed_child
from ffseg.bench.drawing import draw
from ffseg.bench.measure import Comparison, Group, Order, Sample, Skipped, Task, Timer, timed
from ffseg.bench.pictures import QUICK_WIDTHS, WIDTHS
from ffseg.image.reference import reference_read
from ffseg.io.images import read_image
from ffseg.io.masks import encode_png

NUM_IMAGES, QUICK_IMAGES = 500, 2
NUM_DISTINCT = 20
"""Drawn images of a batch; the others are the same files under other names."""
LENGTHS, QUICK_LENGTHS = (50, 150, 450), (2, 4)
"""Images of the batches whose memory is compared."""
NUM_SHARDED, QUICK_SHARDED = 4000, 4
"""So many that two Dask workers get chunks of 500, and that the two parts, drawn by name, differ by a hundredth."""
ROWS, QUICK_ROWS = (20_000, 60_000, 200_000), (100, 200, 400)
"""Rows of the merges whose memory is compared."""
EMPTY_PROGRAM = "import typer\napp = typer.Typer()\n@app.command()\ndef main() -> None:\n    pass\napp()\n"
IMPORTS = "import typer, numpy, cv2, yaml"
FEW = 3
"""Rounds for memory and batches: memory hardly varies, and a batch is many images already."""
TRIES = 5
"""Reads of each file in either way; of wall time the fastest counts, which waited least for a turn on a busy machine."""


def startup(order: Order, work: Path) -> Iterator[Group]:
    """Start of the command line beside an empty Typer program and the imports any such program has."""
    empty, image = work / "empty.py", work / "one" / "0000.png"
    empty.write_text(EMPTY_PROGRAM, encoding="utf-8")
    write_images(image.parent, 1, quick=order.quick)
    commands: dict[str, Command] = {
        "empty Typer program": lambda: (str(empty),),
        "--version": lambda: ("-m", "ffseg", "--version"),
        "--help": lambda: ("-m", "ffseg", "--help"),
        IMPORTS: lambda: ("-c", IMPORTS),
        "run, one image": _run(image, fresh_folders(work)),
    }
    tasks = [Task(name, "start", timed_child(command)) for name, command in commands.items()]
    comparisons = [
        Comparison("--version over the empty program", "--version", "empty Typer program"),
        Comparison("--help over the empty program", "--help", "empty Typer program"),
        Comparison("run of one image over the imports", "run, one image", IMPORTS),
    ]
    yield Group("startup", "commands", draw(1).image, tasks, {}, comparisons)


def batch(order: Order, work: Path) -> Iterator[Group]:
    """Milliseconds an image of ``ffseg run`` with durable writes, beside the bare pipeline."""
    images, folders = work / "images", fresh_folders(work)
    count = QUICK_IMAGES if order.quick else NUM_IMAGES
    masks = write_images(images, count, quick=order.quick)
    loop = (*HERE, "bare", str(images), str(masks))
    tasks = [Task("bare", "image", timed_child(lambda: (*loop, folders()), count))]
    comparisons = [Comparison("rate of --jobs 1 in rates of the bare pipeline", "bare", "jobs, 1")]
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    for jobs in (jobs for jobs in (1, 2, 4, 8) if jobs <= cores):
        timer = timed_child(_run(images, folders, "--jobs", str(jobs)), count)
        tasks.append(Task(f"jobs, {jobs}", "image", timer, x=jobs))
        if jobs > 1:
            comparisons.append(Comparison(f"rate of --jobs {jobs} in rates of --jobs 1", "jobs, 1", f"jobs, {jobs}"))
    guarded, plain = "guarded reading", "cv2.imread"
    timers = reading(sorted(images.iterdir())[:NUM_DISTINCT])
    tasks += [Task(case, "image", timer) for case, timer in zip((guarded, plain), timers, strict=True)]
    comparisons.append(Comparison(f"{guarded} beyond {plain}, in images of --jobs 1", guarded, "jobs, 1", minus=plain))
    facts = {"images": count, "cores": cores}
    yield Group("batch", "images", draw(1).image, tasks, facts, comparisons, FEW)


def reading(paths: Sequence[Path]) -> tuple[Timer, Timer]:
    """Timers of reading files guarded and with ``cv2.imread``, in milliseconds an image.

    Both are measured when the first is asked, call by call in turns, so that a busy machine slows both alike; the second
    gives what was measured then.
    """
    ways = [[timed(partial(way, os.fspath(path))) for path in paths] for way in (read_image, reference_read)]
    plain = [(0.0, 0.0)]

    def first() -> Sample:
        turns = np.array([[[timer() for timer in pair] for _ in range(TRIES)] for pair in zip(*ways, strict=True)])
        values, robust = turns[..., 0].min(axis=1).mean(axis=0), turns[..., 1].mean(axis=(0, 1))
        plain[0] = float(values[1]), float(robust[1])
        return float(values[0]), float(robust[0])

    return first, lambda: plain[0]


def memory(order: Order, work: Path) -> Iterator[Group | Skipped]:
    """Peak of a segmentation above the decoded image, and of batches of growing length."""
    if find_spec("resource") is None:
        yield Skipped("memory", "all", "this system does not count peak memory")
        return
    for width in QUICK_WIDTHS[:1] if order.quick else WIDTHS:
        drawing, path = draw(1, width, width * 3 // 4), work / f"{width}.npy"
        np.save(path, drawing.image)
        case, size = f"segment, {width}x{width * 3 // 4}", drawing.image.size
        task = Task(case, "peak above image", peak_above(path, drawing.start_radius, size), x=size, unit="B/px")
        yield Group("memory", case, draw(1).image, [task], {}, most=FEW)
        path.unlink()
    commands, folders = dict[int, Command](), fresh_folders(work)
    for length in QUICK_LENGTHS if order.quick else LENGTHS:
        write_images(work / f"batch-{length}", length, quick=order.quick)
        commands[length] = _run(work / f"batch-{length}", folders, "--jobs", "1")
    yield _peaks("memory", "batches", ("batch, {}", "memory of {} images over {}"), commands)


def shards(order: Order, work: Path) -> Iterator[Group]:
    """Milliseconds an image of two workers, of two shards side by side and of two Dask workers; memory of merges."""
    images, folders = work / "images", fresh_folders(work)
    count = QUICK_SHARDED if order.quick else NUM_SHARDED
    write_images(images, count, quick=order.quick)
    whole: dict[str, Command] = {
        "jobs, 2": _run(images, folders, "--jobs", "2"),
        "2 shards": lambda: (*HERE, "shards", str(images), folders()),
    }
    titles = {"2 shards": "rate of 2 shards side by side in rates of --jobs 2"}
    if find_spec("distributed") is not None:
        whole["dask, 2 workers"] = _run(images, folders, *["--executor", "dask", "--chunk", "500", "--jobs", "2"])
        titles["dask, 2 workers"] = "rate of Dask, its start included, in rates of --jobs 2"
    comparisons = [Comparison(title, "jobs, 2", case) for case, title in titles.items()]
    tasks = [Task(name, "image", timed_child(command, count)) for name, command in whole.items()]
    yield Group("shards", "images", draw(1).image, tasks, {"images": count}, comparisons, FEW)
    merges = dict[int, Command]()
    for rows in QUICK_ROWS if order.quick else ROWS:
        made_up(work / f"rows-{rows}", rows)
        merges[rows] = partial(tuple, ("-m", "ffseg", "merge", str(work / f"rows-{rows}")))
    yield _peaks("shards", "merges", ("merge, {} rows", "memory of merging {} rows over {}"), merges)


def _peaks(suite: str, name: str, texts: tuple[str, str], commands: Mapping[int, Command]) -> Group:
    """Peak memory of commands on inputs of growing sizes, and the largest over the smallest."""
    case, title = texts
    tasks = [Task(case.format(size), "peak", measured_child(command), size, "MB") for size, command in commands.items()]
    longest = Comparison(title.format(max(commands), min(commands)), tasks[-1].case, tasks[0].case)
    return Group(suite, name, draw(1).image, tasks, {}, [longest], FEW)


def _run(images: Path, folders: Callable[[], str], *options: str) -> Command:
    return lambda: (*RUN, str(images), "--quiet", *options, "--out", folders())


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


def made_up(out: Path, count: int) -> None:
    """Write the journals of two shards of so many images that nobody has made."""
    words = {"status": "ok", "error": "", "method": "freeform", "stop_reason": "converged"}
    counts = ("initial_points", "final_points", "patches", "iterations", "splits", "flips", "area_px")
    row: dict[str, object] = {**words, "width": 800, "height": 600, **dict.fromkeys(counts, 1234)}
    row |= {f"{name}_ms": 3.141 for name in ("decode", "edges", "evolve", "write", "total")}
    for number in range(1, PARTS + 1):
        folder = out / STATE_FOLDER / SHARDS / Shard(number, PARTS).name
        folder.mkdir(parents=True)
        with (folder / JOURNAL).open("wb") as file:
            file.write(json_line({"format": FORMAT, "settings": "made-up", "parameters": {}, "files": {}}))
            for index in range(number, count + 1, PARTS):
                name = f"{index * 7919 % 1000}/{index}.png"
                files = {"image": (f"/images/{name}", f"{index:032x}", (48_000, index))}
                place = order_key(0, name)
                made = Record(name, "ok", __version__, "made-up", f"{index:032x}", {}, row, files=files, order=place)
                file.write(record_line(made))
        (folder / RUN_FILE).write_text(json.dumps({"status": "finished", "whole": count}))
