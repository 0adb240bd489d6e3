"""From contours to masks by the pixel-centre rule."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor

import numpy as np

from ffseg.arrays import Mask
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed
from ffseg.native import _core

TOLERANCE = 0.01
"""How far, in pixels, the polygon that is filled may leave the curve: a pixel's value can differ from that of the exact
curve only where its centre lies this close to it (about one in fifty boundary pixels has a centre there)."""


def rasterize(contours: Sequence[FreeForm], shape: tuple[int, int], tolerance: float = TOLERANCE) -> Mask:
    """Mask of the region the contours enclose together.

    Parameters
    ----------
    contours : sequence of FreeForm
        In pixels, integers at pixel centres; outer ones of positive area, holes negative. Degrees may differ.
    shape : tuple of int
        (H, W), up to 65535 each; zero is legal.
    tolerance : float
        Pixels, at least 1e-6. Contours of degree 1 are exact whatever it is.

    Returns
    -------
    ndarray of bool, shape (H, W)
        True where the winding number of all contours together round the pixel centre is > 0.

    Raises
    ------
    ValueError
        If a coordinate is beyond 1e100, the shape is too large or the tolerance too small.

    Notes
    -----
    Half-open: a centre exactly on an edge belongs to the region right of it (or below it, if the edge is level), so a
    box from 0 to n holds the centres 0 to n - 1, and regions that share an edge share no pixel.
    """
    mask = np.empty(shape, dtype=np.bool_)
    points, offsets = packed(contours)
    degrees = np.array([c.degree for c in contours], dtype=np.int64)
    _core.rasterize(points, offsets, degrees, tolerance, mask.view(np.uint8))
    return mask


def window_of(box: tuple[float, float, float, float], shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Rows and columns of an image of shape (H, W, ...) whose pixel centres lie in a box (left, top, right, bottom), px."""
    left, top, right, bottom = box
    rows, columns = (
        slice(max(ceil(low), 0), min(floor(high) + 1, size))
        for low, high, size in ((top, bottom, shape[0]), (left, right, shape[1]))
    )
    return rows, columns
