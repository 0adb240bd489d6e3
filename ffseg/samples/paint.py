"""Shapes on a grid of 5 x 5 samples a pixel; the middle sample is the pixel centre, which decides the truth."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

GRID = 5
"""Samples per pixel and axis: odd, so that one of them is the pixel centre."""
CURVE_STEPS = 12
"""Chords per B-spline piece; at 60 px a piece they stay within 0.1 px of the curve."""

Stencil = NDArray[np.bool_]
Points = Sequence[tuple[float, float]]


class SampleGrid:
    """The sample grid of an image; its methods return stencils of shape (5 H, 5 W)."""

    def __init__(self, width: int, height: int) -> None:
        self.width = width
        self.height = height

    def polygon(self, points: Points) -> Stencil:
        """Inside of a closed polygon by the even-odd rule."""
        corners = np.asarray(points, dtype=np.float64)
        x0, y0 = corners.T
        x1, y1 = np.roll(corners, -1, axis=0).T
        rows, y = self._rows(y0.min(), y0.max())
        at, side = np.nonzero((y0 <= y[:, None]) != (y1 <= y[:, None]))
        x = x0[side] + (y[at] - y0[side]) * (x1[side] - x0[side]) / (y1[side] - y0[side])
        order = np.lexsort((x, at))
        return self._filled(rows[at[::2]], x[order].reshape(-1, 2))

    def ellipse(self, center: tuple[float, float], radii: tuple[float, float]) -> Stencil:
        """Inside of an axis-parallel ellipse."""
        rows, y = self._rows(center[1] - radii[1], center[1] + radii[1])
        half = radii[0] * np.sqrt(np.maximum(0.0, 1.0 - ((y - center[1]) / radii[1]) ** 2))
        return self._filled(rows, np.stack([center[0] - half, center[0] + half], axis=1))

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

    def _rows(self, low: float, high: float) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Index and y of the sample rows from `low` to `high`."""
        y = (np.arange(self.height * GRID) - GRID // 2) / GRID
        rows = np.flatnonzero((low <= y) & (y <= high))
        return rows, y[rows]

    def _filled(self, rows: NDArray[np.intp], spans: NDArray[np.float64]) -> Stencil:
        """Fill from the first to the second position of each span, shape (n, 2), in its row."""
        stencil = np.zeros((self.height * GRID, self.width * GRID), dtype=np.bool_)
        columns = np.clip(np.ceil(spans * GRID + GRID // 2), 0, self.width * GRID).astype(np.int64)
        for row, (first, end) in zip(rows.tolist(), columns.tolist(), strict=True):
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
    down = stencil.view(np.uint8).reshape(height, GRID, width * GRID).sum(axis=1, dtype=np.uint8)
    counts = down.reshape(height, width, GRID).sum(axis=2, dtype=np.uint8)  # 25 at most
    return np.asarray(counts / (GRID * GRID))


def centers(stencil: Stencil) -> NDArray[np.uint8]:
    """Mask of the pixels whose centre is inside: 255, else 0; shape (H, W)."""
    return stencil[GRID // 2 :: GRID, GRID // 2 :: GRID].astype(np.uint8) * np.uint8(255)
