"""Components of a region that something in front cuts off from the start: a road beyond a car, a floor beyond a pillar."""

from __future__ import annotations

import numpy as np

from ffseg.arrays import Mask, Plane
from ffseg.image.parts import connected_parts
from ffseg.starts.pockets import Circle, discs

SURE_RATIO = 0.4
"""A component gets a start if its median log odds are at least this fraction of those round the given start."""

MIN_LOG_ODDS = 1.0
"""Smallest median log odds of a component that gets a start."""

MIN_AREA_FRACTION = 0.1
"""Components smaller than this fraction of the region round the given start get none."""

STRIDE = 2
"""Every second pixel in each direction is looked at."""


def islands(odds: Plane, starts: Mask, most: float) -> tuple[Circle, ...]:
    """Discs in the components about as sure as that of the starts, but not connected with it.

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
    least_area = max(MIN_AREA_FRACTION * float(components.areas[started].sum()), 1)
    large = np.setdiff1d(np.flatnonzero(components.areas >= least_area), started)
    if not len(large):
        return ()
    around = components.pixels_of(started) & ~start
    if not around.any():
        return ()
    least = max(MIN_LOG_ODDS, SURE_RATIO * float(np.median(levels[around])))
    sure = large[[float(np.median(levels[components.labels == part])) >= least for part in large]]
    if not len(sure):
        return ()
    small = discs(levels > 0, components, sure, most / STRIDE)
    return tuple((STRIDE * x, STRIDE * y, STRIDE * radius) for x, y, radius in small)
