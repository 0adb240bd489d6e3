"""Noise that is fixed to a surface and fades where a pixel covers more of it than a wave."""

from __future__ import annotations

import numpy as np

from ffseg.arrays import Array, Plane

LATTICE = 256
"""Nodes per side of the periodic lattice: at the finest octave (2 cm) it repeats after 5 m."""


class Noise:
    """Sum of octaves of smooth value noise on a plane.

    Parameters
    ----------
    octaves : tuple of (wavelength in metres, amplitude in grey levels)
    """

    def __init__(self, seed: list[int], octaves: tuple[tuple[float, float], ...]) -> None:
        random = np.random.default_rng(seed)
        self._octaves = octaves
        self._nodes = [random.uniform(-1, 1, (LATTICE, LATTICE)).astype(np.float32) for _ in octaves]
        self._offsets = random.uniform(0, LATTICE, (len(octaves), 2))

    def __call__(self, points: Array, footprint: Array) -> Array:
        """Grey levels to add at points, shape (n, 2), metres, each seen by a pixel ``footprint`` metres wide."""
        total, columns = np.zeros(len(points)), np.ascontiguousarray(points.T)
        for (wavelength, amplitude), nodes, offset in zip(self._octaves, self._nodes, self._offsets, strict=True):
            fade = amplitude / (1.0 + (1.5 * footprint / wavelength) ** 4)
            total += fade * _value(nodes, columns / wavelength + offset[:, None])
        return total


def _value(nodes: Plane, at: Array) -> Array:
    """Value noise: smoothstep between the four lattice nodes; `at` has shape (2, n)."""
    low = np.floor(at)
    part = at - low
    u, v = part * part * (3.0 - 2.0 * part)
    x, y = low.astype(np.int64) & (LATTICE - 1)
    x1, row, below = (x + 1) & (LATTICE - 1), y * LATTICE, ((y + 1) & (LATTICE - 1)) * LATTICE
    top = nodes.take(row + x) * (1 - u) + nodes.take(row + x1) * u
    bottom = nodes.take(below + x) * (1 - u) + nodes.take(below + x1) * u
    value: Array = top * (1 - v) + bottom * v
    return value
