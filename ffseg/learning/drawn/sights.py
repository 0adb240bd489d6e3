"""Drawn pictures with truth and start, by kind and number; ``python -m ffseg.learning.drawn.sights --sheet FILE``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.io.files import write_bytes_atomic
from ffseg.io.masks import encode_png
from ffseg.learning.drawn.cameras import CLEAR_OF_CAMERA, mirror, perspective, photographed
from ffseg.learning.drawn.figures import thing
from ffseg.learning.drawn.planes import COLONIES, FIELDS, NUCLEI, ORGANS, TISSUE, parted, specks
from ffseg.learning.drawn.rays import World
from ffseg.learning.drawn.rooms import corridor, room
from ffseg.learning.drawn.skins import AnyArray
from ffseg.learning.drawn.streets import street
from ffseg.metrics import IGNORED, INSIDE

Generator = np.random.Generator
Picture = tuple[AnyArray, AnyArray]
"""(H, W, 3) bytes, and the numbers of the things in it that may be asked for, 0 elsewhere, shape (H, W)."""

STARTS = 2
"""Of each picture."""
RADII = (4.0, 22.0)
"""px, of the starts."""
MIN_DEPTH = 7
"""px, of a thing that a start fits in."""


@dataclass(frozen=True, slots=True)
class PictureKind:
    """A kind of pictures.

    Attributes
    ----------
    shares : tuple of float
        Share of the picture that a truth takes; others are drawn again.
    afoot : bool
        The first start lies at the feet of a robot or a car.
    alike : bool
        Parts beside the one that is asked for are of the same thing, and doubtful.
    """

    draw: Callable[[Generator], Picture]
    shares: tuple[float, float] = (0.04, 0.9)
    afoot: bool = False
    alike: bool = False


def _ground(seen: tuple[AnyArray, AnyArray]) -> Picture:
    return seen[0], cv2.connectedComponents(seen[1].astype(np.uint8), connectivity=4)[1]


def _indoors(rng: Generator) -> Picture:
    return _ground(photographed(_clear(room(rng)), perspective(rng, road=False), rng, road=False))


def _corridor(rng: Generator) -> Picture:
    return _ground(photographed(_clear(corridor(rng)), perspective(rng, road=False), rng, road=False))


def _street(rng: Generator, *, dusk: bool = True) -> Picture:
    scene = _clear(street(rng, dusk=dusk))
    return _ground(photographed(scene, perspective(rng, road=True), rng, road=True))


def _mirror(rng: Generator) -> Picture:
    camera = mirror(rng)
    scene = street(rng) if rng.random() < 0.25 else seen_from_the_middle(room(rng), rng)
    return _ground(photographed(_clear(scene), camera, rng, road=False))


def _behind(rng: Generator) -> AnyArray:
    return (_indoors(rng) if rng.random() < 0.5 else _street(rng, dusk=False))[0]


KINDS: dict[str, PictureKind] = {
    "room": PictureKind(_indoors, afoot=True, alike=True),
    "corridor": PictureKind(_corridor, afoot=True, alike=True),
    "street": PictureKind(_street, afoot=True, alike=True),
    "mirror": PictureKind(_mirror, alike=True),
    "thing": PictureKind(lambda rng: _ground(thing(rng, _behind)), (0.03, 0.6), alike=True),
    "animal": PictureKind(lambda rng: _ground(thing(rng, None)), (0.03, 0.6), alike=True),
    "tissue": PictureKind(lambda rng: parted(rng, TISSUE), (0.004, 0.4)),
    "field": PictureKind(lambda rng: parted(rng, FIELDS), (0.02, 0.6)),
    "organ": PictureKind(lambda rng: parted(rng, ORGANS), (0.02, 0.6)),
    "nuclei": PictureKind(lambda rng: specks(rng, NUCLEI), (0.003, 0.5)),
    "colony": PictureKind(lambda rng: specks(rng, COLONIES), (0.003, 0.5)),
}


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """One look at a picture: its truth (255 inside, 128 doubtful) as a start circle (x, y, radius) sees it."""

    image: NDArray[np.uint8]
    truth: NDArray[np.uint8]
    start: tuple[float, float, float]

    def disc(self) -> NDArray[np.bool_]:
        """The pixels of the start circle."""
        x, y, radius = self.start
        rows, columns = np.ogrid[: self.truth.shape[0], : self.truth.shape[1]]
        inside: NDArray[np.bool_] = (rows - y) ** 2 + (columns - x) ** 2 <= radius**2
        return inside


def sights(name: str, count: int, first: int = 0) -> Iterator[Sight]:
    """That many looks at pictures of a kind from a number on, the same every time."""
    number, found = first, 0
    while found < count:
        rng = np.random.default_rng([*name.encode(), number])
        image, things = KINDS[name].draw(rng)
        for sight in _seen(image, things, rng, KINDS[name]):
            yield sight
            found += 1
            if found == count:
                return
        number += 1


def clear_of(scene: World, foot: AnyArray) -> World:
    """The scene with nothing where the camera stands, (3,) on the ground."""
    boxes = [box for box in scene.boxes if box.inner or box.distance(foot[None])[0] > CLEAR_OF_CAMERA]
    return replace(scene, boxes=boxes)


def _clear(scene: World) -> World:
    return clear_of(scene, np.zeros(3))


def seen_from_the_middle(scene: World, rng: Generator) -> World:
    """The room seen from about its middle."""
    walls = scene.boxes[0]
    foot = np.array([rng.uniform(-0.2, 0.2) * walls.size[0], *walls.foot[1:]])
    return replace(scene, boxes=[replace(walls, foot=foot), *scene.boxes[1:]])


def _seen(image: AnyArray, things: AnyArray, rng: Generator, kind: PictureKind) -> Iterator[Sight]:
    depth = _depth(things)
    if depth.max() < MIN_DEPTH:
        return
    least, most = kind.shares
    height, width = things.shape
    for number in range(STARTS):
        deep = depth >= max(MIN_DEPTH - 2, 0.35 * depth.max() if kind.alike else 0)
        if number == 0 and kind.afoot:
            deep[: int(0.75 * height)] = False
            deep[:, abs(np.arange(width) - width / 2) >= width / 4] = False
        rows, columns = np.nonzero(deep)
        if len(rows) == 0:
            continue
        place = int(rng.integers(len(rows)))
        y, x = int(rows[place]), int(columns[place])
        own = things == things[y, x]
        others = IGNORED if kind.alike else 0
        truth = np.where(own, INSIDE, np.where(things > 0, others, 0)).astype(np.uint8)
        if least < own.mean() < most:
            yield Sight(image, truth, (float(x), float(y), float(min(0.9 * depth[y, x], rng.uniform(*RADII)))))


def _depth(things: AnyArray) -> AnyArray:
    """Distance of each pixel of a thing to what is not of it, the border of the picture included."""
    inner = things > 0
    for axis in (0, 1):
        low, high = [slice(None)] * 2, [slice(None)] * 2
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        inner[tuple(low)] &= things[tuple(low)] == things[tuple(high)]
    return cv2.distanceTransform(np.pad(inner.astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]


def sheet(count: int) -> AnyArray:
    """Some of each kind with truth and start, in rows."""
    rows = []
    for kind in KINDS:
        cells = []
        for sight in list(sights(kind, STARTS * count))[::STARTS]:
            cell: AnyArray = sight.image.copy()
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
