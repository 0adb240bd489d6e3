"""Suite ``shards``: parts side by side, a Dask cluster, and the memory of a merge."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from ffseg import __version__
from ffseg.batch.plan.discover import STATE_FOLDER
from ffseg.batch.record.journal import FORMAT, JOURNAL
from ffseg.batch.record.order import order_key
from ffseg.batch.record.tables import RUN
from ffseg.batch.record.values import Record, json_line, record_line
from ffseg.batch.shards.assign import Shard
from ffseg.batch.shards.merge import SHARDS
from ffseg.bench.measure import Comparison, Group, Skipped, Task
from ffseg.bench.suites.children import FreshFolders, measured_child, timed_child
from ffseg.bench.suites.drawing import draw
from ffseg.bench.suites.processes import write_images
from ffseg.bench.suites.settings import Settings

NUM_IMAGES, QUICK_IMAGES = 4000, 4
"""So many that two Dask workers get chunks of 500, and that the two parts, drawn by name, differ by a hundredth."""
ROWS, QUICK_ROWS = (20_000, 60_000, 200_000), (100, 200, 400)
"""Rows of the merges whose memory is compared."""
PARTS = 2
FEW = 3
_RUN = ("-m", "ffseg", "run")


def shards(settings: Settings) -> Iterator[Group | Skipped]:
    """Milliseconds an image of two workers, of two shards side by side and of two Dask workers; memory of merges."""
    images = settings.work / "images"
    count = QUICK_IMAGES if settings.quick else NUM_IMAGES
    write_images(images, count, settings)
    folders = FreshFolders(settings.work, keep=True)
    whole: dict[str, Callable[[], tuple[str, ...]]] = {
        "jobs, 2": lambda: (*_RUN, str(images), "--quiet", "--jobs", "2", "--out", str(folders())),
        "2 shards": lambda: ("-m", "ffseg.bench.suites.shards", str(images), str(folders())),
    }
    comparisons = [Comparison("rate of 2 shards side by side in rates of --jobs 2", "jobs, 2", "2 shards")]
    if find_spec("distributed") is not None:
        dask = (*_RUN, str(images), "--quiet", "--executor", "dask", "--chunk", "500", "--jobs", "2", "--out")
        whole["dask, 2 workers"] = lambda: (*dask, str(folders()))
        comparisons.append(
            Comparison("rate of Dask, its start included, in rates of --jobs 2", "jobs, 2", "dask, 2 workers")
        )
    tasks = [Task(name, "image", timed_child(command, count)) for name, command in whole.items()]
    yield Group("shards", "images", draw(1).image, tasks, {"images": count}, comparisons, rounds=FEW)
    yield _merges(settings)


def _merges(settings: Settings) -> Group:
    tasks = []
    rows = QUICK_ROWS if settings.quick else ROWS
    for count in rows:
        folder = settings.work / f"rows-{count}"
        made_up(folder, count)
        timer = measured_child(partial(_merge, folder))
        tasks.append(Task(f"merge, {count} rows", "peak", timer, x=count, unit="MB"))
    longest = Comparison(f"memory of merging {rows[-1]} rows over {rows[0]}", tasks[-1].case, tasks[0].case)
    return Group("shards", "merges", draw(1).image, tasks, {}, [longest], rounds=FEW)


def _merge(folder: Path) -> tuple[str, ...]:
    return ("-m", "ffseg", "merge", str(folder))


def made_up(out: Path, count: int) -> None:
    """Write the journals of two shards of so many images that nobody has made."""
    row: dict[str, object] = {
        "status": "ok",
        "error": "",
        "width": 800,
        "height": 600,
        "method": "freeform",
        "stop_reason": "converged",
    }
    row |= dict.fromkeys(
        ("initial_points", "final_points", "patches", "iterations", "splits", "flips", "area_px"), 1234
    )
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
        (folder / RUN).write_text(json.dumps({"status": "finished", "whole": count}))


def main(images: str, out: str) -> None:
    """Run two shards with a worker each at the same time; as a program."""
    runs = []
    for number in range(1, PARTS + 1):
        part = ["--shard", f"{number}/{PARTS}", "--jobs", "1", "--quiet", "--out", out]
        runs.append(subprocess.Popen([sys.executable, *_RUN, images, *part]))  # noqa: S603 - our own command
    sys.exit(max(run.wait() for run in runs))


if __name__ == "__main__":
    main(*sys.argv[1:])
