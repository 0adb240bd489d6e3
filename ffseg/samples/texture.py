"""Surfaces: mottling, grain and shading from integer hashes, the same on every machine."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Array, Image


def uniform(shape: tuple[int, int], seed: int) -> Array:
    """Independent values in [0, 1), one per lattice point (splitmix64 of the index)."""
    index = np.arange(shape[0] * shape[1], dtype=np.uint64) + np.uint64(seed * 1_000_003 + 1)
    bits = index * np.uint64(0x9E3779B97F4A7C15)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    bits ^= bits >> np.uint64(31)
    values: Array = (bits >> np.uint64(11)).astype(np.float64).reshape(shape) / 2.0**53
    return values


def grain(shape: tuple[int, int], deviation: float, seed: int) -> Array:
    """Bell-shaped noise: the sum of four uniform values, scaled to a standard deviation."""
    total: Array = sum((uniform(shape, seed + part) for part in range(4)), np.zeros(shape)) - 2.0
    return total * (deviation * math.sqrt(3.0))  # four uniform values have the variance 1/3


def mottling(shape: tuple[int, int], cell: int, depth: float, seed: int) -> Array:
    """Smooth patches about `cell` px wide, between -depth and depth."""
    rows, columns = shape[0] // cell + 2, shape[1] // cell + 2
    lattice = uniform((rows, columns), seed) * (2 * depth) - depth
    y, v = _cells(shape[0], cell)
    x, u = _cells(shape[1], cell)
    v = v[:, None]
    top = lattice[np.ix_(y, x)] * (1 - u) + lattice[np.ix_(y, x + 1)] * u
    bottom = lattice[np.ix_(y + 1, x)] * (1 - u) + lattice[np.ix_(y + 1, x + 1)] * u
    return np.asarray(top * (1 - v) + bottom * v)


def shading(shape: tuple[int, int], right: float, down: float) -> Array:
    """Brightness rising evenly by `right` from left to right and by `down` from top to bottom, 0 in the middle."""
    x = np.arange(shape[1]) / (shape[1] - 1) - 0.5
    y = np.arange(shape[0]) / (shape[0] - 1) - 0.5
    return np.asarray(x[None, :] * right + y[:, None] * down)


def softened(image: Array) -> Array:
    """Blur as a lens does: the kernel [1, 2, 1] / 4 along both axes; the border is repeated."""
    padded = np.pad(image, ((1, 1), (1, 1), *((0, 0),) * (image.ndim - 2)), mode="edge")
    rows = (padded[:-2] + 2 * padded[1:-1] + padded[2:]) / 4
    return np.asarray((rows[:, :-2] + 2 * rows[:, 1:-1] + rows[:, 2:]) / 4)


def to_bytes(image: Array) -> Image:
    """Round to 8 bits."""
    return np.clip(np.floor(image + 0.5), 0, 255).astype(np.uint8)


def _cells(length: int, cell: int) -> tuple[NDArray[np.int64], Array]:
    """Lattice index and smoothstep weight of each pixel along one axis."""
    at = np.arange(length)
    t = (at % cell) / cell
    return at // cell, t * t * (3 - 2 * t)
