"""How clear the image's own edges are along a contour."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ffseg.geometry.freeform import FreeForm
from ffseg.image.edges import GRADIENT_SCALE, EdgeMap
from ffseg.image.raster import rasterize

CLEAR_SHARE = 0.1
"""So much of a boundary may be fainter: corners and crossings, where no gradient has one direction."""

CLEAR = 2.5
"""Edges are clear that have this many times the strength an edge needs: on drawn scenes the faint tenth has 2.7 to 40
times, on photographs, from whatever start, 0.6 to 2.33 (all but one of 47, whose contour is right)."""

PLAIN_FAINTEST, PLAIN = 1.25, 0.6
"""In strong noise the edges of a plain region are clear enough at 1.25 times (all but a twentieth): plain is a region
where nine tenths of the gradients are below 0.6 times what an edge needs, as noise alone gives (0.46)."""

MARGIN = 3
"""Pixels from the border of the image or the domain within which no edge is looked for."""

SAMPLE = 4
"""Every fourth pixel each way shows how plain a region is."""


class Boundary:
    """How clear the image's own edges are along what a method found.

    Parameters
    ----------
    contours : tuple of FreeForm, or None
    edges : EdgeMap
    """

    def __init__(self, contours: tuple[FreeForm, ...] | None, edges: EdgeMap) -> None:
        self._contours, self._edges = contours or (), edges
        self._strength = _strength(self._contours, edges)

    def is_clear(self, least: float = 0.0) -> bool:
        """Whether it stands on edges that nobody would doubt.

        Parameters
        ----------
        least : float
            Parts on less than this strength are left out: a front that still moves.

        Returns
        -------
        bool
            True also where no part lies inside the image and the domain: there is nothing to doubt.
        """
        fainter = np.sort(self._strength[self._strength >= least])
        if len(fainter) == 0 or fainter[int(CLEAR_SHARE * len(fainter))] >= CLEAR:
            return True
        return bool(fainter[int(CLEAR_SHARE / 2 * len(fainter))] >= PLAIN_FAINTEST) and self._is_plain

    def clear_share(self) -> float:
        """Share on clear edges, shared with one sample that is not; round a plain region less is clear."""
        clear = np.count_nonzero(self._strength >= CLEAR)
        if clear < (1 - CLEAR_SHARE) * len(self._strength) and self._is_plain:
            clear = np.count_nonzero(self._strength >= PLAIN_FAINTEST)
        return float((clear + 1) / (len(self._strength) + 1))

    @cached_property
    def _is_plain(self) -> bool:
        inside = rasterize(self._contours, self._edges.gradient.shape)[::SAMPLE, ::SAMPLE]
        levels = self._edges.gradient[::SAMPLE, ::SAMPLE][inside]
        return len(levels) > 0 and float(np.quantile(levels, 0.9)) <= PLAIN * needed(self._edges)


def needed(edges: EdgeMap) -> float:
    """The high threshold in units of the stored gradient."""
    return max(edges.thresholds[1] * GRADIENT_SCALE, 1.0)


def near_outside(points: NDArray[np.number], domain: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Whether a pixel outside the domain lies `MARGIN` pixels beside a point (x, y), or at it; at the image's border, there."""
    near, most = np.zeros(len(points), np.bool_), np.array(domain.shape[::-1]) - 1
    for dx in (-MARGIN, 0, MARGIN):
        for dy in (-MARGIN, 0, MARGIN):
            x, y = np.rint(np.clip(points + (dx, dy), 0, most)).astype(np.intp).T
            near |= domain[y, x] == 0
    return near


def _strength(contours: tuple[FreeForm, ...], edges: EdgeMap) -> NDArray[np.float64]:
    """Gradients at the joints of the contours, in high thresholds; the largest of nine pixels.

    Joints within `MARGIN` pixels of the border of the image or the domain are left out.
    """
    height, width = edges.gradient.shape
    if not contours or min(height, width) <= 2 * MARGIN:
        return np.empty(0)
    joints = np.rint(np.concatenate([c.control_points[:: c.degree] for c in contours])).astype(np.intp)
    x, y = joints[(joints >= MARGIN).all(axis=1) & (joints < np.array([width, height]) - MARGIN).all(axis=1)].T
    if edges.domain is not None:
        free = ~near_outside(np.stack([x, y], axis=1), edges.domain)
        x, y = x[free], y[free]
    around = np.add.outer(np.arange(-1, 2) * width, np.arange(-1, 2)).reshape(9, 1)
    largest = np.take(edges.gradient, y * width + x + around).max(axis=0)
    found: NDArray[np.float64] = largest / needed(edges)
    return found
