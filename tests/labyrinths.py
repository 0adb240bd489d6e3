"""Narrow ground with exact truth: corridors, spirals, mazes, combs, trees and walls with a gap, at any angle."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

SIZE = 360
"""Pixels to a side of every scene."""
SUPERSAMPLE = 4
ROOM = 20.0
"""Radius of the room with the start circle, px."""
START_RADIUS = 11.0
WALL = 9.0
"""Thinnest wall, px: the edges on its two sides lie apart by more than the smoothing reaches."""
WHITE, BLACK = 210, 40

Lines = list[NDArray[np.float64]]


@dataclass(frozen=True, slots=True, eq=False)
class Labyrinth:
    """An 8-bit grey image, the free region that hangs together with the start, the start, and the kind by name."""

    image: NDArray[np.uint8]
    truth: NDArray[np.bool_]
    start: tuple[float, float]
    kind: str


@dataclass(frozen=True, slots=True)
class Plan:
    """What a scene is drawn from, but for the width: so that it can be drawn in several widths."""

    kind: str
    seed: int
    angle: float
    pitch: float

    def drawn(self, width: float) -> Labyrinth:
        """Draw the scene with passages of ``width`` pixels; the middle lines depend on ``pitch`` alone."""
        rng = np.random.default_rng([self.seed, 5])
        lines, start = _KINDS[self.kind](self.pitch, rng)
        return _draw(lines, start, width, self.angle, self.kind)


def plan(seed: int, width: float) -> Plan:
    """Plan number ``seed`` for passages up to ``width`` pixels."""
    rng = np.random.default_rng([seed, 9])
    kinds = sorted(_KINDS)
    return Plan(
        kinds[int(rng.integers(len(kinds)))], seed, float(rng.uniform(0, 90)), width + rng.uniform(WALL, 2 * WALL)
    )


def gap(width: float, angle: float, wall: float) -> Labyrinth:
    """Draw a disc with a wall of ``wall`` pixels round it, broken by a gap of ``width`` pixels, light beyond; truth: within."""
    center, radius = SIZE / 2, 60.0
    fine = _canvas(255)
    cv2.circle(fine, _fine(np.array([[center, center]]))[0], round((radius + wall) * SUPERSAMPLE), 0, -1)
    cv2.circle(fine, _fine(np.array([[center, center]]))[0], round(radius * SUPERSAMPLE), 255, -1)
    if width > 0:
        along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
        across = np.array([-along[1], along[0]]) * width / 2
        ends = center + np.stack([along * (radius - 20), along * (radius + wall + 20)])
        corners = np.stack([ends[0] + across, ends[1] + across, ends[1] - across, ends[0] - across])
        cv2.fillPoly(fine, [_fine(corners)], 255)
    coverage = cv2.resize(fine, (SIZE, SIZE), interpolation=cv2.INTER_AREA)
    yy, xx = np.mgrid[:SIZE, :SIZE]
    within = np.hypot(xx - center, yy - center) <= radius
    return Labyrinth(_grey(coverage), within, (center, center), "gap")


def passage(width: float, angle: float, room: float = 40.0) -> Labyrinth:
    """Draw a straight passage between two rooms of radius ``room`` with exact sides; the truth is all three."""
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    yy, xx = np.mgrid[:SIZE, :SIZE] - SIZE / 2.0
    on, off = xx * along[0] + yy * along[1], np.abs(yy * along[0] - xx * along[1])
    depth = np.where(np.abs(on) <= 110, width / 2 - off, -1.0)
    for end in (-110 * along, 110 * along):
        depth = np.maximum(depth, room - np.hypot(xx - end[0], yy - end[1]))
    coverage = np.round(255 * np.clip(depth + 0.5, 0, 1)).astype(np.uint8)
    x, y = SIZE / 2 - 110 * along
    return Labyrinth(_grey(coverage), depth >= 0, (float(x), float(y)), "passage")


def _straight(pitch: float, rng: np.random.Generator) -> tuple[Lines, NDArray[np.float64]]:
    return [np.array([[-130.0, 0.0], [130.0, 0.0]])], np.array([-130.0, 0.0])


def _bent(pitch: float, rng: np.random.Generator) -> tuple[Lines, NDArray[np.float64]]:
    x = np.linspace(-125, 125, int(rng.integers(4, 8)))
    y = rng.uniform(-70, 70, len(x))
    return [np.stack([x, y], axis=1)], np.array([x[0], y[0]])


def _spiral(pitch: float, rng: np.random.Generator) -> tuple[Lines, NDArray[np.float64]]:
    inner = 0.6 * pitch + ROOM * 0.2
    turns = max(1.0, (140.0 - inner) / pitch - 0.5)
    t = np.linspace(0, 2 * np.pi * turns, 400)
    radius = inner + pitch * t / (2 * np.pi)
    points = np.stack([radius * np.cos(t), radius * np.sin(t)], axis=1)
    out = points[-1] * (1 + 20.0 / radius[-1])
    return [np.vstack([points, out])], out


def _maze(pitch: float, rng: np.random.Generator) -> tuple[Lines, NDArray[np.float64]]:
    cells = max(2, int(200 // pitch))
    at = [(0, 0)]
    seen, lines = {(0, 0)}, []
    corner = np.full(2, -0.5 * (cells - 1) * pitch)
    while at:
        x, y = at[-1]
        steps = [(x + dx, y + dy) for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        open_steps = [s for s in steps if s not in seen and min(s) >= 0 and max(s) < cells]
        if not open_steps:
            at.pop()
            continue
        to = open_steps[int(rng.integers(len(open_steps)))]
        seen.add(to)
        lines.append(corner + pitch * np.array([[x, y], to], float))
        at.append(to)
    door = corner - np.array([0.0, ROOM + 12.0 + 0.5 * pitch])
    return [*lines, np.stack([corner, door])], door


def _comb(pitch: float, rng: np.random.Generator) -> tuple[Lines, NDArray[np.float64]]:
    teeth = int(240 // pitch)
    x = (np.arange(teeth) - 0.5 * (teeth - 1)) * pitch
    lean, start = rng.uniform(-0.5, 0.5), np.array([x[0] - 10 - ROOM, -60.0])
    lines = [np.stack([start, [x[-1], -60.0]])]
    lines += [np.array([[v, -60.0], [v + 100 * lean, 60.0]]) for v in x]
    return lines, start


def _tree(pitch: float, rng: np.random.Generator) -> tuple[Lines, NDArray[np.float64]]:
    lines: Lines = []
    twigs = [(np.array([0.0, -130.0]), 0.5 * np.pi, 90.0, 0)]
    while twigs:
        root, heading, length, depth = twigs.pop()
        tip = root + length * np.array([np.cos(heading), np.sin(heading)])
        lines.append(np.stack([root, tip]))
        if depth == 3 or length < 1.5 * pitch:
            continue
        for turn in (-rng.uniform(0.4, 0.9), rng.uniform(0.4, 0.9)):
            twigs.append((tip, heading + turn, length * rng.uniform(0.55, 0.8), depth + 1))
    return lines, np.array([0.0, -130.0])


_KINDS: dict[str, Callable[[float, np.random.Generator], tuple[Lines, NDArray[np.float64]]]] = {
    "bent": _bent,
    "comb": _comb,
    "maze": _maze,
    "spiral": _spiral,
    "straight": _straight,
    "tree": _tree,
}


def _draw(lines: Lines, start: NDArray[np.float64], width: float, angle: float, kind: str) -> Labyrinth:
    turn = np.radians(angle)
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    fine = _canvas(0)
    for line in lines:
        for a, b in _pieces(_fine(line @ rotation + SIZE / 2)):
            cv2.line(fine, a, b, 255, round(width * SUPERSAMPLE))  # up to a quarter of a pixel wider
    center = start @ rotation + SIZE / 2
    cv2.circle(fine, _fine(center[None])[0], round(max(ROOM, 0.5 * width) * SUPERSAMPLE), 255, -1)
    coverage = cv2.resize(fine, (SIZE, SIZE), interpolation=cv2.INTER_AREA)
    _, labels = cv2.connectedComponents((coverage >= 128).astype(np.uint8), connectivity=4)
    truth = labels == labels[round(center[1]), round(center[0])]
    return Labyrinth(_grey(coverage), truth, (float(center[0]), float(center[1])), kind)


def _pieces(points: NDArray[np.int32]) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    for a, b in zip(points[:-1].tolist(), points[1:].tolist(), strict=True):
        yield (a[0], a[1]), (b[0], b[1])


def _canvas(value: int) -> NDArray[np.uint8]:
    return np.full((SIZE * SUPERSAMPLE, SIZE * SUPERSAMPLE), value, np.uint8)


def _fine(points: NDArray[np.float64]) -> NDArray[np.int32]:
    return np.round((points + 0.5) * SUPERSAMPLE - 0.5).astype(np.int32)


def _grey(coverage: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.round(BLACK + (WHITE - BLACK) * (coverage / 255.0)).astype(np.uint8)
