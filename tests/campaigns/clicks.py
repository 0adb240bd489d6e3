"""How many clicks a region takes; run ``python -m tests.campaigns.clicks [--sealed] [--data DATA] [--out FILE]``.

A simulated user clicks first where the truth is deepest, then each time deepest in the largest error, inside
(`init.circles`) or outside (`init.background`), with discs as `ffseg pick` makes them, no larger than the error is deep.
Said of each set: mean IoU after 1, 2, 3, 5 and 10 clicks, clicks to an IoU of .80, .85 and .90 (at most 20 count), the
share of clicks that lose more than .02, and the IoU with the box of the truth. Drawn kinds are held out from all that was
grown or chosen; of photographs every second one is opened, the others with ``--sealed``.
"""

import csv
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path
from statistics import mean, median
from time import process_time

import cv2
import numpy as np
from numpy.typing import NDArray

import ffseg
from ffseg.errors import FfsegError
from ffseg.image.edges import edge_map
from ffseg.io.images import single_thread
from ffseg.learning.drawn.clicks import Clicks
from ffseg.learning.drawn.sights import KINDS, sights
from ffseg.metrics import INSIDE, iou
from ffseg.parameters import load_params
from ffseg.picking.session import start_radius
from tests.campaigns import harness
from tests.campaigns.real_images import SETS, load
from tests.real_data import data_folder

Picture = NDArray[np.uint8]
Mask = NDArray[np.bool_]

UNSEEN = 400_000
"""Number of the first drawn picture: forests learned from the first ones, choices were made on others."""
MOST, LEVELS, AFTER = 20, (0.80, 0.85, 0.90), (1, 2, 3, 5, 10)
LOSS = 0.02
WIDE = 0.8
"""Part of a picture up to which the box of a truth says something."""
BOXED = ("seeded_objects", "thing", "animal", "organ", "nuclei", "colony", "field")
COLUMNS = ("set", "image", "half", "box", "ms", "edge_map_ms", *(f"iou_{n}" for n in range(1, MOST + 1)))


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    folder: str
    name: str
    half: int
    image: Picture
    truth: Picture

    def asked(self) -> list[object]:
        """Its row of the table: overlaps after each click, that of the box, and the median time of a click in ms."""
        single_thread()
        overlaps, clicks, mask, spent = list[float](), Clicks(), np.zeros(self.truth.shape, bool), list[float]()
        for number in range(MOST):
            clicks = clicks.next(mask, self.truth, start_radius(self.truth.shape))
            begin = process_time()
            with suppress(FfsegError):  # the page goes on showing what was there
                mask = found(self.image, clicks)
            spent.append((process_time() - begin) * 1e3)
            overlaps.append(round(iou(mask, self.truth), 4))
            if overlaps[-1] >= LEVELS[-1] and number + 1 >= AFTER[-1]:
                break
        own = [harness.milliseconds(lambda: edge_map(self.image, load_params().edges)) for _ in range(3)]
        box = "" if self.folder not in BOXED else self._boxed()
        return [
            *(self.folder, self.name, self.half, box, round(median(spent), 1), round(min(own), 2)),
            *(*overlaps, *[""] * (MOST - len(overlaps))),
        ]

    def _boxed(self) -> float | str:
        x, y, width, height = cv2.boundingRect((self.truth == INSIDE).astype(np.uint8))
        if width * height > WIDE * self.truth.size:
            return ""
        return round(iou(found(self.image, Clicks(), (x, y, width, height)), self.truth), 4)


def found(image: Picture, clicks: Clicks, box: tuple[int, int, int, int] | None = None) -> Mask:
    params = load_params()
    init = replace(params.init, circles=clicks.inside, background=clicks.outside)
    if box is not None:
        x, y, width, height = box
        init = replace(init, boxes=((x - 0.5, y - 0.5, x + width - 0.5, y + height - 0.5),))
    return ffseg.segment(image, replace(params, init=init)).mask


def tasks(data: Path, count: int, first: int, sealed: bool, drawn_only: bool) -> Iterator[Task]:
    for kind in KINDS if count else ():
        # every second look: two are at one picture
        for number, seen in enumerate(list(sights(kind, 2 * count, first))[::2]):
            yield Task(kind, f"{number}", 0, seen.image, seen.truth)
    for one in load(data, () if drawn_only else SETS):
        if one.half == sealed:
            yield Task(one.folder, one.name, one.half, one.image, one.truth)


def summary(rows: Iterable[list[object]]) -> Iterator[str]:
    """Lines of a table: of each set, and the means over sets of drawings and of photographs."""
    groups: dict[str, list[list[object]]] = {}
    for row in rows:
        groups.setdefault(str(row[0]), []).append(row)
    heads = [*(f"IoU {n}" for n in AFTER), *(f"NoC {level:.2f}" for level in LEVELS), "lost", "box", "edge maps"]
    yield "| set | images | " + " | ".join(heads) + " |"
    yield "| --- " * (2 + len(heads)) + "|"
    told = {name: figures(group) for name, group in groups.items()}
    for name, values in told.items():
        yield _line(name, len(groups[name]), values)
    for what, names in (("drawings", tuple(KINDS)), ("photographs", SETS)):
        chosen = [values for name, values in told.items() if name in names]
        if chosen:
            columns = [[v for v in column if v is not None] for column in zip(*chosen, strict=True)]
            yield _line(f"**{what}**", len(chosen), [mean(c) if c else None for c in columns])


def _line(name: str, count: int, values: list[float | None]) -> str:
    cells = [
        "" if value is None else f"{value:.3f}" if at < len(AFTER) else f"{value:.2f}"
        for at, value in enumerate(values)
    ]
    return f"| {name} | {count} | " + " | ".join(cells) + " |"


def figures(rows: list[list[object]]) -> list[float | None]:
    """Mean overlaps, clicks, share of clicks that lose, overlap of boxes, and time in edge maps."""
    runs = [[float(str(cell)) for cell in row[6:] if cell != ""] for row in rows]
    after = [mean(run[min(n, len(run)) - 1] for run in runs) for n in AFTER]
    clicks = [mean(next((i + 1 for i, v in enumerate(run) if v >= level), MOST) for run in runs) for level in LEVELS]
    steps = [b - a for run in runs for a, b in pairwise(run)]
    boxes = [float(str(row[3])) for row in rows if row[3] != ""]
    lost = mean(step < -LOSS for step in steps) if steps else 0.0
    spent = median(float(str(row[4])) / float(str(row[5])) for row in rows)
    return [*after, *clicks, lost, mean(boxes) if boxes else None, spent]


def main(
    data: Path = data_folder(), drawn: int = 4, first: int = UNSEEN, drawn_only: bool = False, sealed: bool = False,
    jobs: int = 1, out: Path | None = None,
) -> None:  # fmt: skip
    """Print the table; without the photographs, that of drawings."""
    # not by fork: threads of OpenCV, which drawing has begun, end with it and leave their locks closed
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        rows = list(pool.map(Task.asked, tasks(data, drawn, first, sealed, drawn_only)))
    if out:
        with out.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows([list(COLUMNS), *rows])
    print("\n".join(summary(rows)))


if __name__ == "__main__":
    harness.as_command(main)
