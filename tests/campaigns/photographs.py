"""All methods on photographs: parameters chosen on half of the images, reported on the other half.

Run ``python -m tests.campaigns.photographs --work DIR --data DATA``. DATA holds the folders ``road`` and
``seeded_objects``, each with ``images/``, ``truth/`` (255 inside, 128 ignored) and ``seeds.csv``; without it the campaign
says so and does nothing. The images of a folder sorted by name, those at even places choose and those at odd places are
reported. Every method has a small grid of parameter sets; the one with the highest mean IoU counts, once for each folder
and once for both. An image that fails counts as IoU 0. Writes ``grid.csv``, ``photographs.csv``, ``photographs.md``.
"""

from __future__ import annotations

import argparse
import csv
import os
import pickle
import resource
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from operator import itemgetter
from pathlib import Path
from statistics import mean, median
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ffseg.api import segment
from ffseg.batch.plan.sources import Job
from ffseg.compare.run import compare, plan_comparison
from ffseg.compare.values import Comparison, Row
from ffseg.errors import FfsegError
from ffseg.io.files import write_bytes_atomic
from ffseg.io.images import read_image, single_thread
from ffseg.io.masks import read_levels
from ffseg.io.tables import csv_table
from ffseg.methods.peers import configured
from ffseg.metrics import iou
from ffseg.parameters import load_params
from ffseg.peer_parameters import PeerParameters
from ffseg.plugins import PEERS, SEGMENTERS
from ffseg.result import Segmentation
from tests.real_data import data_folder

SETS = ("road", "seeded_objects")
LARGEST_START, SMALL_START = 20.0, 8.0
"""Radius of the start circle, px: half of the free radius round the seed where the seeds tell it, else small."""
SLOW = ("skimage_gac", "skimage_chan_vese", "skimage_snake", "cv_grabcut", "sitk_gac")
REPEAT, LONG_MS = 5, 200.0
"""Runs whose median processor time counts; one that takes longer than this is enough."""
LIMIT, SLOW_LIMIT = 5, 120
"""Seconds of processor time an image may take."""
T = TypeVar("T")

Setting = tuple[tuple[str, object], ...]
"""One parameter set: values by dotted key; for a peer the keys of its section."""

_SMOOTHING = (1.5, 2.5, 4.0)
_THRESHOLDS = (1.0, 2.0, 4.0, 8.0)
_CANNY = ("auto", (1.0, 2.0), (2.0, 4.0), (4.0, 8.0), (8.0, 16.0))

GRIDS: dict[str, dict[str, tuple[object, ...]]] = {
    "freeform": {"edges.sigma": _SMOOTHING, "edges.canny": _CANNY, "contour.clearance": (0.0, 16.0)},
    "snake": {"edges.sigma": _SMOOTHING, "edges.canny": _CANNY},
    "levelset": {"edges.sigma": _SMOOTHING, "edges.canny": _CANNY},
    "cv_floodfill": {"sigma": (0.8, 2.0, 4.0), "tolerance": (5, 10, 15, 20, 30, 50)},
    "cv_edges": {"sigma": (0.8, *_SMOOTHING), "threshold": _THRESHOLDS},
    "cv_edges_opened": {"sigma": (0.8, *_SMOOTHING), "threshold": _THRESHOLDS, "radius": (3.0, 6.0)},
    "cv_watershed": {"sigma": (0.8, 2.0, 4.0, 8.0)},
    "sitk_fast_marching": {"sigma": (0.8, 2.5), "threshold": _THRESHOLDS},
    "skfmm": {"sigma": (0.8, 2.5), "threshold": _THRESHOLDS},
    "sitk_gac": {"threshold": (1.0, 2.0, 4.0)},
    "cv_grabcut": {"iterations": (5,)},
    "skimage_snake": {"sigma": (3.0,)},
    "skimage_chan_vese": {"iterations": (40,)},
    "skimage_gac": {"iterations": (200,)},
}
"""Values tried, by method and key; the product of a method's values is its grid. The slowest have one: their default."""


@dataclass(frozen=True, eq=False)
class Photograph:
    """One image with its truth and job."""

    image: NDArray[np.uint8]
    truth: NDArray[np.uint8]
    job: Job


@dataclass(frozen=True)
class Result:
    """A method's figures on the reported half of a folder."""

    folder: str
    method: str
    chosen_on: str
    setting: Setting
    chosen_iou: float
    rows: tuple[Row, ...]

    def cells(self) -> list[object]:
        """Line of ``photographs.csv``."""
        overlaps = [row.iou or 0.0 for row in self.rows]
        edges = [0.0 if row.boundary_f_2px is None else row.boundary_f_2px for row in self.rows]
        times = [row.total_ms for row in self.rows if row.total_ms is not None]
        figures = [mean(overlaps), median(overlaps), mean(edges), median(times) if times else None]
        rounded = [None if figure is None else round(figure, 4) for figure in (self.chosen_iou, *figures)]
        failed = sum(row.status != "ok" for row in self.rows)
        return [self.folder, self.method, self.chosen_on, shown(self.setting), *rounded, failed, len(self.rows)]


COLUMNS = (
    *("folder", "method", "chosen_on", "parameters", "mean_iou_chosen_half", "mean_iou", "median_iou"),
    *("mean_boundary_f_2px", "median_ms", "failed", "images"),
)


def main() -> int:
    """Run the campaign; 0 also when the photographs are absent."""
    options = _options()
    if not all((options.data / folder / "seeds.csv").is_file() for folder in SETS):
        say(f"skipped: {options.data} has no {' and '.join(SETS)} with seeds.csv; name the folder with --data")
        return 0
    single_thread()
    options.work.mkdir(parents=True, exist_ok=True)
    folders = {folder: _photographs(options.data / folder, options.work) for folder in SETS}
    methods = [name for name in options.methods.split(",") if name in SEGMENTERS or _installed(name)]
    grid: list[list[object]] = []
    results = [result for method in methods for result in _examine(method, folders, options.work, grid)]
    tables = {"grid.csv": csv_table(("method", "parameters", *SETS), grid)}
    tables["photographs.csv"] = csv_table(COLUMNS, [result.cells() for result in results])
    tables["photographs.md"] = markdown(results).encode("utf-8")
    for name, content in tables.items():
        write_bytes_atomic(options.work / name, content)
    say(markdown(results))
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--work", type=Path, required=True, help="folder to work in, made if absent")
    parser.add_argument("--data", type=Path, default=data_folder(), help="photographs")
    parser.add_argument("--methods", default=",".join(GRIDS), help="names separated by commas")
    return parser.parse_args()


def _installed(name: str) -> bool:
    if name in PEERS and PEERS[name].installed:
        return True
    say(f"skipped: {name} is not installed" if name in PEERS else f"skipped: there is no method {name}")
    return False


def _photographs(folder: Path, work: Path) -> list[Photograph]:
    """Photographs of a folder sorted by name, started at their seeds."""
    starts = work / f"starts-{folder.name}.csv"
    with (folder / "seeds.csv").open(encoding="utf-8", newline="") as file:
        seeds = list(csv.DictReader(file))
    lines = [[seed["image"], seed["seed_x"], seed["seed_y"], _radius(seed)] for seed in seeds]
    write_bytes_atomic(starts, csv_table(("image", "x", "y", "radius"), lines))
    jobs = plan_comparison([str(folder / "images")], str(work), str(folder / "truth"), str(starts))
    return [Photograph(read_image(job.source.path), read_levels(job.truth), job) for job in sorted(jobs, key=_name)]


def _radius(seed: Mapping[str, str]) -> float:
    free = seed.get("inner_radius_px")
    return min(LARGEST_START, float(free) / 2) if free else SMALL_START


def _name(job: Job) -> str:
    return job.source.name


def _examine(
    method: str, folders: Mapping[str, list[Photograph]], work: Path, grid: list[list[object]]
) -> Iterator[Result]:
    """Choose on the even places, report on the odd ones; every parameter set tried is noted in `grid`."""
    begin = time.monotonic()
    tried: dict[Setting, dict[str, float]] = {}
    choices = settings(method)
    for setting in choices if len(choices) > 1 else ():
        tried[setting] = {folder: _mean_overlap(method, setting, folders[folder][::2]) for folder in SETS}
        grid.append([method, shown(setting), *(round(tried[setting][folder], 4) for folder in SETS)])
    say(f"{method}: {len(tried)} parameter sets in {time.monotonic() - begin:.0f} s")
    tried = tried or {choices[0]: dict.fromkeys(SETS, float("nan"))}
    common = best(tried, lambda found: mean(found.values()))
    for folder in SETS:
        own = best(tried, itemgetter(folder))
        reports = {setting: _report(method, setting, folders[folder][1::2], work) for setting in {own, common}}
        for chosen_on, setting in ((folder, own), ("both", common)):
            yield Result(folder, method, chosen_on, setting, tried[setting][folder], reports[setting])


def settings(method: str) -> list[Setting]:
    """All parameter sets of a method's grid."""
    keys = GRIDS[method]
    return [tuple(zip(keys, values, strict=True)) for values in product(*keys.values())]


def best(tried: Mapping[Setting, dict[str, float]], figure: Callable[[dict[str, float]], float]) -> Setting:
    """Parameter set with the highest figure; the first of equals."""
    return max(tried, key=lambda setting: figure(tried[setting]))


def _mean_overlap(method: str, setting: Setting, photographs: list[Photograph]) -> float:
    """Mean IoU; an image that cannot be segmented, or not in time, counts 0."""
    overlaps = (limited(partial(_overlap, method, setting, one), _limit(method)) for one in photographs)
    return mean(overlap or 0.0 for overlap in overlaps)


def _overlap(method: str, setting: Setting, photograph: Photograph) -> float:
    try:
        return iou(_segment(method, setting, photograph).mask, photograph.truth)
    except FfsegError:
        return 0.0


def _segment(method: str, setting: Setting, photograph: Photograph) -> Segmentation:
    task = _task(method, setting, photograph, Path())
    start = photograph.job.start
    params = start.placed(task.params, photograph.image.shape) if start else task.params
    params, options = configured(params, method, task.peers)
    return segment(photograph.image, params, method, options=options)


def _limit(method: str) -> int:
    return SLOW_LIMIT if method in SLOW else LIMIT


def limited(work: Callable[[], T], seconds: int) -> T | None:
    """What `work` returns, computed in a child process; None when it takes more processor time than this."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        with os.fdopen(writer, "wb") as pipe:
            pickle.dump(work(), pipe)
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        data = pipe.read()
    status = os.waitpid(child, 0)[1]
    return pickle.loads(data) if status == 0 else None  # from our own process


def _task(method: str, setting: Setting, photograph: Photograph, out: Path) -> Comparison:
    params, peers = load_params(), PeerParameters()
    if method in PEERS:
        section = replace(getattr(peers, method), **dict(setting))
        peers = replace(peers, **{method: section})
    else:
        params = load_params(None, dict(setting))
    return Comparison((photograph.job,), str(out), (method,), params, peers)


def _report(method: str, setting: Setting, photographs: list[Photograph], work: Path) -> tuple[Row, ...]:
    """Rows of a comparison of each image; one that takes too long has a failed row."""
    rows, seconds = [], _limit(method)
    for photograph in photographs:
        task = _task(method, setting, photograph, work / "compared" / method / str(settings(method).index(setting)))
        late = Row(photograph.job.source.name, method, status="failed", error=f"took more than {seconds} s")
        rows.append(limited(partial(_compared, task, setting, photograph), seconds) or late)
    return tuple(rows)


def _compared(task: Comparison, setting: Setting, photograph: Photograph) -> Row:
    """Row of one image, with processor time of edges and evolution in the place of wall time."""
    row = compare(task, lambda _row: None)[0]
    if row.status != "ok":
        return row
    spent = []
    for _ in range(REPEAT):
        begin = time.process_time()
        _segment(row.method, setting, photograph)
        spent.append((time.process_time() - begin) * 1e3)
        if spent[-1] > LONG_MS:
            break
    return replace(row, total_ms=median(spent))


def shown(setting: Setting) -> str:
    """A parameter set as a user would write it."""
    return " ".join(f"{key}={_value(value)}" for key, value in setting)


def _value(value: object) -> str:
    return f"[{','.join(f'{item:g}' for item in value)}]" if isinstance(value, tuple) else f"{value}"


def markdown(results: list[Result]) -> str:
    """Tables for reading: for each folder and choice one line a method, best mean IoU first."""
    lines: list[str] = []
    for folder, choice in product(SETS, ("own", "both")):
        wanted = folder if choice == "own" else choice
        chosen = "that folder" if choice == "own" else "both folders"
        lines += [f"### {folder}: parameters chosen on the other half of {chosen}", "", *_HEAD]
        cells = [result.cells() for result in results if (result.folder, result.chosen_on) == (folder, wanted)]
        for line in sorted(cells, key=lambda line: -float(str(line[5]))):
            figures = [*(_figure(cell, 3) for cell in line[4:8]), _figure(line[8], 1)]
            lines.append(f"| {line[1]} | `{line[3]}` | {' | '.join(figures)} |")
        lines.append("")
    return "\n".join(lines)


_HEAD = (
    "| method | parameters | mean IoU where chosen | mean IoU | median IoU | boundary F 2 px | ms |",
    "| --- | --- | --: | --: | --: | --: | --: |",
)


def _figure(value: object, digits: int) -> str:
    return f"{value:.{digits}f}" if isinstance(value, float) and value == value else ""


def say(text: str) -> None:
    """Print a figure."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
