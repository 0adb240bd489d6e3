"""Streets: a road with paint, kerbs and pavements, houses, hedges, trees, cars."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ffseg.learning.drawn.rays import Box, World
from ffseg.learning.drawn.skins import AnyArray, Skin, colour, leaves, look_up, noise, patched, plain, tiled, tinted

Generator = np.random.Generator


def street(rng: Generator, *, dusk: bool = True) -> World:
    """A straight road; x runs ahead, the camera stands at the origin. At dusk streets are dark against the sky."""
    width, base = rng.uniform(4, 12), colour(rng, (0.15, 0.45), 0.08)
    aside = rng.uniform(-0.3, 0.3) * width
    boxes: list[Box] = []
    for side in (-1, 1):
        boxes += _side(rng, base, aside + side * width / 2, side)
    for _ in range(int(rng.integers(0, 4))):
        boxes += _tree(rng, aside + rng.choice([-1, 1]) * (width / 2 + rng.uniform(0.5, 4)))
    for _ in range(int(rng.integers(0, 4))):
        lane = aside + rng.choice([-1, 1]) * width / 4 + rng.normal(0, 0.3)
        boxes += _car(rng, base, np.array([rng.uniform(5, 35), lane, 0]))
    grey = np.exp(rng.uniform(np.log(0.5), np.log(8))) if dusk else rng.uniform(0.5, 1.3)
    return World(
        boxes=boxes,
        ground=_road(rng, base, width, aside),
        lamps=[],
        ambient=float(rng.uniform(0.4, 1)),
        gloss=float(rng.choice([0, rng.uniform(0.05, 0.4)], p=[0.7, 0.3])),
        occlusion=float(rng.uniform(0.2, 0.8)),
        sky=(grey * np.array([1, 1, 0.98]), grey * np.array([1, 0.85, 0.7])),
        sun=_sun(rng) if rng.random() < 0.45 else None,
    )


def _sun(rng: Generator) -> AnyArray:
    turn, up = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 1.2)
    return np.array([np.cos(turn) * np.cos(up), np.sin(turn) * np.cos(up), np.sin(up)])


@dataclass(frozen=True, slots=True)
class _Paint:
    """Paint of a road: (place across, half width, half period or 0) of lines, the rest by (x, y, half sizes)."""

    lines: list[tuple[float, float, float]]
    crossings: list[float]
    letters: AnyArray

    def covers(self, at: AnyArray) -> AnyArray:
        found = np.zeros(len(at), np.bool_)
        for across, half, period in self.lines:
            dashed = np.mod(at[:, 0], 2 * period) < period if period else True
            found |= (abs(at[:, 1] - across) < half) & dashed
        for ahead in self.crossings:
            found |= (abs(at[:, 0] - ahead) < 1.2) & (np.mod(at[:, 1], 1.0) < 0.5)
        for letter in self.letters:
            found |= (abs(at - letter[:2]) < letter[2:]).all(axis=1)
        return found


def _paint(rng: Generator, width: float, aside: float) -> _Paint:
    places = [0.0] if rng.random() < 0.85 else []
    if places and rng.random() < 0.5:
        places += [width / 2 - 0.3, 0.3 - width / 2]
    if places and rng.random() < 0.3:
        places += [width / 4, -width / 4]
    lines = [
        (aside + place, rng.uniform(0.05, 0.09), 0.0 if rng.random() < 0.4 else rng.uniform(2, 6)) for place in places
    ]
    low, high = [3, aside - width / 2, 0.3, 0.05], [15, aside + width / 2, 1.5, 0.12]
    crossings = [rng.uniform(2, 15)] if rng.random() < 0.2 else []
    return _Paint(lines, crossings, rng.uniform(low, high, (int(rng.integers(0, 5)), 4)))


def _road(rng: Generator, base: AnyArray, width: float, aside: float) -> Skin:
    """Asphalt with paint, repairs, dirt and the tracks of wheels."""
    asphalt, paint = plain(rng, base, abs(rng.normal(0, 0.06))), _paint(rng, width, aside)
    cover, white = rng.uniform(0.3, 1), colour(rng, (0.75, 1), 0.1 if rng.random() < 0.7 else 0.6)
    texture, dirt, tracks = noise(rng, 256, [4, 8, 32], 0.7), rng.uniform(0, 0.15), 0.12 * (rng.random() < 0.4)
    count = int(rng.choice([0, 0, 1, 2, 4]))
    repairs = rng.uniform([2, aside - width / 2, 0.2, 0.2], [25, aside + width / 2, 8, 1.5], (count, 4))
    tones = rng.uniform(0.7, 1.25, count)

    def skin(at: AnyArray, height: AnyArray) -> AnyArray:
        gain = 1 + dirt * look_up(texture, at, 12.0)
        gain = gain * (1 - tracks * np.exp(-(((abs(at[:, 1] - aside) - width / 4) / 0.5) ** 2)))
        for repair, tone in zip(repairs, tones, strict=True):
            gain = np.where((abs(at - repair[:2]) < repair[2:]).all(axis=1), gain * tone, gain)
        found = asphalt(at, height) * gain[:, None]
        share = (paint.covers(at) * cover * np.clip(0.8 + 0.3 * look_up(texture, at, 2.0), 0, 1))[:, None]
        return np.asarray(found * (1 - share) + white * share)

    return skin


def _side(rng: Generator, base: AnyArray, border: float, side: int) -> list[Box]:
    """Kerb, pavement, what stands on it and what borders it."""
    alike = rng.random() < 0.7
    tone = tinted(rng, base, (0.7, 1.6), 0.05) if alike else colour(rng, (0.2, 0.6), 0.2)
    kind = rng.choice(["grass", "slabs", "asphalt"], p=[0.25, 0.375, 0.375])
    pavement = {
        "grass": lambda: leaves(rng),
        "slabs": lambda: tiled(rng, tone),
        "asphalt": lambda: plain(rng, tone, 0.06),
    }[kind]()
    height, kerb, wide = rng.uniform(0.005, 0.15), rng.uniform(0.1, 0.2), rng.uniform(1, 4)
    stone = plain(rng, tone * (1 if rng.random() < 0.3 else rng.uniform(0.9, 1.5)), 0.05)
    found = [
        Box(np.array([20, border + side * kerb / 2, 0]), np.array([120, kerb, height]), 0.0, stone),
        Box(np.array([20, border + side * (kerb + wide / 2), 0]), np.array([120, wide, 0.98 * height]), 0.0, pavement),
    ]
    ahead, edge = -5.0, border + side * (kerb + wide)
    while ahead < 60:
        length = rng.uniform(3, 20)
        up, skin = _front(rng)
        found.append(
            Box(
                np.array([ahead + length / 2, edge + side * 3, 0]),
                np.array([length, 6 + rng.uniform(-0.6, 0.6), up]),
                0.0,
                skin,
            )
        )
        ahead += length
    for _ in range(int(rng.integers(0, 5))):
        if rng.random() < 0.5:
            found += _car(rng, base, np.array([rng.uniform(5, 40), border - side * rng.uniform(0.9, 1.3), 0]))
        else:
            size = np.array([0.4, 0.5, 1.75]) if rng.random() < 0.5 else np.array([0.12, 0.12, 4])
            place = np.array([rng.uniform(3, 30), border + side * rng.uniform(0.3, wide), height])
            found.append(Box(place, size, 0.0, plain(rng, colour(rng, (0.03, 0.6), 0.4))))
    return found


def _front(rng: Generator) -> tuple[float, Skin]:
    """What stands behind a pavement: its height and surface."""
    fronts: dict[str, Callable[[], tuple[float, Skin]]] = {
        "house": lambda: (rng.uniform(5, 15), patched(rng, (rng.uniform(1, 3), rng.uniform(1.5, 3.5)))),
        "hedge": lambda: (rng.uniform(0.8, 4), leaves(rng)),
        "wall": lambda: (rng.uniform(0.6, 2.2), tiled(rng)),
        "grass": lambda: (0.02, leaves(rng)),
    }
    return fronts[str(rng.choice(list(fronts), p=[0.55, 0.2, 0.15, 0.1]))]()


def _tree(rng: Generator, y: float) -> list[Box]:
    x, crown = rng.uniform(6, 40), rng.uniform(1.5, 5)
    return [
        Box(np.array([x, y, 0]), np.array([0.3, 0.3, 3]), 0.0, leaves(rng)),
        Box(np.array([x, y, 2.5]), np.full(3, crown), rng.uniform(0, 3), leaves(rng)),
    ]


def _car(rng: Generator, road: AnyArray, foot: AnyArray) -> list[Box]:
    """A car or a van: body, cabin, four wheels; two in five nearly have the road's colour."""
    tone = tinted(rng, road, (0.4, 1.3), 0.05) if rng.random() < 0.4 else colour(rng, (0.03, 0.9), 0.5)
    body, glass = plain(rng, tone, 0.01), plain(rng, colour(rng, (0.02, 0.2), 0.1), 0.05)
    tyre, length, width = plain(rng, np.full(3, 0.03), 0.0), rng.uniform(3.6, 4.8), rng.uniform(1.6, 1.9)
    van = rng.random() < 0.15
    found = [Box(foot + [0, 0, 0.2], np.array([length, width, 2.5 if van else 0.65]), 0.0, body)]
    if not van:
        found.append(Box(foot + [0.1, 0, 0.85], np.array([length * 0.55, width * 0.9, 0.55]), 0.0, glass))
    for x in (-0.32, 0.32):
        for side in (-1, 1):
            at = foot + [x * length, side * (width / 2 - 0.12), 0]
            found.append(Box(at, np.array([0.6, 0.22, 0.55]), 0.0, tyre))
    return found
