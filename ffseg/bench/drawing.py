"""Random scenes of any size: one bright ground with islands, drawn from the same shapes whatever the resolution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Array, Image, Mask, Plane

WIDTH, HEIGHT = 800, 600
"""The plane the shapes are laid out in; an image of another width shows it scaled."""
START_RADIUS = 40.0
CLEAR = 90.0
"""Nothing lies nearer to the middle, where the contour starts."""
STRIP = 128
"""Rows drawn at a time, so that large images need little beside themselves."""
NOISE = 3.0
"""Grey levels, standard deviation."""

MAX_ITERATIONS = 1_000_000
"""Iterations: a large image takes as many as it needs."""

Shapes = tuple[Array, Array, Array]
"""Waves of the outline (amplitude, phase), islands (x, y, half axes, direction), walls (x0, y0, x1, y1, half width)."""


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """An image and the ground in it, which the disc of `start_radius` pixels round the middle is part of."""

    image: Image
    ground: Mask
    start_radius: float


def draw(seed: int, width: int = WIDTH, height: int = HEIGHT) -> Drawing:
    """Draw scene number `seed`; the same scene at every size, but for the noise."""
    rng = np.random.default_rng([seed, 404])
    shapes = _shapes(rng)
    image, ground = np.empty((height, width), np.uint8), np.empty((height, width), np.bool_)
    scale = width / WIDTH
    for first in range(0, height, STRIP):
        rows = slice(first, min(first + STRIP, height))
        x = (np.arange(width, dtype=np.float32) - (width - 1) / 2) / np.float32(scale)
        y = (np.arange(rows.start, rows.stop, dtype=np.float32) - (height - 1) / 2) / np.float32(scale)
        free = _free(shapes, x[None, :], y[:, None], scale)
        ground[rows] = free >= 0.5
        light = 60 + 100 * free + 0.02 * x[None, :] + rng.standard_normal(free.shape, dtype=np.float32) * NOISE
        image[rows] = np.clip(light + 0.5, 0, 255)
    return Drawing(image, ground, START_RADIUS * scale)


def _shapes(rng: np.random.Generator) -> Shapes:
    orders = np.arange(2, 9)
    waves = np.stack([rng.uniform(0, 0.3, orders.size) / orders, rng.uniform(0, 2 * np.pi, orders.size)], axis=1)
    count = int(rng.integers(5, 10))
    angle, away = rng.uniform(0, 2 * np.pi, count), rng.uniform(CLEAR + 40, 240, count)
    middle = np.stack([1.2 * away * np.cos(angle), away * np.sin(angle)], axis=1)
    islands = np.column_stack([middle, rng.uniform(8, 38, (count, 2)), rng.uniform(0, np.pi, count)])
    turn, near = rng.uniform(0, 2 * np.pi, 3), rng.uniform(150, 220, 3)
    ray = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    walls = np.column_stack([ray * near[:, None], ray * (near + 60)[:, None], rng.uniform(2, 4, 3)])
    return waves, islands, walls


def _free(shapes: Shapes, x: Plane, y: Plane, scale: float) -> Plane:
    """Share of each pixel that is ground, from distances to the borders in pixels."""
    waves, islands, walls = shapes
    away, angle = np.hypot(x, y * np.float32(1.2)), np.arctan2(y, x)
    radius = np.full_like(away, 300.0)
    for order, (amplitude, phase) in enumerate(waves, start=2):
        radius += np.float32(300.0 * amplitude) * np.cos(order * angle + np.float32(phase))
    inside = np.clip(radius, 110.0, 385.0) - away
    for island in islands:
        inside = np.minimum(inside, _beyond_island(island, x, y))
    for wall in walls:
        inside = np.minimum(inside, _beyond_wall(wall, x, y))
    share: Plane = np.clip(0.5 + inside * np.float32(scale), 0, 1)
    return share


def _beyond_island(island: Array, x: Plane, y: Plane) -> Plane:
    cx, cy, a, b, turn = (np.float32(value) for value in island)
    c, s = np.cos(turn), np.sin(turn)
    u, v = c * (x - cx) + s * (y - cy), c * (y - cy) - s * (x - cx)
    distance: Plane = (np.hypot(u / a, v / b) - 1) * min(a, b)
    return distance


def _beyond_wall(wall: Array, x: Plane, y: Plane) -> Plane:
    x0, y0, x1, y1, half = (np.float32(value) for value in wall)
    dx, dy = x1 - x0, y1 - y0
    along = np.clip(((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy), 0, 1)
    distance: Plane = np.hypot(x - x0 - along * dx, y - y0 - along * dy) - half
    return distance
