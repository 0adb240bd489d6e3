"""The default beside GrabCut on things in photographs at 640x480; run ``python -m tests.campaigns.things``.

Every round times the edge map, the default and GrabCut in turn on each image, in processor time on one thread; what is
said of times are the medians over the images of the least of each, and their ratios. The images are enlarged or reduced
to 640x480 (480x640 upright), with their truths and starts.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import mean, median
from time import process_time

import cv2

from ffseg.api import segment
from ffseg.image.edges import edge_map
from ffseg.io.images import single_thread
from ffseg.metrics import iou
from ffseg.parameters import load_params
from tests.campaigns.real_images import Photograph, load
from tests.real_data import data_folder

SET = "seeded_objects"
SIZE = (640, 480)
METHODS = ("freeform", "cv_grabcut")


def sized(one: Photograph) -> Photograph:
    """The photograph with `SIZE`, or with that size turned if it stands upright."""
    height, width = one.image.shape[:2]
    size = SIZE if width >= height else SIZE[::-1]
    across, down = size[0] / width, size[1] / height
    method = cv2.INTER_AREA if across < 1 else cv2.INTER_CUBIC
    image = cv2.resize(one.image, size, interpolation=method).astype("uint8")
    truth = cv2.resize(one.truth, size, interpolation=cv2.INTER_NEAREST).astype("uint8")
    x, y, radius = one.circle
    circle = ((x + 0.5) * across - 0.5, (y + 0.5) * down - 0.5, radius * min(across, down))
    return replace(one, image=image, truth=truth, circle=circle)


def measured(one: Photograph, rounds: int) -> tuple[list[float], list[float]]:
    """Overlap of each method, and least times of the edge map and of each method in ms."""
    params = one.placed(load_params())
    found = [segment(one.image, params, method) for method in METHODS]
    works: list[Callable[[], object]] = [lambda: edge_map(one.image, params.edges)]
    works += [lambda method=method: segment(one.image, params, method) for method in METHODS]  # type: ignore[misc]
    times = [[_milliseconds(work) for work in works] for _ in range(rounds)]
    return [iou(one_found.mask, one.truth) for one_found in found], [min(column) for column in zip(*times, strict=True)]


def _milliseconds(work: Callable[[], object]) -> float:
    begin = process_time()
    work()
    return (process_time() - begin) * 1e3


def main() -> int:
    """Print mean overlaps and median times; 0 also when the images are absent."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=data_folder())
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    single_thread()
    rows = [measured(sized(one), options.rounds) for one in load(options.data, [SET])]
    if not rows:
        print(f"skipped: {SET} is not in {options.data}; name the folder with --data or FFSEG_DATA")
        return 0
    edges = median(times[0] for _, times in rows)
    print(f"edge map {edges:.2f} ms")
    for place, method in enumerate(METHODS):
        spent = median(times[place + 1] for _, times in rows)
        overlap = mean(overlaps[place] for overlaps, _ in rows)
        print(
            f"{method}: {spent:.1f} ms, {spent / edges:.1f} edge maps, mean IoU {overlap:.3f} over {len(rows)} images"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
