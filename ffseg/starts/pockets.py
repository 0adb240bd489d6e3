"""Components of a region that a contour cannot reach because the passages between them are narrow."""

from __future__ import annotations

from math import ceil

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Mask
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
    components = connected_parts(beyond, corners=True)
    return discs(region, components, np.flatnonzero(components.areas >= MIN_PIXELS), most)


def discs(region: Mask, components: Parts, chosen: NDArray[np.integer], most: float) -> tuple[Circle, ...]:
    """A disc round the deepest pixel in a region of each component chosen, the largest first.

    Parameters
    ----------
    region : ndarray of bool, shape (H, W)
        It ends where the image does, and no more than `NARROW_WIDTH` beside each component. Only there are depths measured.
    components : Parts
    chosen : ndarray of int
        Their numbers.
    most : float
        px; the largest radius of a disc.
    """
    held = components.pixels_of(chosen)
    left, top, width, height = cv2.boundingRect(held.view(np.uint8))
    if not width:
        return ()
    near = np.pad(region, REACH)[top : top + height + 2 * REACH, left : left + width + 2 * REACH]
    window, depth = np.s_[top : top + height, left : left + width], distances(near)[REACH:-REACH, REACH:-REACH]
    inside = np.flatnonzero(held[window])
    part, deep = components.labels[window].take(inside), depth.take(inside)
    deepest = np.zeros(components.number, np.float32)
    np.maximum.at(deepest, part, deep)
    there = np.flatnonzero(deep == deepest[part])
    first = there[np.unique(part[there], return_index=True)[1]]
    rows, columns = np.divmod(inside[first], width)
    radii = np.minimum(most, START_RADIUS_FRACTION * deep[first].astype(np.float64))
    found = zip(
        (left + columns).astype(float).tolist(), (top + rows).astype(float).tolist(), radii.tolist(), strict=True
    )
    return tuple(sorted(found, key=lambda one: -one[2]))
