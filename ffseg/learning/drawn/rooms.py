"""Rooms: walls, furniture along them and in the way, tables, lamps, patches of sun."""

from __future__ import annotations

import numpy as np

from ffseg.learning.drawn.rays import Box, Lamp, World
from ffseg.learning.drawn.skins import (
    AnyArray,
    Skin,
    colour,
    flooring,
    furniture,
    patched,
    plain,
    planked,
    skirted,
    tiled,
    tinted,
)

Generator = np.random.Generator


def room(rng: Generator) -> World:
    """A corridor or a hall; x runs ahead, the camera stands at the origin."""
    width = float(rng.choice([rng.uniform(1.6, 3.5), rng.uniform(3, 12)]))
    length, height, aside = rng.uniform(5, 25), rng.uniform(2.3, 5), rng.uniform(-0.35, 0.35) * width
    floor, base = flooring(rng)
    size = np.array([length, width, height])
    walls = Box(np.array([length * rng.uniform(0.3, 0.48), aside, -0.001]), size, 0.0, _wall(rng, base), inner=True)
    lamps = [
        Lamp(
            np.array([rng.uniform(0, 0.8) * length, aside + rng.uniform(-0.4, 0.4) * width, height - 0.1]),
            float(rng.uniform(0.2, 2)),
            float(rng.choice([2.5, rng.uniform(0, 1.5)])),
        )
        for _ in range(int(rng.integers(1, 4)))
    ]
    return World(
        boxes=[walls, *_along(rng, base, size, aside), *_in_the_way(rng, base), *_tables(rng, base)],
        ground=floor,
        lamps=lamps,
        ambient=float(rng.uniform(0.25, 1)),
        gloss=float(rng.choice([0, rng.uniform(0.1, 0.6), rng.uniform(0.5, 1)], p=[0.4, 0.35, 0.25])),
        occlusion=float(rng.uniform(0, 0.7)),
        sky=(np.full(3, 0.8), np.full(3, 0.9)),
        patches=_sun_patches(rng, width) if rng.random() < 0.3 else [],
    )


def corridor(rng: Generator) -> World:
    """A long room with a glossy floor, lamps in a row under its ceiling, and what stands along its walls."""
    wide, high, long = rng.uniform(1.8, 5), rng.uniform(2.3, 4), rng.uniform(15, 50)
    aside = rng.uniform(-0.3, 0.3) * wide
    base = colour(rng, (0.2, 0.85), 0.15)
    ground = (tiled, plain, planked)[int(rng.choice(3, p=[0.6, 0.3, 0.1]))]
    size = np.array([long, wide, high])
    base_wall = base if rng.random() < 0.5 else colour(rng, (0.6, 1), 0.05)
    walls = Box(np.array([0.45 * long, aside, -0.001]), size, 0.0, _wall(rng, base_wall), inner=True)
    apart, bright = rng.uniform(1.5, 4), plain(rng, np.full(3, rng.uniform(3, 12)), 0.0)
    places = [np.array([ahead, aside, high]) for ahead in np.arange(rng.uniform(0.3, 2), 0.8 * long, apart)]
    tubes = [Box(at - [0, 0, 0.06], np.array([rng.uniform(0.3, 1.2), 0.15, 0.05]), 0.0, bright) for at in places]
    return World(
        boxes=[walls, *tubes, *_along(rng, base, size, aside), *(_in_the_way(rng, base) if rng.random() < 0.4 else [])],
        ground=ground(rng, base),
        lamps=[Lamp(at - [0, 0, 0.1], float(rng.uniform(0.3, 1)), 2.5) for at in places[:4]],
        ambient=float(rng.uniform(0.3, 1)),
        gloss=float(rng.uniform(0.3, 1)),
        occlusion=float(rng.uniform(0, 0.7)),
        sky=(np.full(3, 0.8), np.full(3, 0.9)),
    )


def _wall(rng: Generator, ground: AnyArray) -> Skin:
    alike = rng.random() < 0.4
    base = tinted(rng, ground, (0.8, 1.4), 0.03) if alike else colour(rng, (0.2, 0.95), 0.15)
    kind = rng.choice(["plain", "tiled", "patched"], p=[0.65, 0.2, 0.15])
    if kind == "patched":
        wall = patched(rng)
    else:
        wall = tiled(rng, base) if kind == "tiled" else plain(rng, base, abs(rng.normal(0, 0.02)))
    return skirted(rng, wall, ground) if rng.random() < 0.6 else wall


def _along(rng: Generator, ground: AnyArray, room_size: AnyArray, aside: float) -> list[Box]:
    found = []
    for _ in range(int(rng.integers(0, 10))):
        size = rng.uniform([0.2, 0.2, 0.2], [3, 0.8, 2.4])
        ahead = rng.uniform(0.5, room_size[0] * 0.75)
        y = aside + rng.choice([-1, 1]) * (room_size[1] - size[1]) / 2
        if abs(y) - size[1] / 2 < 0.45 and ahead < 2:
            continue  # the camera stands there
        found.append(Box(np.array([ahead + size[0] / 2, y, 0]), size, 0.0, furniture(rng, ground)))
    return found


def _in_the_way(rng: Generator, ground: AnyArray) -> list[Box]:
    found = []
    for _ in range(int(rng.integers(0, 8))):
        away, turn = rng.uniform(1.3, 8), rng.uniform(-0.9, 0.9)
        foot = np.array([away * np.cos(turn), away * np.sin(turn), 0])
        size = rng.uniform([0.08, 0.08, 0.05], [1, 1, 1.4])
        found.append(Box(foot, size, rng.uniform(0, np.pi), furniture(rng, ground)))
    return found


def _tables(rng: Generator, ground: AnyArray) -> list[Box]:
    """Tables and chairs: thin legs under a board."""
    found = []
    for _ in range(int(rng.integers(1, 4)) if rng.random() < 0.4 else 0):
        middle, size, turn = rng.uniform([1.2, -2], [6, 2]), rng.uniform(0.3, 0.8, 2), rng.uniform(0, np.pi)
        leg, height, skin = rng.uniform(0.02, 0.06), rng.uniform(0.4, 0.8), furniture(rng, ground)
        c, s = np.cos(turn), np.sin(turn)
        for corner in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            x, y = size * corner / 2
            foot = np.append(middle + [x * c - y * s, x * s + y * c], 0)
            found.append(Box(foot, np.array([leg, leg, height]), turn, skin))
        found.append(Box(np.append(middle, height), np.append(size + leg, 0.03), turn, skin))
    return found


def _sun_patches(rng: Generator, width: float) -> list[tuple[AnyArray, AnyArray, float]]:
    """What a row of windows throws on the floor."""
    first, turn = np.array([rng.uniform(0.5, 6), rng.uniform(-0.4, 0.4) * width]), rng.uniform(0, np.pi)
    reach, power = rng.uniform(0.3, 1.2, 2), float(rng.uniform(0.5, 2.5))
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    shear = np.array([[1, rng.normal(0, 0.4)], [0, 1]])
    return [
        (first + axes @ [2.3 * number * reach[0], 0], axes @ shear @ np.diag(1 / reach), power)
        for number in range(int(rng.integers(1, 4)))
    ]
