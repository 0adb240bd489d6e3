"""Exact orientation of point triples: Shewchuk's expansions decide what float64 cannot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Array

Signs = NDArray[np.int8]

_FILTER = 4.0 * np.finfo(float).eps
"""Relative error of the plain determinant is below 3.4 eps of the sum of its terms' sizes; rounded up."""

_SPLITTER = 2.0**27 + 1.0
"""Cuts a float64 into two halves of at most 26 bits each."""


def ring_area(ring: Array) -> float:
    """Shoelace area of a closed polygon, shape (n, 2), not closed by its first point: positive from x toward y."""
    x, y = (ring - ring[0]).T  # so that the last term, back to the first vertex, is 0
    return 0.5 * float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))


def signs_of_turns(a: Array, b: Array, c: Array) -> Signs:
    """As `exact_signs`, in float64 for all triples but those too near a line for its rounding."""
    left = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1])
    right = (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    determinant = left - right
    signs: Signs = np.sign(determinant).astype(np.int8)
    unsure = np.flatnonzero(np.abs(determinant) <= _FILTER * (np.abs(left) + np.abs(right)))
    if len(unsure):
        signs[unsure] = exact_signs(a[unsure], b[unsure], c[unsure])
    return signs


def exact_signs(a: Array, b: Array, c: Array) -> Signs:
    """Exact sign, -1, 0 or 1, of (b - a) x (c - a) for points of shape (n, 2) each."""
    parts: list[Array] = []
    for p, q in ((b, c), (c, a), (a, b)):  # six products, each as two floats, summed without error
        for factor, other in ((p[:, 0], q[:, 1]), (-p[:, 1], q[:, 0])):
            for term in _product(factor, other):
                _grow(parts, term)
    sign: Signs = np.zeros(len(a), dtype=np.int8)
    for part in reversed(parts):
        sign = np.where(sign == 0, np.sign(part), sign).astype(np.int8)
    return sign


def _product(a: Array, b: Array) -> tuple[Array, Array]:
    """High and low part of the exact products (Dekker)."""
    high = a * b
    a_high, b_high = _upper_half(a), _upper_half(b)
    a_low, b_low = a - a_high, b - b_high
    low = a_low * b_low - (((high - a_high * b_high) - a_low * b_high) - a_high * b_low)
    return high, low


def _upper_half(a: Array) -> Array:
    scaled = _SPLITTER * a
    return scaled - (scaled - a)


def _grow(parts: list[Array], term: Array) -> None:
    """Add a term to the non-overlapping expansion `parts` (smallest first) without error."""
    for index, part in enumerate(parts):
        total = term + part
        virtual = total - term
        parts[index] = (term - (total - virtual)) + (part - virtual)
        term = total
    parts.append(term)
