"""How many clicks a region takes; run ``python -m tests.campaigns.clicks [--sealed] [--grabcut] [--data DATA] [--out FILE]``.

A simulated user clicks first where the truth is deepest, then each time deepest in the largest error, inside
(`init.circles`) or outside (`init.background`), with discs as `ffseg pick` makes them, no larger than the error is deep.
Said of each set: mean IoU after 1, 2, 3, 5 and 10 clicks, clicks to an IoU of .80, .85 and .90 (at most 20 count), the
share of clicks that lose more than .02, and the IoU with the box of the truth; ``cv2.grabCut`` with the same clicks and boxes
beside it. Drawn kinds are held out from all that was grown or chosen; of photographs every second one is opened, the others
with ``--sealed``.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
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
from ffseg.learning.drawn.clicks import Clicks, covered
from ffseg.learning.drawn.sights import KINDS, sights
from ffseg.metrics import INSIDE, iou
from ffseg.parameters import load_params
from ffseg.picking.session import start_radius
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
COLUMNS = ("set", "image", "half", "method", "box", "ms", "edge_map_ms", *(f"iou_{n}" for n in range(1, MOST + 1)))


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A picture, its truth, and how it is asked."""

    folder: str
    name: str
    half: int
    image: Picture
    truth: Picture
    method: str

    def asked(self) -> list[object]:
        """Its row of the table: overlaps after each click, that of the box, and the median time of a click in ms."""
        single_thread()
        ask, overlaps, clicks, mask, spent = METHODS[self.method], [], Clicks(), np.zeros(self.truth.shape, bool), []
        for number in range(MOST):
            clicks = clicks.next(mask, self.truth, start_radius(self.truth.shape))
            begin = process_time()
            with suppress(FfsegError):  # the page goes on showing what was there
                mask = ask(self.image, clicks, None)
            spent.append((process_time() - begin) * 1e3)
            overlaps.append(round(iou(mask, self.truth), 4))
            if overlaps[-1] >= LEVELS[-1] and number + 1 >= AFTER[-1]:
                break
        own = [_timed(lambda: edge_map(self.image, load_params().edges)) for _ in range(3)]
        box = "" if self.folder not in BOXED else self._boxed(ask)
        return [
            *(self.folder, self.name, self.half, self.method, box, round(median(spent), 1), round(min(own), 2)),
            *(*overlaps, *[""] * (MOST - len(overlaps))),
        ]

    def _boxed(self, ask: Ask) -> float | str:
        x, y, width, height = cv2.boundingRect((self.truth == INSIDE).astype(np.uint8))
        if width * height > WIDE * self.truth.size:
            return ""
        return round(iou(ask(self.image, Clicks(), (x, y, width, height)), self.truth), 4)


Ask = Callable[[Picture, Clicks, tuple[int, int, int, int] | None], Mask]


def ours(image: Picture, clicks: Clicks, box: tuple[int, int, int, int] | None) -> Mask:
    """The region with the defaults."""
    params = load_params()
    init = replace(params.init, circles=clicks.inside, background=clicks.outside)
    if box is not None:
        x, y, width, height = box
        init = replace(init, boxes=((x - 0.5, y - 0.5, x + width - 0.5, y + height - 0.5),))
    return ffseg.segment(image, replace(params, init=init)).mask


PROBABLE = 4.0
"""Radii of a click within which GrabCut is told that what is clicked is probably inside; without, it gives the discs back."""


def grabcut(image: Picture, clicks: Clicks, box: tuple[int, int, int, int] | None) -> Mask:
    """What ``cv2.grabCut`` gives in five iterations: of clicks, the parts that hang together with one inside."""
    image = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR).astype(np.uint8)
    labels = np.full(image.shape[:2], cv2.GC_PR_BGD, np.uint8)
    near = tuple((x, y, PROBABLE * radius) for x, y, radius in clicks.inside)
    for circles, label in ((near, cv2.GC_PR_FGD), (clicks.inside, cv2.GC_FGD), (clicks.outside, cv2.GC_BGD)):
        labels[covered(circles, labels.shape)] = label
    cv2.setRNGSeed(0)
    mode = cv2.GC_INIT_WITH_MASK if box is None else cv2.GC_INIT_WITH_RECT
    cv2.grabCut(image, labels, box, np.zeros((1, 65)), np.zeros((1, 65)), 5, mode)  # type: ignore[call-overload]
    found = (labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD)
    if box is not None:
        return np.asarray(found)
    parts = cv2.connectedComponents(found.astype(np.uint8), connectivity=4)[1]
    kept = {int(parts[covered((one,), parts.shape)].max(initial=0)) for one in clicks.inside} - {0}
    return np.asarray(np.isin(parts, list(kept)))


METHODS: dict[str, Ask] = {"ffseg": ours, "grabcut": grabcut}


def _timed(work: Callable[[], object]) -> float:
    begin = process_time()
    work()
    return (process_time() - begin) * 1e3


def tasks(options: argparse.Namespace) -> Iterator[Task]:
    """All pictures, one after another, for each method."""
    methods = list(METHODS)[: 1 + options.grabcut]
    for kind in KINDS if options.drawn else ():
        # every second look: two are at one picture
        for number, seen in enumerate(list(sights(kind, 2 * options.drawn, options.first))[::2]):
            for method in methods:
                yield Task(kind, f"{number}", 0, seen.image, seen.truth, method)
    for one in load(options.data, SETS if not options.drawn_only else ()):
        if one.half == options.sealed:
            for method in methods:
                yield Task(one.folder, one.name, one.half, one.image, one.truth, method)


def summary(rows: Iterable[list[object]]) -> Iterator[str]:
    """Lines of a table: of each set, of drawings, of photographs, and their means over sets."""
    groups: dict[tuple[str, str], list[list[object]]] = {}
    for row in rows:
        groups.setdefault((str(row[3]), str(row[0])), []).append(row)
    heads = [*(f"IoU {n}" for n in AFTER), *(f"NoC {level:.2f}" for level in LEVELS), "lost", "box", "edge maps"]
    yield "| method | set | images | " + " | ".join(heads) + " |"
    yield "| --- " * (3 + len(heads)) + "|"
    told = {key: figures(group) for key, group in groups.items()}
    for (method, name), values in told.items():
        yield _line(method, name, len(groups[method, name]), values)
    for method in METHODS:
        for what, names in (("drawings", tuple(KINDS)), ("photographs", SETS)):
            chosen = [values for (own, name), values in told.items() if own == method and name in names]
            if chosen:
                columns = [[v for v in column if v is not None] for column in zip(*chosen, strict=True)]
                yield _line(method, f"**{what}**", len(chosen), [mean(c) if c else None for c in columns])


def _line(method: str, name: str, count: int, values: list[float | None]) -> str:
    cells = [
        "" if value is None else f"{value:.3f}" if at < len(AFTER) else f"{value:.2f}"
        for at, value in enumerate(values)
    ]
    return f"| {method} | {name} | {count} | " + " | ".join(cells) + " |"


def figures(rows: list[list[object]]) -> list[float | None]:
    """Mean overlaps, clicks, share of clicks that lose, overlap of boxes, and time in edge maps."""
    runs = [[float(str(cell)) for cell in row[7:] if cell != ""] for row in rows]
    after = [mean(run[min(n, len(run)) - 1] for run in runs) for n in AFTER]
    clicks = [mean(next((i + 1 for i, v in enumerate(run) if v >= level), MOST) for run in runs) for level in LEVELS]
    steps = [b - a for run in runs for a, b in pairwise(run)]
    boxes = [float(str(row[4])) for row in rows if row[4] != ""]
    lost = mean(step < -LOSS for step in steps) if steps else 0.0
    spent = median(float(str(row[5])) / float(str(row[6])) for row in rows)
    return [*after, *clicks, lost, mean(boxes) if boxes else None, spent]


def main() -> int:
    """Print the table; without the photographs, that of drawings."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--data", type=Path, default=data_folder())
    parser.add_argument("--drawn", type=int, default=4, metavar="N", help="drawn pictures of each kind")
    parser.add_argument("--first", type=int, default=UNSEEN, metavar="N", help="number of the first of them")
    parser.add_argument("--drawn-only", action="store_true", help="no photographs")
    parser.add_argument("--sealed", action="store_true", help="the other half of the photographs")
    parser.add_argument("--grabcut", action="store_true", help="cv2.grabCut beside it")
    parser.add_argument("--jobs", type=int, default=1, metavar="N")
    parser.add_argument("--out", type=Path, help="CSV file of every click")
    options = parser.parse_args()
    with ProcessPoolExecutor(options.jobs) as pool:
        rows = list(pool.map(Task.asked, tasks(options)))
    if options.out:
        with options.out.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows([list(COLUMNS), *rows])
    print("\n".join(summary(rows)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
