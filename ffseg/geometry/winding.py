"""Winding numbers of points with respect to the curves themselves, not to polygons."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ffseg.arrays import Indices, Mask, Points
from ffseg.geometry import bezier
from ffseg.geometry.orientation import signs_of_turns

Counts = NDArray[np.int64]

_FLAT = 4.0 * np.finfo(float).eps
"""A piece with second differences below this part of its coordinates is its chord as far as float64 can tell."""

_MAX_HALVINGS = 64
"""Each halving divides the second differences by four: 27 make any piece flat, unless rounding stalls it."""

_PAIRS_AT_ONCE = 100_000
"""Pairs of point and patch looked at together: bounds the memory, not the result."""


def winding_numbers(patches: Points, points: ArrayLike) -> Counts:
    """How often the closed chain of patches runs round each point, from x toward y positive.

    Parameters
    ----------
    patches : ndarray of float64, shape (N, d + 1, 2)
        One or several closed chains.
    points : array_like of float, shape S + (2,)
        Finite.

    Returns
    -------
    ndarray of int64, shape S
        1 inside a simple component of positive area, -1 inside a hole alone, sums where they overlap. Ties as in the
        raster: a point on an edge counts as right of it, a level edge as above it.

    Notes
    -----
    Signed crossings with the ray toward +x. A piece whose control box the ray misses, or passes on one side, is decided
    by its ends; any other is halved until it is its chord, so the curve is located as exactly as float64 can. Degree 1
    is exact.
    """
    places = np.asarray(points, dtype=np.float64)
    flat = places.reshape(-1, 2)
    batch = max(1, _PAIRS_AT_ONCE // max(len(patches), 1))
    count = _count_edges if patches.shape[1] == 2 else _count
    parts = [count(patches, flat[i : i + batch]) for i in range(0, len(flat), batch)]
    return np.concatenate([np.empty(0, np.int64), *parts]).reshape(places.shape[:-1])


def _count(patches: Points, points: Points) -> Counts:
    total = np.zeros(len(points), dtype=np.int64)
    low, high = patches.min(axis=1), patches.max(axis=1)
    y = points[:, None, 1]
    point, patch = np.nonzero((low[:, 1] <= y) & (high[:, 1] > y) & (high[:, 0] > points[:, None, 0]))
    pieces = patches[patch]
    for halvings in range(_MAX_HALVINGS + 1):
        pieces, point = _decide(pieces, point, points, total)
        flat = _is_flat(pieces) | (halvings == _MAX_HALVINGS)
        at = points[point[flat]]
        np.add.at(total, point[flat], np.where(_left_of_chord(pieces[flat], at), _rise(pieces[flat], at), 0))
        pieces, point = np.concatenate(bezier.split(pieces[~flat])), np.tile(point[~flat], 2)
        if not len(point):
            break
    return total


def _count_edges(edges: Points, points: Points) -> Counts:
    """As `_count` for degree 1, where the chord is the piece."""
    begins, ends = (np.ascontiguousarray(edges[:, i, 1]) <= points[:, None, 1] for i in (0, 1))
    point, edge = np.nonzero(begins != ends)
    crossed, at = edges[edge], points[point]
    left = _left_of_chord(crossed, at)
    total = np.zeros(len(points), dtype=np.int64)
    np.add.at(total, point[left], _rise(crossed[left], at[left]))
    return total


def _decide(pieces: Points, point: Indices, points: Points, total: Counts) -> tuple[Points, Indices]:
    """Count the pieces whose box decides; give back the others."""
    at = points[point]
    low, high = pieces.min(axis=1), pieces.max(axis=1)
    seen = (low[:, 1] <= at[:, 1]) & (high[:, 1] > at[:, 1]) & (high[:, 0] > at[:, 0])
    right = seen & (low[:, 0] > at[:, 0])
    np.add.at(total, point[right], _rise(pieces[right], at[right]))
    open_ = seen & ~right
    return pieces[open_], point[open_]


def _rise(pieces: Points, at: Points) -> Counts:
    """+1 for a piece that begins at or above the point's height (smaller y) and ends below it, -1 for the reverse."""
    begins, ends = (pieces[:, i, 1] <= at[:, 1] for i in (0, -1))
    return begins.astype(np.int64) - ends


def _is_flat(pieces: Points) -> Mask:
    bend = np.abs(np.diff(pieces, n=2, axis=1)).max(axis=(1, 2), initial=0.0)
    flat: Mask = bend <= _FLAT * np.abs(pieces).max(axis=(1, 2), initial=0.0)
    return flat


def _left_of_chord(pieces: Points, at: Points) -> Mask:
    """Whether the point lies strictly left of the chord, exact; a level chord counts for nothing anyway."""
    left: Mask = signs_of_turns(pieces[:, 0], pieces[:, -1], at) == np.sign(pieces[:, -1] - pieces[:, 0])[:, 1]
    return left
