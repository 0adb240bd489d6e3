"""Regions as polygons other programs can read: what the mask shows, drawn where the contours pass between pixel centres.

A contour may cross itself, touch others, or enclose slivers without a pixel; a polygon may not. So the polygons follow the
mask: one vertex on each step of the pixel grid from a centre inside to a centre outside, where the contour crosses that step
(marching squares with the exact crossings). No two of them cross, whatever the contours do, and their pixels are the mask's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.geometry.bezier import Points
from ffseg.geometry.freeform import FreeForm
from ffseg.image.raster import TOLERANCE
from ffseg.native import _core

MARGIN = 0.02
"""Part of a step that a crossing stays away from either centre: polygons of neighbours then lie 0.028 px apart at least."""
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
    def mask(self) -> NDArray[np.bool_]:
        """The region's pixels in their own window, shape (h, w)."""
        mask: NDArray[np.bool_] = self.labels == self.label
        return mask

    @property
    def rings(self) -> tuple[Points, ...]:
        """The outer one, then the holes."""
        return (self.outer, *self.holes)

    @property
    def area(self) -> int:
        """Pixels."""
        return int(np.count_nonzero(self.mask))


def polygons(mask: NDArray[np.bool_], contours: Sequence[FreeForm] = ()) -> tuple[Polygon, ...]:
    """Regions of a mask, in the order of their first pixels.

    Parameters
    ----------
    mask : ndarray of bool, shape (H, W)
    contours : sequence of FreeForm
        Of which the mask was made; without one near a step, the outline passes half-way.

    Returns
    -------
    tuple of Polygon
        Valid as OGC's Simple Features ask: rings cross and touch neither themselves nor each other.
    """
    found, offsets = _core.mask_outlines(np.ascontiguousarray(mask).view(np.uint8))
    steps = found.reshape(-1, 2)
    if not len(steps):
        return ()
    rings = [_simplified(one) for one in np.split(_crossed(steps, contours, mask.shape), offsets[1:-1])]
    firsts, outer = steps[offsets[:-1]], [_area(ring) > 0 for ring in rings]
    labels = mask.view(np.uint8) if sum(outer) == 1 else cv2.connectedComponents(mask.view(np.uint8), connectivity=4)[1]
    owners = [int(labels[round(y + 0.5), round(x)]) for x, y in firsts]  # an outline begins above a pixel of its region
    inner: dict[int, list[Points]] = {}
    for ring, owner, out in zip(rings, owners, outer, strict=True):
        if not out:
            inner.setdefault(owner, []).append(ring)
    made = []
    for number in np.flatnonzero(outer).tolist():
        label, own = owners[number], steps[offsets[number] : offsets[number + 1]]
        (left, top), (right, bottom) = np.ceil(own.min(axis=0)).astype(int), np.floor(own.max(axis=0)).astype(int) + 1
        holes = tuple(inner.get(label, ()))
        made.append(Polygon(rings[number], holes, (int(left), int(top)), labels[top:bottom, left:right], label))
    return tuple(made)


def _crossed(steps: Points, contours: Sequence[FreeForm], shape: tuple[int, ...]) -> Points:
    """The middle of each step moved to where a contour crosses it; the mean, where several do."""
    moved = steps.copy()
    lines = [np.vstack([line, line[:1]]) for line in (contour.flatten(TOLERANCE) for contour in contours)]
    if not lines:
        return moved
    begin, end = np.concatenate([line[:-1] for line in lines]), np.concatenate([line[1:] for line in lines])
    for axis in (0, 1):  # steps along x, then along y
        mine = steps[:, axis] % 1 != 0
        wanted = np.floor(steps[mine]).astype(np.int64)
        row, place = _crossings(begin, end, axis, shape[axis])
        moved[mine, axis] = _places(wanted[:, 1 - axis], wanted[:, axis], row, place)
    return moved


def _crossings(begin: Points, end: Points, axis: int, lines: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Where line segments cross the lines of pixel centres along an axis: number of the line, and place on it."""
    low, high = np.minimum(begin, end)[:, 1 - axis], np.maximum(begin, end)[:, 1 - axis]
    first = np.ceil(np.clip(low, 0, lines)).astype(np.int64)
    count = np.maximum(np.floor(np.clip(high, -1, lines - 1)).astype(np.int64) - first + 1, 0)
    count[low == high] = 0
    which = np.repeat(np.arange(len(begin)), count)
    row = np.repeat(first, count) + np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    from_, to = begin[which], end[which]
    share = (row - from_[:, 1 - axis]) / (to[:, 1 - axis] - from_[:, 1 - axis])
    return row, from_[:, axis] + share * (to[:, axis] - from_[:, axis])


def _places(
    row: NDArray[np.int64], cell: NDArray[np.int64], rows: NDArray[np.int64], places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Mean place of the crossings on each step, from `cell` to the centre after it; the middle where there is none."""
    wide = int(cell.max(initial=0)) + 3
    inside = (places > -2) & (places < wide - 1)
    rows, places = rows[inside], places[inside]
    near = np.floor(np.concatenate([places - MARGIN, places + MARGIN])).astype(
        np.int64
    )  # a centre belongs to both steps
    keys, rows_twice = np.unique(row * wide + cell, return_inverse=True)
    crossing = np.concatenate([rows, rows]) * wide + near
    index = np.searchsorted(keys, crossing)
    index[index == len(keys)] = 0
    hit = keys[index] == crossing if len(keys) else np.zeros(len(crossing), np.bool_)
    twice = np.concatenate([places, places])
    sums = np.bincount(index[hit], twice[hit], len(keys))
    counts = np.bincount(index[hit], minlength=len(keys))
    mean = np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)[rows_twice]
    return np.where(np.isnan(mean), cell + 0.5, np.clip(mean, cell + MARGIN, cell + 1 - MARGIN))


def _simplified(ring: Points) -> Points:
    origin = np.floor(ring.min(axis=0))  # single precision is enough for a ring's own extent
    kept = cv2.approxPolyDP((ring - origin).astype(np.float32), FLATNESS / 2, closed=True)[:, 0, :]
    return kept.astype(np.float64) + origin if len(kept) >= 3 else ring


def _area(ring: Points) -> float:
    x, y = (ring - ring[0]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
