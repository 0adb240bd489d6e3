"""Parts of a region that a contour cannot reach through the narrow places between them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

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
    free = np.where(walls > 0, np.uint8(0), np.uint8(1))
    _, labels = cv2.connectedComponents(free, connectivity=4)
    whole = np.isin(labels, np.setdiff1d(labels[starts], [0])).astype(np.uint8)
    depth = depths(whole)
    count, parts, figures, _ = cv2.connectedComponentsWithStats((depth >= NARROW).astype(np.uint8), connectivity=8)
    known = set(np.unique(parts[starts]).tolist())
    chosen = [part for part in range(1, count) if part not in known and figures[part, cv2.CC_STAT_AREA] >= LEAST_PIXELS]
    return discs(depth, parts, {part: figures[part, :4] for part in chosen}, most)


def depths(region: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Distance of each pixel to what lies outside the region, the border of the image included."""
    padded = cv2.copyMakeBorder(region, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    depth: NDArray[np.float32] = cv2.distanceTransform(padded, cv2.DIST_L2, 3)[1:-1, 1:-1]  # type: ignore[assignment]
    return depth


def discs(depth: NDArray[np.float32], parts: NDArray[Any], boxes: Mapping[int, Any], most: float) -> tuple[Circle, ...]:
    """A disc round the deepest pixel of each part chosen, the largest first.

    Parameters
    ----------
    depth : ndarray of float32, shape (H, W)
    parts : ndarray of int32, shape (H, W)
        Number of the part each pixel belongs to.
    boxes : mapping
        Column, row, width and height of the box round each part chosen, by its number.
    most : float
        px; the largest radius of a disc.
    """
    found = []
    for part, (x, y, width, height) in boxes.items():
        inside = np.where(parts[y : y + height, x : x + width] == part, depth[y : y + height, x : x + width], 0)
        row, column = np.unravel_index(int(inside.argmax()), inside.shape)
        found.append((float(x + column), float(y + row), min(most, START_SHARE * float(inside.max()))))
    return tuple(sorted(found, key=lambda one: -one[2]))
