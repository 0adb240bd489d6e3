"""Shapes on a grid of 5 x 5 samples a pixel; the middle sample is the pixel centre, which decides the truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

GRID = 5
"""Samples per pixel and axis: odd, so that one of them is the pixel centre."""
CURVE_STEPS = 12
"""Chords per B-spline piece; at 60 px a piece they stay within 0.1 px of the curve."""

Stencil = NDArray[np.bool_]
Points = Sequence[tuple[float, float]]


class Paper:
    """The sample grid of an image; its methods return stencils of shape (5 H, 5 W)."""

    def __init__(self, width: int, height: int) -> None:
        self.width = width
        self.height = height

    def polygon(self, points: Points) -> Stencil:
        """Inside of a closed polygon by the even-odd rule."""
        corners = np.asarray(points, dtype=np.float64)
        x0, y0 = corners.T
        x1, y1 = np.roll(corners, -1, axis=0).T
        spans = {}
        for row, y in self._rows(y0.min(), y0.max()):
            crossed = np.flatnonzero((y0 <= y) != (y1 <= y))
            at = x0[crossed] + (y - y0[crossed]) * (x1[crossed] - x0[crossed]) / (y1[crossed] - y0[crossed])
            spans[row] = np.sort(at)
        return self._filled(spans)

    def ellipse(self, center: tuple[float, float], radii: tuple[float, float]) -> Stencil:
        """Inside of an axis-parallel ellipse."""
        spans = {}
        for row, y in self._rows(center[1] - radii[1], center[1] + radii[1]):
            half = radii[0] * np.sqrt(max(0.0, 1.0 - ((y - center[1]) / radii[1]) ** 2))
            spans[row] = np.array([center[0] - half, center[0] + half])
        return self._filled(spans)

    def disc(self, center: tuple[float, float], radius: float) -> Stencil:
        """Inside of a circle."""
        return self.ellipse(center, (radius, radius))

    def ring(self, center: tuple[float, float], radius: float, width: float) -> Stencil:
        """Inside of a ring of mean radius `radius`."""
        return self.disc(center, radius + width / 2) & ~self.disc(center, radius - width / 2)

    def blob(self, points: Points) -> Stencil:
        """Inside of the closed quadratic B-spline with these control points."""
        return self.polygon(spline(points))

    def stroke(self, points: Points, width: float) -> Stencil:
        """Round-ended line of `width` px through the points."""
        drawn = self.disc(points[0], width / 2)
        for (xa, ya), (xb, yb) in pairwise(points):
            length = np.sqrt((xb - xa) ** 2 + (yb - ya) ** 2)
            nx, ny = (ya - yb) / length * width / 2, (xb - xa) / length * width / 2
            drawn |= self.polygon(((xa + nx, ya + ny), (xb + nx, yb + ny), (xb - nx, yb - ny), (xa - nx, ya - ny)))
            drawn |= self.disc((xb, yb), width / 2)
        return drawn

    def _rows(self, low: float, high: float) -> Iterator[tuple[int, float]]:
        """Yield index and y of the sample rows from `low` to `high`."""
        for row in range(self.height * GRID):
            y = (row - GRID // 2) / GRID
            if low <= y <= high:
                yield row, y

    def _filled(self, spans: dict[int, NDArray[np.float64]]) -> Stencil:
        """Fill between the first and second, third and fourth, ... position of each row."""
        stencil = np.zeros((self.height * GRID, self.width * GRID), dtype=np.bool_)
        for row, positions in spans.items():
            columns = np.clip(np.ceil(positions * GRID + GRID // 2), 0, self.width * GRID).astype(np.int64)
            for first, end in zip(columns[::2], columns[1::2], strict=True):
                stencil[row, first:end] = True
        return stencil


def spline(points: Points) -> list[tuple[float, float]]:
    """Corners of a polygon along the closed quadratic B-spline with these control points."""
    corners = []
    count = len(points)
    for index, (bx, by) in enumerate(points):
        (ax, ay), (cx, cy) = points[index - 1], points[(index + 1) % count]
        for step in range(CURVE_STEPS):
            t = step / CURVE_STEPS
            wa, wb, wc = (1 - t) * (1 - t) / 2, (1 + 2 * t - 2 * t * t) / 2, t * t / 2
            corners.append((wa * ax + wb * bx + wc * cx, wa * ay + wb * by + wc * cy))
    return corners


def coverage(stencil: Stencil) -> NDArray[np.float64]:
    """Share of each pixel that is inside, shape (H, W)."""
    height, width = stencil.shape[0] // GRID, stencil.shape[1] // GRID
    counts = stencil.reshape(height, GRID, width, GRID).sum(axis=(1, 3), dtype=np.int64)
    return np.asarray(counts / (GRID * GRID))


def centers(stencil: Stencil) -> NDArray[np.uint8]:
    """Mask of the pixels whose centre is inside: 255, else 0; shape (H, W)."""
    return stencil[GRID // 2 :: GRID, GRID // 2 :: GRID].astype(np.uint8) * np.uint8(255)
