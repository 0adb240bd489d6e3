"""Parts of a region that a contour cannot reach through the narrow places between them."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.image.parts import Parts, holding, parts

NARROW = 4.0
"""px; through places nearer to walls than this a contour may not come."""

LEAST_PIXELS = 30
"""A part of fewer pixels is not worth a start."""

START_SHARE = 0.6
"""Part of the largest disc in a part that becomes its start."""

Circle = tuple[float, float, float]


def starts_beyond(walls: NDArray[np.uint8], starts: NDArray[np.bool_], most: float) -> tuple[Circle, ...]:
    """Discs in the parts that hang together with the starts, but only through narrow places.

    Parameters
    ----------
    walls : ndarray of uint8, shape (H, W)
        Nonzero where nothing passes.
    starts : ndarray of bool, shape (H, W)
    most : float
        px; the largest radius of a disc.

    Returns
    -------
    tuple of (x, y, radius)
        The deepest first.
    """
    depth = depths(holding(walls == 0, starts).view(np.uint8))
    deep = parts(depth >= NARROW, corners=True)
    others = np.setdiff1d(np.arange(1, deep.number), deep.touching(starts))
    return discs(depth, deep, others[deep.areas[others] >= LEAST_PIXELS] if len(others) else (), most)


def depths(region: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Distance of each pixel to what lies outside the region, the border of the image included."""
    padded = cv2.copyMakeBorder(region, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    depth: NDArray[np.float32] = cv2.distanceTransform(padded, cv2.DIST_L2, 3)[1:-1, 1:-1]  # type: ignore[assignment]
    return depth


def discs(depth: NDArray[np.float32], told: Parts, chosen: Iterable[int], most: float) -> tuple[Circle, ...]:
    """A disc round the deepest pixel of each part chosen, the largest first.

    Parameters
    ----------
    depth : ndarray of float32, shape (H, W)
    told : Parts
    chosen : iterable of int
        Their numbers.
    most : float
        px; the largest radius of a disc.
    """
    chosen, found = list(chosen), []
    boxes = told.boxes() if chosen else ()
    for part in chosen:
        x, y, width, height = boxes[part].tolist()
        window = np.s_[y : y + height, x : x + width]
        inside = np.where(told.labels[window] == part, depth[window], 0)
        row, column = np.unravel_index(int(inside.argmax()), inside.shape)
        found.append((float(x + column), float(y + row), min(most, START_SHARE * float(inside.max()))))
    return tuple(sorted(found, key=lambda one: -one[2]))
