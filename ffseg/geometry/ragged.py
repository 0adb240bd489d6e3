"""Contours as one array of points with offsets, the form that the native core takes and returns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Points
from ffseg.geometry.freeform import FreeForm, chained


def packed(contours: Iterable[FreeForm]) -> tuple[Points, NDArray[np.int64]]:
    """Control points of all contours, shape (M, 2), and where each begins, shape (N + 1,), ending with M."""
    return packed_points(contour.control_points for contour in contours)


def packed_joints(contours: Iterable[FreeForm]) -> tuple[Points, NDArray[np.int64]]:
    """The joints of all contours in the same way."""
    return packed_points(contour.control_points[:: contour.degree] for contour in contours)


def packed_points(polygons: Iterable[Points]) -> tuple[Points, NDArray[np.int64]]:
    """The same of polygons, each of shape (m, 2)."""
    points = list(polygons)
    offsets = np.array([0, *accumulate(map(len, points))], dtype=np.int64)
    return np.concatenate(points or [np.empty((0, 2))]), offsets


def unpacked(points: Points, offsets: Sequence[int], degree: int) -> tuple[FreeForm, ...]:
    """Contours from such arrays.

    Parameters
    ----------
    points : ndarray of float64, shape (M, 2)
        The contours are views of it.
    degree : int
        Of all contours.

    Raises
    ------
    ValueError
        If a coordinate is not finite.
    """
    return chained(points, offsets, degree) if len(points) else ()
