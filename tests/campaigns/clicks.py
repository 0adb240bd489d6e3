"""How many clicks a region takes; run ``python -m tests.campaigns.clicks [--sealed] [--learned N] [--data DATA] [--out FILE]``.

A simulated user clicks first where the truth is deepest, then each time deepest in the largest error, inside
(`init.circles`) or outside (`init.background`), with discs as `ffseg pick` makes them, no larger than the error is deep.
Said of each set: mean IoU after 1, 2, 3, 5 and 10 clicks, clicks to an IoU of .80, .85 and .90 (at most 20 count), the
share of clicks that lose more than .02, and the IoU with the box of the truth and with a loose one (`LOOSE`). Drawn kinds
are held out from all that was grown or chosen; of photographs every second one is opened, the others with ``--sealed``.
With ``--learned N`` a model of N images of a set, as `ffseg pick` learns it, says first what lies inside in the others of
the set, and the clicks correct that; boxes are looked at with it, too.
"""

import csv
import json
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from itertools import chain, pairwise
from multiprocessing import get_context
from pathlib import Path
from statistics import mean, median
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from numpy.typing import NDArray

import ffseg
from ffseg.errors import FfsegError
from ffseg.evidence.forest import to_bytes
from ffseg.evidence.source import proposes
from ffseg.image.edges import edge_map
from ffseg.io.images import prepare_worker
from ffseg.io.tables import without_nan
from ffseg.learning.drawn.clicks import Clicks
from ffseg.learning.drawn.sights import KINDS, sights
from ffseg.learning.gather import LabelledImage, TrainingSet
from ffseg.learning.learn import learn_and_measure
from ffseg.metrics import IGNORED, INSIDE, iou
from ffseg.parameter_files import load_params
from ffseg.parameters import Parameters, click_radius
from ffseg.picking.learner import learn_summary
from tests.campaigns import harness
from tests.campaigns.real_images import SETS, load
from tests.masks import box_round
from tests.real_data import data_folder

Picture = NDArray[np.uint8]
Mask = NDArray[np.bool_]

UNSEEN = 400_000
"""Number of the first drawn picture: forests learned from the first ones, choices were made on others."""
MOST, LEVELS, AFTER = 20, (0.80, 0.85, 0.90), (0, 1, 2, 3, 5, 10)
LOSS = 0.02
WIDE = 0.8
"""Part of a picture up to which the box of a truth says something."""
BOXED = ("seeded_objects", "thing", "animal", "organ", "nuclei", "colony", "field")
LOOSE = (0.05, 0.2)
"""By how much each side of a loose box lies further out, in parts of the mean of the box's sides."""
COLUMNS = ("set", "image", "half", "box", "loose_box", "ms", "edge_map_ms", *(f"iou_{n}" for n in range(MOST + 1)))


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    folder: str
    name: str
    half: int
    image: Picture
    truth: Picture
    model: str | None = None

    def asked(self) -> list[object]:
        """Its row of the table: overlaps after each click, that of the box, and the median time of a click in ms."""
        prepare_worker()
        clicks, mask, spent = Clicks(), np.zeros(self.truth.shape, bool), list[float]()
        if self.model is not None and proposes(_with_model(self.model)):
            mask = found(self.image, clicks, model=self.model)
        overlaps = [round(iou(mask, self.truth), 4)]
        while len(overlaps) <= MOST and not (overlaps[-1] >= LEVELS[-1] and len(overlaps) > AFTER[-1]):
            before, clicks = clicks, clicks.next(mask, self.truth, click_radius(self.truth.shape))
            begin = process_time()
            try:
                mask = found(self.image, clicks, model=self.model)
            except FfsegError:  # the model has no other start: what is inside must be shown
                known = np.where(mask & (self.truth != INSIDE), np.uint8(IGNORED), self.truth)
                clicks = before.next(mask, known, click_radius(self.truth.shape))
                mask = found(self.image, clicks, model=self.model)
            spent.append((process_time() - begin) * 1e3)
            overlaps.append(round(iou(mask, self.truth), 4))
        own = [harness.milliseconds(lambda: edge_map(self.image, load_params().edges)) for _ in range(3)]
        boxes = self._boxed() if self.folder in BOXED else ("", "")
        return [
            *(self.folder, self.name, self.half, *boxes, round(median(spent), 1), round(min(own), 2)),
            *(*overlaps, *[""] * (MOST + 1 - len(overlaps))),
        ]

    def _boxed(self) -> tuple[float | str, float | str]:
        tight = box_round(self.truth)
        if np.prod(tight[2:] - tight[:2]) > WIDE * self.truth.size:
            return "", ""
        loose = box_round(
            self.truth, np.random.default_rng(list(f"{self.folder} {self.name}".encode())).uniform(*LOOSE, 4)
        )
        tight_iou, loose_iou = (
            round(iou(found(self.image, Clicks(), box, self.model), self.truth), 4) for box in (tight, loose)
        )
        return tight_iou, loose_iou


def found(image: Picture, clicks: Clicks, box: Iterable[float] | None = None, model: str | None = None) -> Mask:
    params = _with_model(model)
    init = replace(params.init, circles=clicks.inside, background=clicks.outside)
    if box is not None:
        left, top, right, bottom = map(float, box)
        init = replace(init, boxes=((left, top, right, bottom),))
    return ffseg.segment(image, replace(params, init=init)).mask


def _with_model(model: str | None) -> Parameters:
    params = load_params()
    return replace(params, edges=replace(params.edges, model=model))


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """Images of a set that teach a model of the others, and the file for it."""

    taught: list[Task]
    others: list[Task]
    path: str

    def learned(self) -> list[Task]:
        """The others with the model, measured as by `ffseg pick`; without it where it is of no use, as there."""
        prepare_worker()
        params = load_params()
        labelled = [LabelledImage(one.name, one.image, one.truth, params, None) for one in self.taught]
        model, figures = learn_and_measure(TrainingSet(labelled, [], {}), params, lambda _: None)
        if not learn_summary(json.dumps(without_nan(asdict(figures)))).of_use:
            return self.others
        Path(self.path).write_bytes(to_bytes(model))
        return [replace(one, model=self.path) for one in self.others]


def lessons(given: Iterable[Task], count: int, folder: Path) -> Iterator[Lesson]:
    """Of each set, every so many images teach a model of the others."""
    groups: dict[str, list[Task]] = {}
    for one in given:
        groups.setdefault(one.folder, []).append(one)
    for name, group in groups.items():
        for first in range(0, len(group) - count + 1, count):
            taught = group[first : first + count]
            path = str(folder / f"{name.replace('/', '-')}-{first}.ffmodel")
            yield Lesson(taught, [one for one in group if one not in taught], path)


def tasks(data: Path, count: int, first: int, sealed: bool) -> Iterator[Task]:
    for kind in KINDS if count else ():
        # every second look: two are at one picture
        for number, seen in enumerate(list(sights(kind, 2 * count, first))[::2]):
            yield Task(kind, f"{number}", 0, seen.image, seen.truth)
    for one in load(data, SETS):
        if one.half == sealed:
            yield Task(one.folder, one.name, one.half, one.image, one.truth)


def summary(rows: Iterable[list[object]]) -> Iterator[str]:
    """Lines of a table: of each set, and the means over sets of drawings and of photographs."""
    groups: dict[str, list[list[object]]] = {}
    for row in rows:
        groups.setdefault(str(row[0]), []).append(row)
    clicks = (*(f"IoU {n}" for n in AFTER), *(f"NoC {level:.2f}" for level in LEVELS))
    heads = [*clicks, "lost", "box", "loose box", "edge maps"]
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
    """Mean overlaps, clicks, share of clicks that lose, overlaps of boxes, and time in edge maps."""
    runs = [[float(str(cell)) for cell in row[COLUMNS.index("iou_0") :] if cell != ""] for row in rows]
    after = [mean(run[min(n, len(run) - 1)] for run in runs) for n in AFTER]
    clicks = [mean(next((i for i, v in enumerate(run) if v >= level), MOST) for run in runs) for level in LEVELS]
    steps = [b - a for run in runs for a, b in pairwise(run if run[0] else run[1:])]
    boxes = [[float(str(row[at])) for row in rows if row[at] != ""] for at in map(COLUMNS.index, ("box", "loose_box"))]
    lost = mean(step < -LOSS for step in steps) if steps else 0.0
    ms, own = (COLUMNS.index(name) for name in ("ms", "edge_map_ms"))
    spent = median(float(str(row[ms])) / float(str(row[own])) for row in rows)
    return [*after, *clicks, lost, *(mean(one) if one else None for one in boxes), spent]


def main(
    data: Path = data_folder(), drawn: int = 4, first: int = UNSEEN, sealed: bool = False, learned: int = 0,
    jobs: int = 1, out: Path | None = None,
) -> None:  # fmt: skip
    """Print the table; where there are no photographs, that of drawings."""
    given = tasks(data, drawn, first, sealed)
    # not by fork: threads of OpenCV, which drawing has begun, end with it and leave their locks closed
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool, TemporaryDirectory() as folder:
        if learned:
            given = chain.from_iterable(pool.map(Lesson.learned, lessons(given, learned, Path(folder))))
        rows = list(pool.map(Task.asked, given))
    if out:
        with out.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows([list(COLUMNS), *rows])
    print("\n".join(summary(rows)))


if __name__ == "__main__":
    harness.as_command(main)
