"""Parts of a region that something in front of it cuts off from the start: a road beyond a car, a floor beyond a pillar."""

from __future__ import annotations

import numpy as np

from ffseg.arrays import Mask, Plane
from ffseg.image.parts import connected_parts
from ffseg.starts.pockets import Circle, depths, discs

SURE = 0.4
"""A part belongs to the region whose median log odds are at least so many times those round the start."""

LEAST_ODDS = 1.0
"""Median log odds below which no part is taken."""

LEAST_SHARE = 0.1
"""Smaller parts, measured in the region round the start, are not worth a start."""

STRIDE = 2
"""Every second pixel each way is looked at."""


def islands(odds: Plane, starts: Mask, most: float) -> tuple[Circle, ...]:
    """Discs in the parts that are about as sure as the one round the starts, but do not hang together with it.

    Parameters
    ----------
    odds : ndarray of float32, shape (H, W)
        Log odds of belonging to the region; below zero where the contour may not go.
    starts : ndarray of bool, shape (H, W)
    most : float
        px; the largest radius of a disc.

    Returns
    -------
    tuple of (x, y, radius)
        The deepest first.
    """
    levels, start = np.ascontiguousarray(odds[::STRIDE, ::STRIDE]), starts[::STRIDE, ::STRIDE]
    components = connected_parts(levels > 0)
    started = components.touching(start)
    least_area = max(LEAST_SHARE * float(components.areas[started].sum()), 1)
    large = np.setdiff1d(np.flatnonzero(components.areas >= least_area), started)
    if not len(large):
        return ()
    around = components.pixels_of(started) & ~start
    if not around.any():
        return ()
    least = max(LEAST_ODDS, SURE * float(np.median(levels[around])))
    sure = large[[float(np.median(levels[components.labels == part])) >= least for part in large]]
    if not len(sure):
        return ()
    small = discs(depths((levels > 0).astype(np.uint8)), components, sure, most / STRIDE)
    return tuple((STRIDE * x, STRIDE * y, STRIDE * radius) for x, y, radius in small)
