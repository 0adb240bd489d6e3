"""Components of a region that a contour cannot reach because the passages between them are narrow."""

from __future__ import annotations

from math import ceil

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Mask, Plane
from ffseg.image.free import deeper, distances
from ffseg.image.parts import Parts, connected_parts, parts_holding

NARROW_WIDTH = 4.0
"""Pixels: a contour may fail to pass places nearer to walls than this."""

MIN_PIXELS = 30
"""Pixels: smaller components get no start."""

REACH = ceil(NARROW_WIDTH) + 3
"""Pixels beside a component within which the distances of all its pixels are decided: towards the nearest pixel outside the
region they fall steadily, so that the component ends `NARROW_WIDTH` before it, up to the rounding of pixels."""

START_RADIUS_FRACTION = 0.6
"""Radius of the start in a component, as a fraction of its largest inscribed disc."""

Circle = tuple[float, float, float]


def starts_beyond(free: Mask, starts: Mask, most: float) -> tuple[Circle, ...]:
    """Discs in the components connected with the starts only through narrow places.

    Parameters
    ----------
    free : ndarray of bool, shape (H, W)
        False where nothing passes.
    starts : ndarray of bool, shape (H, W)
    most : float
        px; the largest radius of a disc.

    Returns
    -------
    tuple of (x, y, radius)
        The deepest first.
    """
    region = parts_holding(free, starts)
    deep = deeper(region, NARROW_WIDTH)
    beyond = deep & ~parts_holding(deep, starts, corners=True)
    if np.count_nonzero(beyond) < MIN_PIXELS:
        return ()
    left, top, width, height = cv2.boundingRect(beyond.view(np.uint8))
    window = np.s_[top : top + height + 2 * REACH, left : left + width + 2 * REACH]
    components = connected_parts(np.pad(beyond, REACH)[window], corners=True)
    depth = distances(np.pad(region, REACH)[window])
    found = discs(depth, components, np.flatnonzero(components.areas >= MIN_PIXELS), most)
    return tuple((left + x - REACH, top + y - REACH, radius) for x, y, radius in found)


def discs(depth: Plane, components: Parts, chosen: NDArray[np.integer], most: float) -> tuple[Circle, ...]:
    """A disc round the deepest pixel of each part chosen, the largest first.

    Parameters
    ----------
    depth : ndarray of float32, shape (H, W)
    components : Parts
    chosen : ndarray of int
        Their numbers.
    most : float
        px; the largest radius of a disc.
    """
    inside = np.flatnonzero(components.pixels_of(chosen))
    part, deep = components.labels.take(inside), depth.take(inside)
    deepest = np.zeros(components.number, np.float32)
    np.maximum.at(deepest, part, deep)
    there = np.flatnonzero(deep == deepest[part])
    first = there[np.unique(part[there], return_index=True)[1]]
    rows, columns = np.divmod(inside[first], depth.shape[1])
    radii = np.minimum(most, START_RADIUS_FRACTION * deep[first].astype(np.float64))
    found = zip(columns.astype(float).tolist(), rows.astype(float).tolist(), radii.tolist(), strict=True)
    return tuple(sorted(found, key=lambda one: -one[2]))
