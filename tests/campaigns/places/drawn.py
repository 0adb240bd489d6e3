"""Drawn pictures with truth and start, by kind and number; ``python -m tests.campaigns.places.drawn --sheet FILE``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.io.files import write_bytes_atomic
from ffseg.io.masks import encode_png
from ffseg.metrics import IGNORED, INSIDE
from tests.campaigns.places.cameras import CLEAR_OF_CAMERA, mirror, perspective, photographed
from tests.campaigns.places.figures import thing
from tests.campaigns.places.rays import Scene
from tests.campaigns.places.rooms import room
from tests.campaigns.places.skins import Array
from tests.campaigns.places.streets import street

KINDS = ("room", "street", "mirror", "thing")
STARTS = 2
"""Of each picture."""
RADII = (4.0, 22.0)
"""px, of the starts."""
SHARES = {"thing": (0.03, 0.6)}
LEAST_MOST = (0.04, 0.9)
"""Share of the picture that its truth takes; others are drawn again."""


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """One look at a picture: its truth (255 inside, 128 doubtful) as a start circle (x, y, radius) sees it."""

    image: NDArray[np.uint8]
    truth: NDArray[np.uint8]
    start: tuple[float, float, float]


def sights(kind: str, count: int) -> Iterator[Sight]:
    """That many looks at pictures of a kind, the same every time."""
    behind: list[Array] = []
    number = found = 0
    while found < count:
        rng = np.random.default_rng([KINDS.index(kind), number])
        if kind == "thing" and number < 40:
            behind.append(picture("room" if number % 2 else "street", rng, [])[0])
        image, region = picture(kind, rng, behind)
        for sight in _seen(image, region, rng, kind):
            yield sight
            found += 1
            if found == count:
                return
        number += 1


def picture(kind: str, rng: np.random.Generator, behind: list[Array]) -> tuple[Array, Array]:
    """A picture and what is inside in it; ``behind`` are pictures that may be the background of a thing."""
    if kind == "thing":
        return thing(rng, behind)
    if kind == "mirror":
        camera = mirror(rng)
        scene = street(rng) if rng.random() < 0.25 else seen_from_the_middle(room(rng), rng)
        return photographed(_clear(scene), camera, rng, road=False)
    road = kind == "street"
    return photographed(_clear(street(rng) if road else room(rng)), perspective(rng, road=road), rng, road=road)


def clear_of(scene: Scene, foot: Array) -> Scene:
    """The scene with nothing where the camera stands, (3,) on the ground."""
    boxes = [box for box in scene.boxes if box.inner or box.distance(foot[None])[0] > CLEAR_OF_CAMERA]
    return replace(scene, boxes=boxes)


def _clear(scene: Scene) -> Scene:
    return clear_of(scene, np.zeros(3))


def seen_from_the_middle(scene: Scene, rng: np.random.Generator) -> Scene:
    """The room seen from about its middle."""
    walls = scene.boxes[0]
    foot = np.array([rng.uniform(-0.2, 0.2) * walls.size[0], *walls.foot[1:]])
    return replace(scene, boxes=[replace(walls, foot=foot), *scene.boxes[1:]])


def _seen(image: Array, region: Array, rng: np.random.Generator, kind: str) -> Iterator[Sight]:
    depth = cv2.distanceTransform(np.pad(region.astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    if depth.max() < 7:
        return
    parts = cv2.connectedComponents(region.astype(np.uint8), connectivity=4)[1]
    least, most = SHARES.get(kind, LEAST_MOST)
    height, width = region.shape
    for number in range(STARTS):
        deep = depth >= max(5.0, 0.35 * depth.max())
        if number == 0 and kind in ("room", "street"):  # at the robot's or the car's feet
            deep[: int(0.75 * height)] = False
            deep[:, abs(np.arange(width) - width / 2) >= width / 4] = False
        rows, columns = np.nonzero(deep)
        if len(rows) == 0:
            continue
        place = int(rng.integers(len(rows)))
        y, x = int(rows[place]), int(columns[place])
        own = parts == parts[y, x]
        truth = np.where(own, INSIDE, np.where(region, IGNORED, 0)).astype(np.uint8)
        if least < own.mean() < most:
            yield Sight(image, truth, (float(x), float(y), float(min(0.9 * depth[y, x], rng.uniform(*RADII)))))


def sheet(count: int) -> Array:
    """Some of each kind with truth and start, in rows."""
    rows = []
    for kind in KINDS:
        cells = []
        for sight in list(sights(kind, STARTS * count))[::STARTS]:
            cell = sight.image.copy()
            outline = cv2.findContours((sight.truth == INSIDE).astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[
                0
            ]
            cv2.drawContours(cell, outline, -1, (0, 255, 0), 1)
            x, y, radius = (round(value) for value in sight.start)
            cv2.circle(cell, (x, y), radius, (255, 0, 255), 1)
            gain = min(240 / cell.shape[1], 180 / cell.shape[0])
            cell = cv2.resize(cell, None, fx=gain, fy=gain, interpolation=cv2.INTER_AREA)[:180, :240]
            cells.append(np.pad(cell, ((0, 180 - cell.shape[0]), (0, 242 - cell.shape[1]), (0, 0))))
        rows.append(np.hstack(cells))
    return np.vstack(rows)


def main() -> int:
    """Write a sheet of pictures to look at."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sheet", type=Path, required=True, help="the image file to write")
    parser.add_argument("--count", type=int, default=6, help="pictures of each kind")
    options = parser.parse_args()
    write_bytes_atomic(options.sheet, encode_png(sheet(options.count), []))
    return 0


if __name__ == "__main__":
    sys.exit(main())
