"""Photographs with truth and start circle for the campaign on real sets, and what a segmentation gives on one."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

import cv2
import numpy as np
from batches import table
from numpy.typing import NDArray

from ffseg.api import segment
from ffseg.batch.workers.pictures import read_truth
from ffseg.errors import FfsegError
from ffseg.image.edges import edge_map
from ffseg.image.resized import resized
from ffseg.io.images import read_image
from ffseg.metrics import iou
from ffseg.parameters import Edges, Parameters
from tests.campaigns import harness

SETS = ("road", "seeded_objects", "real_floors/indoor", "real_floors/omni")
LARGEST_START, SMALL_START = 20.0, 8.0
"""Radius of the start circle, px: half of the free radius round the seed where the seeds tell it, else small."""


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

    def of_size(self, longer: int, shorter: int) -> "Photograph":
        """The photograph brought to this size, upright where it is."""
        height, width = self.truth.shape
        size = (longer, shorter) if width >= height else (shorter, longer)
        across, down = size[0] / width, size[1] / height
        x, y, radius = self.circle
        return replace(
            self,
            image=resized(self.image, (size[1], size[0])),
            truth=np.asarray(cv2.resize(self.truth, size, interpolation=cv2.INTER_NEAREST), np.uint8),
            circle=(across * (x + 0.5) - 0.5, down * (y + 0.5) - 0.5, radius * min(across, down)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What the parameters gave on one image; times in ms of processor time. One that failed is sure of nothing."""

    photograph: Photograph
    overlap: float
    score: float
    edge_map_ms: float
    segment_ms: float
    message: str


def load(data: Path, folders: Iterable[str]) -> Iterator[Photograph]:
    """Photographs of the folders, sorted by name in each; a folder without seeds is left out."""
    for folder in folders:
        seeds = data / folder / "seeds.csv"
        rows = table(seeds) if seeds.is_file() else []
        for place, row in enumerate(sorted(rows, key=lambda row: row["image"])):
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


def evaluate(one: Photograph, params: Parameters) -> Outcome:
    """Segment one photograph; a failure gives an empty region."""
    placed = one.placed(params)
    base = median(harness.milliseconds(lambda: edge_map(one.image, Edges(canny=(4.0, 8.0)))) for _ in range(3))
    try:
        result = segment(one.image, placed)
        spent = median(harness.milliseconds(lambda: segment(one.image, placed)) for _ in range(3))
    except FfsegError as error:
        return Outcome(one, 0.0, 0.0, base, 0.0, str(error))
    return Outcome(one, iou(result.mask, one.truth), float(result.score), base, spent, "; ".join(result.messages))
