"""Bezier patches: Bernstein basis, evaluation, interpolation, deformation, splitting (Section 2 of the paper).

A *patch* is an array of control points of shape (..., d + 1, 2); every function takes one patch or a stack of them.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from itertools import pairwise
from math import ceil, comb, perm

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ffseg.arrays import Points

MAX_DEGREE = 6
"""Highest degree ffseg supports: the largest entry of V^-1, by which errors in samples
are amplified, grows from 1 to 30 up to here and to 5000 by degree 12."""

Table = list[list[Fraction]]


def check_degree(degree: object) -> None:
    """Refuse a degree outside 1..6.

    Raises
    ------
    ValueError
        When `degree` is not an integer from 1 to 6.
    """
    if isinstance(degree, bool) or not isinstance(degree, (int, np.integer)) or not 1 <= degree <= MAX_DEGREE:
        raise ValueError(f"degree is {degree!r}: use a whole number from 1 to {MAX_DEGREE}")


def evaluate(patch: Points, t: ArrayLike) -> Points:
    """Point of the patch at parameter `t` by de Casteljau's algorithm.

    Parameters
    ----------
    patch : ndarray of float64, shape (..., d + 1, 2)
        Control points, pixels.
    t : array_like of float
        Broadcasts against the stack of patches (``patch.shape[:-2]``).

    Returns
    -------
    ndarray of float64, shape broadcast(..., t) + (2,)

    Notes
    -----
    Algorithm 1. Differs: the recursion is run bottom-up, O(d^2) instead of O(2^d), in place of both recursive calls.
    """
    s = np.asarray(t, dtype=np.float64)[..., None]
    column = [patch[..., i, :] for i in range(patch.shape[-2])]
    while len(column) > 1:
        column = [(1.0 - s) * a + s * b for a, b in pairwise(column)]
    return column[0] + 0.0 * s


@cache
def interpolation_matrix(degree: int) -> Points:
    """V of Eq. 5 for uniform samples t_i = i/d: ``V @ patch`` are the points M_i on the curve.

    Returns
    -------
    ndarray of float64, shape (d + 1, d + 1), read-only
        Each entry is the exact rational, rounded once.
    """
    check_degree(degree)
    return _rounded(_bernstein_table(degree))


@cache
def interpolation_inverse(degree: int) -> Points:
    """V^-1 of Eq. 6 for uniform samples: ``V^-1 @ M`` is the patch through the points M_i.

    Returns
    -------
    ndarray of float64, shape (d + 1, d + 1), read-only
        Each entry is the exact rational, rounded once. The first and last rows are unit rows.
    """
    check_degree(degree)
    return _rounded(_inverse(_bernstein_table(degree)))


def combined(matrix: Points, points: Points) -> Points:
    """``matrix @ points``, shape (..., m, 2), with the same bits on every processor.

    A product by a linear algebra library rounds as the processor lets it, with or without fused operations; one last
    bit in a start contour is enough to lead an evolution elsewhere. Here every product and every sum is rounded.
    """
    columns = matrix.T[..., None]
    total: Points = columns[0] * points[..., :1, :]
    for k in range(1, points.shape[-2]):
        total = total + columns[k] * points[..., k : k + 1, :]
    return total


def sample(patch: Points) -> Points:
    """Points M_i of the patch at t_i = i/d, shape (..., d + 1, 2) (Eq. 4)."""
    return combined(interpolation_matrix(patch.shape[-2] - 1), patch)


def interpolate(samples: Points) -> Points:
    """Patch that passes through `samples` at t_i = i/d.

    Parameters
    ----------
    samples : ndarray of float64, shape (..., d + 1, 2)
        M_0..M_d. Points may coincide: the result is then a slower or degenerate curve, still exact at the t_i.

    Returns
    -------
    ndarray of float64, shape (..., d + 1, 2)

    Notes
    -----
    Eq. 6. The first and last points are kept bit for bit.
    """
    patch = combined(interpolation_inverse(samples.shape[-2] - 1), samples)
    patch[..., 0, :] = samples[..., 0, :]
    patch[..., -1, :] = samples[..., -1, :]
    return patch


def derivative(patch: Points) -> Points:
    """Control points, shape (..., d, 2), of the derivative with respect to t: a patch of degree d - 1."""
    slope: Points = (patch.shape[-2] - 1) * np.diff(patch, axis=-2)
    return slope


def split(patch: Points, t: float = 0.5) -> tuple[Points, Points]:
    """The two patches of the same degree that cover [0, t] and [t, 1] (de Casteljau).

    Parameters
    ----------
    patch : ndarray of float64, shape (..., d + 1, 2)
    t : float
        In [0, 1].

    Returns
    -------
    left, right : ndarray of float64, shape (..., d + 1, 2)
        ``left[..., -1, :]`` and ``right[..., 0, :]`` are the same bits. At t = 1/2 control points on a dyadic grid
        stay exact while their bits fit a float64.
    """
    column = [patch[..., i, :] for i in range(patch.shape[-2])]
    left, right = [column[0]], [column[-1]]
    while len(column) > 1:
        column = [(1.0 - t) * a + t * b for a, b in pairwise(column)]
        left.append(column[0])
        right.append(column[-1])
    return np.stack(left, axis=-2), np.stack(right[::-1], axis=-2)


def elevate(patch: Points) -> Points:
    """The same curve as a patch of degree d + 1, shape (..., d + 2, 2); the end points keep their bits."""
    degree = patch.shape[-2] - 1
    weight = (np.arange(1, degree + 1) / (degree + 1))[:, None]
    inner = weight * patch[..., :-1, :] + (1.0 - weight) * patch[..., 1:, :]
    return np.concatenate([patch[..., :1, :], inner, patch[..., -1:, :]], axis=-2)


def chord_count(patch: Points, tolerance: float) -> NDArray[np.int64]:
    """How many equal parameter steps make chords that stay within `tolerance` of the patch.

    Parameters
    ----------
    patch : ndarray of float64, shape (..., d + 1, 2)
    tolerance : float
        Pixels, > 0.

    Returns
    -------
    ndarray of int64, shape (...)
        n >= 1 with ``d (d - 1) max|P_i - 2 P_{i+1} + P_{i+2}| / (8 n^2) <= tolerance``.

    Notes
    -----
    A chord over a step h is off by at most h^2 max|B''| / 8, and B'' is bounded by its control points.
    """
    degree = patch.shape[-2] - 1
    if degree == 1:
        return np.ones(patch.shape[:-2], dtype=np.int64)
    bend = np.diff(patch, n=2, axis=-2)
    largest = np.hypot(bend[..., 0], bend[..., 1]).max(axis=-1)
    steps = np.ceil(np.sqrt(degree * (degree - 1) * largest / (8.0 * tolerance)))
    return np.asarray(np.maximum(steps, 1.0), dtype=np.int64)


def as_cubics(patch: Points, tolerance: float) -> Points:
    """Cubic patches that follow one patch.

    Parameters
    ----------
    patch : ndarray of float64, shape (d + 1, 2)
    tolerance : float
        Pixels, > 0.

    Returns
    -------
    ndarray of float64, shape (K, 4, 2)
        Joined end to end, within `tolerance` of the patch. Degrees up to 3 give one cubic, the same curve.

    Notes
    -----
    Over a step h the cubic with the same end points and end derivatives is off by at most h^4 / 384 times the largest
    fourth derivative, which its control points bound.
    """
    degree = patch.shape[-2] - 1
    if degree <= 3:
        for _ in range(3 - degree):
            patch = elevate(patch)
        return patch[None]
    fourth = np.diff(patch, n=4, axis=0)
    bound = perm(degree, 4) * float(np.hypot(fourth[:, 0], fourth[:, 1]).max())
    pieces = max(1, ceil((bound / (384.0 * tolerance)) ** 0.25))
    t = np.arange(pieces + 1) / pieces
    points = evaluate(patch, t)
    thirds = evaluate(derivative(patch), t) / (3.0 * pieces)
    return np.stack([points[:-1], points[:-1] + thirds[:-1], points[1:] - thirds[1:], points[1:]], axis=1)


def _bernstein_table(degree: int) -> Table:
    columns = range(degree + 1)
    whole = degree**degree
    return [[Fraction(comb(degree, j) * i**j * (degree - i) ** (degree - j), whole) for j in columns] for i in columns]


def _inverse(table: Table) -> Table:
    """Gauss-Jordan in rationals; the uniform V is totally positive, so no pivot is zero."""
    size = len(table)
    rows = [row + [Fraction(int(i == j)) for j in range(size)] for i, row in enumerate(table)]
    for k in range(size):
        rows[k] = [value / rows[k][k] for value in rows[k]]
        for i in range(size):
            if i != k:
                factor = rows[i][k]
                rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k], strict=True)]
    return [row[size:] for row in rows]


def _rounded(table: Table) -> Points:
    matrix = np.array([[float(value) for value in row] for row in table])
    matrix.setflags(write=False)
    return matrix
