"""Regions as polygons other programs can read: what the mask shows, drawn where the contours pass between pixel centres.

A contour may cross itself, touch others, or enclose slivers without a pixel; a polygon may not. So the polygons follow the
mask: one vertex on each step of the pixel grid from a centre inside to a centre outside, where the contour crosses that step
(marching squares with the exact crossings). No two of them cross, whatever the contours do, and their pixels are the mask's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, floor
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Mask, Points
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.orientation import ring_area
from ffseg.geometry.ragged import packed
from ffseg.image.raster import TOLERANCE
from ffseg.native import _core

FLATNESS = 0.01
"""Pixels within which vertices are left out: less than half the distance of two polygons, so that none touch."""


@dataclass(frozen=True, slots=True, eq=False)
class Polygon:
    """One region of a mask: pixels that hang together over their sides.

    Attributes
    ----------
    outer : ndarray of float64, shape (M, 2)
        Its outline in pixels, integers at pixel centres, of positive shoelace area; not closed by its first point.
    holes : tuple of ndarray of float64, each (M, 2)
        Of negative area.
    origin : tuple of int
        (x, y) of the first pixel of `mask` in the image.
    labels : ndarray of int, shape (h, w)
        `label` on the region's pixels, in their own window.
    """

    outer: Points
    holes: tuple[Points, ...]
    origin: tuple[int, int]
    labels: NDArray[Any]
    label: int

    @property
    def mask(self) -> Mask:
        """The region's pixels in their own window, shape (h, w)."""
        mask: Mask = self.labels == self.label
        return mask

    @property
    def rings(self) -> tuple[Points, ...]:
        """The outer one, then the holes."""
        return (self.outer, *self.holes)

    @property
    def area(self) -> int:
        """Pixels."""
        return int(np.count_nonzero(self.mask))


def polygons(mask: Mask, contours: Sequence[FreeForm] = (), flatness: float = FLATNESS) -> tuple[Polygon, ...]:
    """Regions of a mask, in the order of their first pixels.

    Parameters
    ----------
    mask : ndarray of bool, shape (H, W)
    contours : sequence of FreeForm
        Of which the mask was made; without one near a step, the outline passes half-way.
    flatness : float
        Pixels within which vertices are left out; with 0 none is, and they lie at most 1.5 px apart.

    Returns
    -------
    tuple of Polygon
        Valid as OGC's Simple Features ask: rings cross and touch neither themselves nor each other.
    """
    found, offsets = _core.mask_outlines(np.ascontiguousarray(mask).view(np.uint8))
    steps = found.reshape(-1, 2)
    if not len(steps):
        return ()
    degrees = np.array([contour.degree for contour in contours], np.int64)
    rings = np.split(_core.crossings(steps, *packed(contours), degrees, TOLERANCE), offsets[1:-1])
    if flatness > 0:
        rings = [_simplified(one, flatness) for one in rings]
    firsts, outer = steps[offsets[:-1]], [ring_area(ring) > 0 for ring in rings]
    labels = mask.view(np.uint8) if sum(outer) == 1 else cv2.connectedComponents(mask.view(np.uint8), connectivity=4)[1]
    owners = [int(labels[round(y + 0.5), round(x)]) for x, y in firsts]  # an outline begins above a pixel of its region
    inner: dict[int, list[Points]] = {}
    for ring, owner, out in zip(rings, owners, outer, strict=True):
        if not out:
            inner.setdefault(owner, []).append(ring)
    made = []
    for number in np.flatnonzero(outer).tolist():
        label, own = owners[number], steps[offsets[number] : offsets[number + 1]]
        (left, right), (top, bottom) = ((ceil(line.min()), floor(line.max()) + 1) for line in own.T.copy())
        holes = tuple(inner.get(label, ()))
        made.append(Polygon(rings[number], holes, (left, top), labels[top:bottom, left:right], label))
    return tuple(made)


def _simplified(ring: Points, flatness: float) -> Points:
    origin = np.floor(ring.min(axis=0))  # single precision is enough for a ring's own extent
    kept = cv2.approxPolyDP((ring - origin).astype(np.float32), flatness / 2, closed=True)[:, 0, :]
    return kept.astype(np.float64) + origin if len(kept) >= 3 else ring
