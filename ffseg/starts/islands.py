"""Parts of a region that something in front of it cuts off from the start: a road beyond a car, a floor beyond a pillar."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.starts.pockets import Circle, depths, discs

SURE = 0.4
"""A part belongs to the region whose median log odds are at least so many times those round the start."""

LEAST_ODDS = 1.0
"""Median log odds below which no part is taken."""

LEAST_SHARE = 0.1
"""Smaller parts, measured in the region round the start, are not worth a start."""

STRIDE = 2
"""Every second pixel each way is looked at."""


def islands(odds: NDArray[np.float32], starts: NDArray[np.bool_], most: float) -> tuple[Circle, ...]:
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
    levels, begun = np.ascontiguousarray(odds[::STRIDE, ::STRIDE]), starts[::STRIDE, ::STRIDE]
    _, parts = cv2.connectedComponents((levels > 0).astype(np.uint8), connectivity=4)
    known, areas = np.setdiff1d(parts[begun], [0]), np.bincount(parts.ravel())
    least_area = LEAST_SHARE * float(areas[known].sum())
    large = np.setdiff1d(np.flatnonzero(areas >= least_area), [0, *known]).tolist()
    if not large:
        return ()
    around = np.isin(parts, known) & ~begun
    if not around.any():
        return ()
    least = max(LEAST_ODDS, SURE * float(np.median(levels[around])))
    boxes = {}
    for part in large:
        inside = parts == part
        if float(np.median(levels[inside])) >= least:
            boxes[part] = cv2.boundingRect(inside.astype(np.uint8))
    small = discs(depths((parts > 0).astype(np.uint8)), parts, boxes, most / STRIDE)
    return tuple((STRIDE * x, STRIDE * y, STRIDE * radius) for x, y, radius in small)
