"""Things made of parts, painted over backgrounds: animals, people, vehicles, tools, pebbles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy

import cv2
import numpy as np

from ffseg.learning.drawn.cameras import MAX_SIDE, developed
from ffseg.learning.drawn.skins import AnyArray, colour, noise, tinted

Generator = np.random.Generator
Part = tuple[AnyArray, int]
"""Signed distance to a part, negative inside, shape (H, W); parts of one number look alike."""

TEXTURE = 512


class Canvas:
    """Shapes as signed distances on a grid of pixels."""

    def __init__(self, height: int, width: int) -> None:
        y, x = np.mgrid[:height, :width]
        self.shape, self.at = (height, width), np.stack([x, y], -1).astype(np.float32)

    def near(self, middle: AnyArray, reach: float) -> tuple[tuple[slice, slice], Canvas]:
        """The part of the canvas within so far of a point, along each axis, and where it lies."""
        rows, columns = (
            slice(*np.clip([int(at - reach), int(at + reach) + 2], 0, size).tolist())
            for at, size in zip(middle[::-1], self.shape, strict=True)
        )
        part = copy(self)
        part.at = self.at[rows, columns]
        part.shape = part.at.shape[:2]
        return (rows, columns), part

    def capsule(self, ends: tuple[AnyArray, AnyArray], radii: tuple[float, float]) -> AnyArray:
        """A limb: between two points, from one radius to the other."""
        way = ends[1] - ends[0]
        part = np.clip((self.at - ends[0]) @ way / max(float(way @ way), 1e-3), 0, 1)
        away = np.linalg.norm(self.at - ends[0] - part[..., None] * way, axis=2)
        return np.asarray(away - radii[0] - (radii[1] - radii[0]) * part)

    def ellipse(self, middle: AnyArray, axes: tuple[float, float], turn: float = 0.0) -> AnyArray:
        """About the distance to an ellipse."""
        c, s = np.cos(turn), np.sin(turn)
        own = (self.at - middle) @ np.array([[c, -s], [s, c]]) / axes
        return np.asarray((np.linalg.norm(own, axis=2) - 1) * min(axes))

    def polygon(self, corners: AnyArray) -> AnyArray:
        """Distance to a polygon, to a pixel."""
        inside = np.zeros(self.shape, np.uint8)
        cv2.fillPoly(inside, [np.rint(corners).astype(np.int32)], 1)
        return np.asarray(
            cv2.distanceTransform(1 - inside, cv2.DIST_L2, 3) - cv2.distanceTransform(inside, cv2.DIST_L2, 3)
        )


def _animal(on: Canvas, rng: Generator, middle: AnyArray, size: float) -> Iterator[Part]:
    lean, side = rng.normal(0, 0.25), rng.choice([-1, 1])
    axis, long, thick = (
        np.array([np.cos(lean), np.sin(lean)]),
        size * rng.uniform(0.28, 0.42),
        size * rng.uniform(0.12, 0.22),
    )
    yield on.ellipse(middle, (long, thick), lean), 0
    if rng.random() < 0.4:
        yield on.ellipse(middle + [0, thick / 2], (0.7 * long, thick / 2), lean), 3  # the belly
    for _ in range(int(rng.integers(2, 5))):
        hip = middle + axis * long * rng.uniform(-0.8, 0.8) + [0, thick / 2]
        foot = hip + [rng.normal(0, 0.1) * size, size * rng.uniform(0.15, 0.4)]
        knee, wide, skin = (
            (hip + foot) / 2 + [rng.normal(0, 0.05) * size, 0],
            size * rng.uniform(0.02, 0.05),
            int(rng.random() < 0.3),
        )
        yield on.capsule((hip, knee), (1.5 * wide, wide)), skin
        yield on.capsule((knee, foot), (wide, 0.7 * wide)), skin
    neck = middle + side * axis * long * 0.85
    head = neck + [side * size * rng.uniform(0.05, 0.2), -size * rng.uniform(-0.05, 0.25)]
    yield on.capsule((neck, head), (0.08 * size, 0.05 * size)), 0
    axes = (size * rng.uniform(0.06, 0.12), size * rng.uniform(0.05, 0.08))
    yield on.ellipse(head, axes, rng.normal(0, 0.6)), 0 if rng.random() < 0.7 else 2
    for _ in range(int(rng.integers(0, 3))):
        yield on.capsule((head, head + rng.normal(0, 0.08, 2) * size - [0, 0.05 * size]), (0.02 * size, 0.01 * size)), 1
    if rng.random() < 0.7:
        tail = middle - side * axis * long * 0.9
        yield (
            on.capsule(
                (tail, tail - side * axis * long * 0.4 + rng.normal(0, 0.15, 2) * size), (0.03 * size, 0.01 * size)
            ),
            0,
        )


def _person(on: Canvas, rng: Generator, hip: AnyArray, size: float) -> Iterator[Part]:
    unit, lean = size / 2, rng.normal(0, 0.15)
    up, wide = np.array([np.sin(lean), -np.cos(lean)]), unit * rng.uniform(0.13, 0.2)
    side, neck = np.array([up[1], -up[0]]), hip + up * unit * 0.55
    for hand in (-1, 1):
        knee = hip + side * hand * wide * 0.6 - up * unit * 0.42 + rng.normal(0, 0.08, 2) * unit
        foot = knee - up * unit * 0.42 + rng.normal(0, 0.1, 2) * unit
        yield on.capsule((hip + side * hand * wide / 2, knee), (0.55 * wide, 0.4 * wide)), 1
        yield on.capsule((knee, foot), (0.4 * wide, 0.25 * wide)), 1 if rng.random() < 0.7 else 2
    if rng.random() < 0.25:  # a skirt
        low = hip - up * unit / 2
        yield (
            on.polygon(np.array([hip + side * wide, hip - side * wide, low - 2 * side * wide, low + 2 * side * wide])),
            1,
        )
    yield on.capsule((hip, neck), (0.9 * wide, 1.05 * wide)), 0
    for hand in (-1, 1):
        elbow = neck + side * hand * wide * 1.2 + rng.normal(0, 0.15, 2) * unit - up * unit * 0.2
        sleeve = 0 if rng.random() < 0.6 else 2
        yield on.capsule((neck + side * hand * wide, elbow), (0.4 * wide, 0.32 * wide)), sleeve
        yield on.capsule((elbow, elbow + rng.normal(0, 0.22, 2) * unit), (0.32 * wide, 0.22 * wide)), 2
    head = neck + up * unit * 0.26
    yield on.capsule((neck, head), (0.4 * wide, 0.4 * wide)), 2
    yield on.ellipse(head, (0.11 * unit, 0.14 * unit), lean), 2
    if rng.random() < 0.8:
        yield on.ellipse(head + up * unit * 0.06, (0.12 * unit, 0.1 * unit), lean), 3  # hair or a hat


def _vehicle(on: Canvas, rng: Generator, middle: AnyArray, size: float) -> Iterator[Part]:
    scale, lean = np.array([0.45 * size, size * rng.uniform(0.12, 0.2)]), rng.normal(0, 0.2)
    c, s = np.cos(lean), np.sin(lean)

    def placed(corners: list[tuple[float, float]], gain: float = 1.0) -> AnyArray:
        return np.asarray(middle + gain * np.array(corners) * scale @ np.array([[c, s], [-s, c]]))

    body = placed([(-1, 0.5), (-1, -0.3), (-0.6, -0.5), (0.6, -0.5), (1, -0.1), (1, 0.5)])
    yield on.polygon(body + rng.normal(0, 0.02 * size, (6, 2))), 0
    cabin = [(-0.6, -0.4), (-0.4, -1.2), (0.2, -1.2), (0.5, -0.4)]
    yield on.polygon(placed(cabin)), int(rng.random() < 0.5)
    yield on.polygon(placed(cabin, 0.75)), 1
    for x in (-0.6, 0.6):
        yield on.ellipse(placed([(x, 0.5)])[0], (0.45 * scale[1], 0.45 * scale[1])), 2
    if rng.random() < 0.5:
        yield on.polygon(placed([(-0.9, -0.05), (0.9, -0.05), (0.9, 0.15), (-0.9, 0.15)])), 3
    if rng.random() < 0.3:
        yield on.polygon(placed([(-1.1, -2), (-0.7, -2), (0.3, 0.4), (-0.3, 0.6)])), 0  # a wing


def _tool(on: Canvas, rng: Generator, middle: AnyArray, size: float) -> Iterator[Part]:
    turn = rng.uniform(0, np.pi)
    reach = np.array([np.cos(turn), np.sin(turn)]) * size * 0.4
    yield (
        on.capsule((middle - reach, middle + reach), (size * rng.uniform(0.03, 0.09), size * rng.uniform(0.03, 0.09))),
        0,
    )
    axes = (size * rng.uniform(0.1, 0.25), size * rng.uniform(0.08, 0.16))
    yield on.ellipse(middle + reach, axes, rng.uniform(0, 3)), int(rng.random() < 0.5)


def _pebbles(on: Canvas, rng: Generator, middle: AnyArray, size: float) -> Iterator[Part]:
    axes = (size * rng.uniform(0.2, 0.35), size * rng.uniform(0.15, 0.3))
    yield on.ellipse(middle, axes, rng.uniform(0, 3)), 0
    for _ in range(int(rng.integers(0, 5))):
        axes = (size * rng.uniform(0.05, 0.2), size * rng.uniform(0.05, 0.2))
        yield on.ellipse(middle + rng.normal(0, 0.2, 2) * size, axes, rng.uniform(0, 3)), int(rng.integers(0, 3))


def _leaf(on: Canvas, rng: Generator, middle: AnyArray, size: float) -> Iterator[Part]:
    turn, lobes, slim = rng.uniform(0, 2 * np.pi), int(rng.integers(1, 8)), rng.uniform(0.3, 0.9)
    around = np.linspace(0, 2 * np.pi, 160, endpoint=False)
    radius = 0.4 * size * (1 + rng.uniform(0, 0.3) * abs(np.sin(lobes * around / 2)) + 0.03 * np.sin(40 * around))
    outline = np.stack([np.cos(around), slim * np.sin(around)], 1) * radius[:, None]
    along = np.array([np.cos(turn), np.sin(turn)])
    yield on.polygon(middle + outline @ np.array([along, [-along[1], along[0]]])), 0
    vein = size * rng.uniform(0.002, 0.012)
    ends = middle - 0.38 * size * along, middle + 0.38 * size * along
    yield on.capsule(ends, (vein, vein)), 1


FIGURES: dict[str, tuple[Callable[[Canvas, Generator, AnyArray, float], Iterator[Part]], float]] = {
    "animal": (_animal, 0.3),
    "person": (_person, 0.2),
    "vehicle": (_vehicle, 0.15),
    "tool": (_tool, 0.1),
    "pebbles": (_pebbles, 0.15),
    "leaf": (_leaf, 0.1),
}
"""Figures and how often they are drawn."""


def figure(on: Canvas, rng: Generator, middle: AnyArray, size: float) -> list[Part]:
    """Parts of some thing, from the back to the front."""
    names, shares = zip(*((name, share) for name, (_, share) in FIGURES.items()), strict=True)
    return list(FIGURES[str(rng.choice(names, p=shares))][0](on, rng, middle, size))


def painted(image: AnyArray, parts: list[Part], rng: Generator, light: AnyArray) -> AnyArray:
    """Paint a figure over an image, in place; where it is, (H, W) bool."""
    height, width = image.shape[:2]
    ragged = noise(rng, TEXTURE, [24, 64], 0.6)[:height, :width] * rng.uniform(0, 1.6)
    camouflaged = rng.random() < 0.2
    base = tinted(rng, image.mean((0, 1)), (0.6, 1.5), 0.1) if camouflaged else colour(rng, (0.05, 0.9), 0.35)
    skins: dict[int, AnyArray] = {}
    covered = np.zeros((height, width), np.bool_)
    for smooth, number in parts:
        if number not in skins:
            other = base * rng.uniform(0.6, 1.5) if rng.random() < 0.35 else colour(rng, (0.03, 0.95), 0.4)
            skins[number] = pelt(rng, base if number == 0 else other, (height, width))
        distance = smooth + ragged
        height_map = cv2.GaussianBlur(np.sqrt(np.clip(-distance, 0, None) + 0.2).astype(np.float32), (0, 0), 1.2)
        down, right = np.gradient(height_map)
        facing = (0.6 * light[2] - right * light[0] - down * light[1]) / np.sqrt(right**2 + down**2 + 0.36)
        cover = np.clip(0.5 - distance, 0, 1)[..., None]
        image[:] = image * (1 - cover) + cover * skins[number] * (0.45 + 0.75 * np.clip(facing, 0, 1))[..., None]
        covered |= distance < 0
    return covered


def pelt(rng: Generator, base: AnyArray, shape: tuple[int, int]) -> AnyArray:
    """A texture over a whole canvas: plain, fur, stripes, spots, checks, two colours."""
    height, width = shape
    kind = rng.choice(["plain", "fur", "stripes", "spots", "checks", "two"], p=[0.4, 0.25, 0.12, 0.1, 0.05, 0.08])
    waves = [int(rng.integers(2, 6)), 16, 64, 128]
    grain = noise(rng, TEXTURE, waves, float(rng.uniform(0.5, 0.95)))[:height, :width]
    gain = 1 + rng.uniform(0.01, 0.08) * grain
    if kind == "fur":
        gain = gain * (1 + rng.uniform(0.05, 0.35) * noise(rng, TEXTURE, [32, 64, 128, 256], 0.95)[:height, :width])
    found, other = base * gain[..., None], colour(rng, (0.03, 0.95), 0.4) * (1 + 0.05 * grain)[..., None]
    y, x = np.mgrid[:height, :width]
    turn, period = rng.uniform(0, np.pi), rng.uniform(4, 25)
    along, across = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    if kind == "stripes":
        found = np.where((np.mod(along + 3 * grain, period) < period * rng.uniform(0.2, 0.6))[..., None], other, found)
    elif kind == "spots":
        spots = noise(rng, TEXTURE, [int(rng.integers(8, 40))])[:height, :width] > rng.uniform(0.6, 1.6)
        found = np.where(spots[..., None], other, found)
    elif kind == "checks":
        even = (np.floor(along / period) + np.floor(across / period)) % 2 == 0
        found = np.where(even[..., None], other, found)
    elif kind == "two":
        found = np.where((along - along.mean() + 8 * grain > rng.normal(0, 0.15 * max(shape)))[..., None], other, found)
    return np.clip(found, 0.005, 1.2)


Behind = Callable[[Generator], AnyArray]


def background(rng: Generator, shape: tuple[int, int], behind: Behind | None) -> AnyArray:
    """Land in bands, leaves, blurred shapes, or a part of such a picture as `behind` draws; sometimes out of focus.

    Without `behind`: grass and leaves.
    """
    kind = str(rng.choice(["bands", "place", "leaves", "shapes"], p=[0.4, 0.25, 0.2, 0.15]))
    if behind is None:
        found = (_meadow if rng.random() < 0.7 else _foliage)(rng, shape)
    elif kind == "place":
        found = _cut(rng, shape, behind(rng))
    else:
        found = {"bands": _bands, "leaves": _foliage, "shapes": _shapes}[kind](rng, shape)
    blur = float(rng.choice([0, rng.uniform(0.7, 5)]))
    found = np.clip(found, 0, 1.5).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(found, (0, 0), blur)) if blur else found


def _cut(rng: Generator, shape: tuple[int, int], picture: AnyArray) -> AnyArray:
    gain = max(shape[0] / picture.shape[0], shape[1] / picture.shape[1]) * rng.uniform(1.01, 1.6)
    large = cv2.resize(picture, None, fx=gain, fy=gain)
    top, left = (int(rng.integers(large.shape[axis] - shape[axis] + 1)) for axis in (0, 1))
    part = large[top : top + shape[0], left : left + shape[1]]
    return np.asarray((part[:, ::-1] if rng.random() < 0.5 else part) / 255.0) ** 2.2


def _bands(rng: Generator, shape: tuple[int, int]) -> AnyArray:
    height, width = shape
    found, (y, x) = pelt(rng, colour(rng, (0.2, 0.95), 0.3), shape), np.mgrid[:height, :width]
    for number in range(int(rng.integers(1, 4))):
        line = height * (0.25 + 0.25 * number + rng.normal(0, 0.08)) + 3 * noise(rng, TEXTURE, [30])[0, :width]
        line = line + rng.uniform(0, 25) * np.sin(x[0] / rng.uniform(20, 120) + rng.uniform(0, 6))
        rough = 1 + rng.uniform(0, 0.3) * noise(rng, TEXTURE, [32, 64, 128], 0.9)[:height, :width]
        band = pelt(rng, colour(rng, (0.08, 0.8), 0.35), shape) * rough[..., None]
        found = np.where((y > line)[..., None], band, found)
    return found


def _meadow(rng: Generator, shape: tuple[int, int]) -> AnyArray:
    """Grass, finer to the back, often under something darker or lighter from some height on."""
    height, width = shape
    green = colour(rng, (0.1, 0.6), 0.3) * np.array([0.6, 1.0, 0.8])
    fine = noise(rng, TEXTURE, [64, 128, 256], 0.95)[:height, :width]
    large = noise(rng, TEXTURE, [4, 8, 16, 32], 0.7)[:height, :width]
    blades = np.clip(1 + rng.uniform(0.05, 0.4) * fine + rng.uniform(0, 0.3) * large, 0.05, 3)
    found = green * blades[..., None] * (1 + rng.uniform(0, 0.2) * large[::-1, ::-1, None] * rng.normal(0, 1, 3))
    if rng.random() < 0.6:
        line = height * rng.uniform(0.05, 0.5) + 4 * noise(rng, TEXTURE, [16, 40])[0, :width]
        above = _foliage(rng, shape) if rng.random() < 0.6 else pelt(rng, colour(rng, (0.3, 0.95), 0.2), shape)
        found = np.where((np.arange(height)[:, None] > line)[..., None], found, above)
    return np.asarray(found)


def _foliage(rng: Generator, shape: tuple[int, int]) -> AnyArray:
    height, width = shape
    fine = noise(rng, TEXTURE, [8, 32, 64, 128, 256], 0.95)[:height, :width]
    found = colour(rng, (0.1, 0.6), 0.35) * np.clip(1 + rng.uniform(0.2, 0.7) * fine, 0.05, 3)[..., None]
    gaps = noise(rng, TEXTURE, [6, 16, 40], 0.7)[:height, :width] > rng.uniform(0.2, 1)
    other = np.clip(1 + 0.3 * noise(rng, TEXTURE, [64, 128], 0.9)[:height, :width], 0.05, 3)
    return np.where(gaps[..., None], colour(rng, (0.05, 0.8), 0.4) * other[..., None], found)


def _shapes(rng: Generator, shape: tuple[int, int]) -> AnyArray:
    found = np.zeros((*shape, 3), np.float32) + colour(rng)
    for _ in range(int(rng.integers(5, 30))):
        middle = (int(rng.integers(shape[1])), int(rng.integers(shape[0])))
        axes = (int(rng.integers(5, 90)), int(rng.integers(5, 90)))
        tone = [float(part) for part in colour(rng, (0.03, 0.95), 0.5)]
        cv2.ellipse(found, middle, axes, float(rng.uniform(0, 180)), 0, 360, tone, -1)
    return found


def thing(rng: Generator, behind: Behind | None) -> tuple[AnyArray, AnyArray]:
    """A picture of one thing among others, (H, W, 3) bytes, and where it is; `behind` as `background` takes it."""
    width = int(rng.integers(200, MAX_SIDE))
    height = int(width * rng.choice([0.667, 0.75, 1, 1.5]))
    if height > MAX_SIDE:
        width, height = int(width * MAX_SIDE / height), MAX_SIDE
    on, image = Canvas(height, width), background(rng, (height, width), behind)
    light = np.array([rng.normal(0, 1), rng.normal(-0.8, 0.5), rng.uniform(0.5, 1.5)])
    light /= np.linalg.norm(light)
    size = min(height, width) * rng.uniform(0.5, 1.3)
    for _ in range(int(rng.integers(0, 3))):
        place = rng.uniform([0, 0], [width, height])
        painted(image, figure(on, rng, place, size * rng.uniform(0.4, 1)), rng, light)
    parts = figure(on, rng, rng.uniform([0.35, 0.35], [0.65, 0.65]) * [width, height], size)
    if rng.random() < 0.5:
        image *= _shadow(rng, parts, size)[..., None]
    covered = painted(image, parts, rng, light)
    image = image * (1 + rng.normal(0, 0.05, 3)) / (image.mean() + 1e-3) * rng.uniform(0.12, 0.4)
    return developed(image, rng), covered


def _shadow(rng: Generator, parts: list[Part], size: float) -> AnyArray:
    """What a figure leaves of the light on the ground behind it."""
    solid = np.max([np.clip(0.5 - distance, 0, 1) for distance, _ in parts], axis=0).astype(np.float32)
    height, width = solid.shape
    cast = np.array(
        [[1, 0, rng.normal(0, 0.1) * size], [0, 0.6, height * 0.25 + rng.uniform(0, 0.1) * size]], np.float32
    )
    soft = cv2.GaussianBlur(cv2.warpAffine(solid, cast, (width, height)), (0, 0), float(rng.uniform(2, 10)))
    return np.asarray(1 - rng.uniform(0.2, 0.7) * soft)
