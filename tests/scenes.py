"""Random scenes with exact truth for stress tests: blobs, islands, rings, slits, shading and noise."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT = 400, 300
SUPERSAMPLE = 4
START = (200.0, 150.0)
START_RADIUS = 14.0
NARROWEST = 6.0
"""Pixels: passages of the truth at least this wide must be entered."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """An 8-bit grey image, the region connected to the start, and whether all its passages are wide."""

    image: NDArray[np.uint8]
    truth: NDArray[np.bool_]
    holes: int
    wide: bool


def scene(seed: int) -> Scene:
    """Draw scene number ``seed``."""
    rng = np.random.default_rng([seed, 77])
    free = np.zeros((HEIGHT * SUPERSAMPLE, WIDTH * SUPERSAMPLE), np.uint8)
    cv2.fillPoly(free, [_fine(_blob(rng))], 255)
    for _ in range(int(rng.integers(0, 9))):
        _island(free, rng)
    for _ in range(int(rng.integers(0, 5))):
        _slit(free, rng)
    cv2.circle(free, tuple(int(v) for v in _fine(np.array([START]))[0]), int(26 * SUPERSAMPLE), 255, -1)
    coverage = cv2.resize(free, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    truth = _component(coverage >= 128)
    return Scene(_shaded(coverage, rng), truth, _num_holes(truth), _is_wide(truth))


def _fine(points: NDArray[np.float64]) -> NDArray[np.int32]:
    return np.round((points + 0.5) * SUPERSAMPLE - 0.5).astype(np.int32)


def _blob(rng: np.random.Generator) -> NDArray[np.float64]:
    angle = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    radius = np.full_like(angle, rng.uniform(0.65, 0.8))
    for k in range(2, 8):
        radius += rng.uniform(0, 0.35 / k) * np.cos(k * angle + rng.uniform(0, 2 * np.pi))
    radius = np.clip(radius, 0.25, 0.96)
    return np.stack([200 + 190 * radius * np.cos(angle), 150 + 140 * radius * np.sin(angle)], axis=1)


def _island(free: NDArray[np.uint8], rng: np.random.Generator) -> None:
    center = tuple(int(v) for v in _fine(rng.uniform([40, 30], [360, 270])[None])[0])
    axes = tuple(int(v * SUPERSAMPLE) for v in rng.uniform(4, 22, 2))
    turn = float(rng.uniform(0, 180))
    kind = rng.integers(3)
    if kind == 0:
        cv2.ellipse(free, center, axes, turn, 0, 360, 0, -1)
    elif kind == 1:
        corners = cv2.boxPoints((center, (2.0 * axes[0], 2.0 * axes[1]), turn))
        cv2.fillPoly(free, [corners.astype(np.int32)], 0)
    else:
        cv2.circle(free, center, max(axes), 0, int(rng.uniform(4, 7) * SUPERSAMPLE))


def _slit(free: NDArray[np.uint8], rng: np.random.Generator) -> None:
    angle, length = rng.uniform(0, 2 * np.pi), rng.uniform(20, 90)
    start = np.array([200, 150]) + rng.uniform(50, 130) * np.array([np.cos(angle), np.sin(angle)])
    turn = angle + rng.uniform(-0.7, 0.7)
    end = start + length * np.array([np.cos(turn), np.sin(turn)])
    a, b = (tuple(int(v) for v in p) for p in _fine(np.stack([start, end])))
    cv2.line(free, a, b, 0, int(rng.uniform(4, 10) * SUPERSAMPLE))


def _component(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    _, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
    found: NDArray[np.bool_] = labels == labels[int(START[1]), int(START[0])]
    return found


def _num_holes(truth: NDArray[np.bool_]) -> int:
    outside = np.pad(~truth, 1, constant_values=True).astype(np.uint8)
    return int(cv2.connectedComponents(outside, connectivity=8)[0]) - 2


def _is_wide(truth: NDArray[np.bool_]) -> bool:
    """Does a disc of diameter NARROWEST, rolled from the start, reach all of the truth but slivers at corners?"""
    distance = cv2.distanceTransform(np.pad(truth, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    core = _component(distance > NARROWEST / 2)
    reached = cv2.distanceTransform((~core).astype(np.uint8), cv2.DIST_L2, 5) <= NARROWEST / 2 + 1
    missed = truth & ~reached
    few_missed = int(missed.sum()) <= 0.002 * int(truth.sum())
    return few_missed and _num_holes(core) == _num_holes(truth)


def _shaded(coverage: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    low, contrast = rng.uniform(30, 90), rng.uniform(60, 130)
    if rng.random() < 0.5:
        low, contrast = low + contrast, -contrast
    image = low + contrast * (coverage / 255.0)
    image *= 1 - rng.uniform(0, 0.4) * np.linspace(0, 1, WIDTH)[None]
    image = cv2.GaussianBlur(image, (0, 0), float(rng.uniform(0.4, 1.0)))
    image += rng.normal(0, rng.uniform(0, 10), image.shape)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)
