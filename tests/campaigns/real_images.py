"""Photographs with truth and start circle for the campaign on real sets, and what a segmentation gives on one."""

import csv
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np
from numpy.typing import NDArray

from ffseg.api import segment
from ffseg.batch.workers.pictures import read_truth
from ffseg.errors import FfsegError
from ffseg.image.edges import edge_map
from ffseg.io.images import read_image
from ffseg.metrics import IGNORED, INSIDE, iou
from ffseg.parameters import Edges, Parameters
from ffseg.result import Segmentation

SETS = ("road", "seeded_objects", "real_floors/indoor", "real_floors/omni")
LARGEST_START, SMALL_START = 20.0, 8.0
"""Radius of the start circle, px: half of the free radius round the seed where the seeds tell it, else small."""
COLUMNS = (
    *("set", "image", "half", "iou", "score", "missed_px", "leaked_px", "stop_reason", "components", "holes"),
    *("edges_ms", "segment_ms", "edge_map_ms", "ratio", "status", "message"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Photograph:
    """One image with its truth and start circle; `half` is 0 for even and 1 for odd places in its set."""

    folder: str
    name: str
    image: NDArray[np.uint8]
    truth: NDArray[np.uint8]
    circle: tuple[float, float, float]
    half: int = 0

    def placed(self, params: Parameters) -> Parameters:
        """The parameters started at this image's circle."""
        x, y, radius = self.circle
        return replace(params, init=replace(params.init, center=(x, y), radius=radius))


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What the parameters gave on one image; times in ms of processor time."""

    photograph: Photograph
    mask: NDArray[np.bool_]
    overlap: float
    result: Segmentation | None
    edge_map_ms: float
    segment_ms: float
    message: str

    @property
    def missed(self) -> NDArray[np.bool_]:
        """Pixels of the truth that the result lacks."""
        return (self.photograph.truth == INSIDE) & ~self.mask

    @property
    def leaked(self) -> NDArray[np.bool_]:
        """Pixels of the result outside the truth; ignored ones do not count."""
        return self.mask & (self.photograph.truth != INSIDE) & (self.photograph.truth != IGNORED)

    def cells(self) -> list[object]:
        """Line of ``images.csv``."""
        one, result = self.photograph, self.result
        areas = [c.signed_area for c in result.contours] if result else []
        numbers = [np.count_nonzero(self.missed), np.count_nonzero(self.leaked)]
        stop = result.stats.stop_reason if result else ""
        sure, times = score(result), [self.edge_map_ms, self.segment_ms]
        return [
            *(one.folder, one.name, ("even", "odd")[one.half], round(self.overlap, 4)),
            *("" if sure is None else round(sure, 4), *numbers, stop),
            *(sum(area > 0 for area in areas), sum(area < 0 for area in areas)),
            *(round(result.timings.edges_ms, 2) if result else "", round(times[1], 2), round(times[0], 2)),
            *(round(times[1] / times[0], 2), "ok" if result else "failed", self.message),
        ]


def load(data: Path, folders: Iterable[str]) -> Iterator[Photograph]:
    """Photographs of the folders, sorted by name in each; a folder without seeds is left out."""
    for folder in folders:
        seeds = data / folder / "seeds.csv"
        if not seeds.is_file():
            continue
        with seeds.open(encoding="utf-8", newline="") as file:
            rows = sorted(csv.DictReader(file), key=lambda row: row["image"])
        for place, row in enumerate(rows):
            image = read_image(data / folder / "images" / row["image"])
            mask = os.fspath(data / folder / "truth" / f"{Path(row['image']).stem}.png")
            truth = read_truth(mask, (image.shape[0], image.shape[1]))
            yield Photograph(folder, row["image"], image, truth, circle_of(row), place % 2)


def circle_of(row: dict[str, str]) -> tuple[float, float, float]:
    """Start circle of a row of ``seeds.csv``; the sets name the columns in two ways."""
    if "x" in row:
        return float(row["x"]), float(row["y"]), float(row["radius"])
    free = row.get("inner_radius_px")
    radius = min(LARGEST_START, float(free) / 2) if free else SMALL_START
    return float(row["seed_x"]), float(row["seed_y"]), radius


def evaluate(one: Photograph, params: Parameters, repeat: int = 1) -> Outcome:
    """Segment one photograph; a failure gives an empty region."""
    placed = one.placed(params)
    base = _timed(lambda: edge_map(one.image, Edges(canny=(4.0, 8.0))), max(3, repeat))
    try:
        result = segment(one.image, placed)
        spent = _timed(lambda: segment(one.image, placed), repeat)
    except FfsegError as error:
        nothing = np.zeros(one.truth.shape, bool)
        return Outcome(one, nothing, 0.0, None, base, 0.0, str(error))
    said = "; ".join(result.messages)
    return Outcome(one, result.mask, iou(result.mask, one.truth), result, base, spent, said)


def _timed(work: Callable[[], object], repeat: int) -> float:
    spent = []
    for _ in range(repeat):
        begin = process_time()
        work()
        spent.append((process_time() - begin) * 1e3)
    return median(spent)


def score(result: Segmentation | None) -> float | None:
    """How sure the segmentation says it is, if it says so."""
    return None if result is None or np.isnan(result.score) else result.score
