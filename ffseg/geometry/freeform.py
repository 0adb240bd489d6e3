"""The closed free-form contour of Definition 1 as an immutable value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from itertools import pairwise
from math import comb
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ffseg.arrays import Points
from ffseg.geometry import bezier
from ffseg.geometry.winding import winding_numbers
from ffseg.native import _core


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FreeForm:
    """A closed chain of Bezier patches of one degree.

    Attributes
    ----------
    control_points : ndarray of float64, shape (N * d, 2), read-only
        Pixels, (x, y), as in Definition 1: patch i has the points ``[i*d : i*d + d + 1]``, the last wraps to the first.
    degree : int
        d, 1 to 6.

    Raises
    ------
    ValueError
        When the degree is out of range, the shape is not (N * d, 2) with N >= 1, or a coordinate is not finite.

    Notes
    -----
    Points may repeat, patches may be single points, and the curve may cross itself: all of it is legal.

    References
    ----------
    Definition 1 and Eq. 1 to 6 of the paper.

    Examples
    --------
    >>> square = ffseg.FreeForm.polygon([(0, 0), (10, 0), (10, 10), (0, 10)])
    >>> square.signed_area, square.reversed().signed_area, square.winding([(5, 5), (20, 20)])
    (100.0, -100.0, array([1, 0]))
    >>> ffseg.FreeForm.circle((50, 40), radius=20, num_patches=6, degree=3)
    <FreeForm of degree 3: 6 patches, signed area 1257.1 px^2>
    """

    control_points: Points
    degree: int
    _area: float | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        bezier.check_degree(self.degree)
        points = np.array(self.control_points, dtype=np.float64, order="C")
        if points.ndim != 2 or points.shape[1] != 2 or len(points) == 0 or len(points) % self.degree:
            raise ValueError(
                f"control points have shape {points.shape}: a closed contour of degree {self.degree} "
                f"needs (N * {self.degree}, 2) with N >= 1"
            )
        if not np.isfinite(points).all():
            raise ValueError("control points hold NaN or infinity: every coordinate must be finite")
        _set(self, points, int(self.degree))

    def __repr__(self) -> str:
        return (
            f"<FreeForm of degree {self.degree}: {self.num_patches} patches, signed area {self.signed_area:.1f} px^2>"
        )

    def __reduce__(self) -> tuple[type[FreeForm], tuple[Points, int]]:
        """Rebuild through the constructor, so that a copy from another process is read-only too."""
        return FreeForm, (self.control_points, self.degree)

    @classmethod
    def trusted(cls, control_points: Points, degree: int) -> FreeForm:
        """Wrap points known to be float64, C-contiguous, finite and of shape (N * d, 2), unchecked and uncopied.

        The array becomes read-only.
        """
        contour = object.__new__(cls)
        _set(contour, control_points, degree)
        return contour

    @classmethod
    def from_patches(cls, patches: Points) -> FreeForm:
        """Contour from patches, shape (N, d + 1, 2), each beginning where the one before it ends (not checked)."""
        degree = patches.shape[1] - 1
        return cls(patches[:, :degree].reshape(-1, 2), degree)

    @classmethod
    def from_samples(cls, samples: Points, degree: int) -> FreeForm:
        """Contour through `samples`, shape (N * d, 2), d per patch at t = i/d, joints shared (Eq. 6)."""
        looped = cls(samples, degree)
        return cls.from_patches(bezier.interpolate(looped.patches))

    @classmethod
    def circle(cls, center: ArrayLike, radius: float, num_patches: int, degree: int) -> FreeForm:
        """Contour of positive area that meets a circle at N * d points of equal angle, the first on the +x side.

        Parameters
        ----------
        center : array_like of float, shape (2,)
            Pixels.
        radius : float
            Pixels, > 0.
        num_patches : int
            N, with N * d >= 3.
        degree : int
            1 to 6.

        Raises
        ------
        ValueError
            When the radius is not positive and finite, or there are fewer than three samples.

        Notes
        -----
        The start of the paper's contour: patches by interpolation (Eq. 6), hence not tangent-continuous.
        """
        bezier.check_degree(degree)
        if not (np.isfinite(radius) and radius > 0):
            raise ValueError(f"radius is {radius}: a circle needs a positive, finite radius in pixels")
        if num_patches * degree < 3:
            raise ValueError(f"{num_patches} patches of degree {degree} give fewer than 3 samples: use more patches")
        angle = np.arange(num_patches * degree) * (2.0 * np.pi / (num_patches * degree))
        unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        return cls.from_samples(np.asarray(center, dtype=np.float64) + radius * unit, degree)

    @classmethod
    def polygon(cls, points: ArrayLike) -> FreeForm:
        """Contour of degree 1 with the given vertices, shape (N, 2), not repeated at the end."""
        return cls(np.asarray(points, dtype=np.float64), 1)

    @classmethod
    def box(cls, x0: float, y0: float, x1: float, y1: float) -> FreeForm:
        """Axis-parallel rectangle of degree 1 between two opposite corners, positive area."""
        (left, right), (top, bottom) = np.sort([x0, x1]), np.sort([y0, y1])  # which keeps what is not a number
        return cls.polygon([(left, top), (right, top), (right, bottom), (left, bottom)])

    @property
    def num_patches(self) -> int:
        """N, the number of patches."""
        return len(self.control_points) // self.degree

    @property
    def patches(self) -> Points:
        """Control points per patch, shape (N, d + 1, 2); the last point of each is the first of the next."""
        degree = self.degree
        gathered: Points = np.empty((self.num_patches, degree + 1, 2))
        gathered[:, :degree] = self.control_points.reshape(-1, degree, 2)
        gathered[:-1, degree] = gathered[1:, 0]
        gathered[-1, degree] = gathered[0, 0]
        return gathered

    @property
    def signed_area(self) -> float:
        """Area enclosed, in square pixels, of the curve itself; positive for an outer component, negative for a hole.

        Notes
        -----
        The shoelace integral of ``(x dy - y dx) / 2`` in closed form. What is run round twice counts twice; loops of
        opposite turn cancel. The first point is subtracted first, so a small contour far away loses no digits.
        """
        if self._area is None:
            ends = np.array([0, len(self.control_points)])
            (area,) = _core.signed_areas(self.control_points, ends, _area_matrix(self.degree))
            object.__setattr__(self, "_area", area)
        return cast(float, self._area)

    @property
    def control_box(self) -> Points:
        """Box [[x_min, y_min], [x_max, y_max]] of the control points; it contains the curve."""
        return np.stack([self.control_points.min(axis=0), self.control_points.max(axis=0)])

    @property
    def bounding_box(self) -> Points:
        """Smallest box [[x_min, y_min], [x_max, y_max]] of the curve, up to rounding (roots of the derivative)."""
        joints = self.control_points[:: self.degree]
        extremes = [joints, *(_turning_points(patch) for patch in _bulging(self.patches, joints))]
        points = np.concatenate(extremes)
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @property
    def length(self) -> float:
        """Arc length in pixels, relative error below 1e-9 for a regular curve (less sure near a cusp)."""
        return float(_arc_lengths(self.patches).sum())

    def evaluate(self, t: ArrayLike) -> Points:
        """Points of the contour at parameters `t` in [0, 1], shape ``t.shape + (2,)`` (Definition 1).

        Raises
        ------
        ValueError
            When a parameter lies outside [0, 1] or is NaN.
        """
        at = np.asarray(t, dtype=np.float64)
        if not ((at >= 0.0) & (at <= 1.0)).all():
            raise ValueError("a contour parameter lies outside [0, 1]")
        scaled = at * self.num_patches
        index = np.minimum(scaled.astype(np.int64), self.num_patches - 1)
        return bezier.evaluate(self.patches[index], scaled - index)

    def winding(self, points: ArrayLike) -> NDArray[np.int64]:
        """How often the contour runs round each of the points, shape S + (2,); see `winding_numbers`."""
        return winding_numbers(self.patches, points)

    def flatten(self, tolerance: float = 0.02) -> Points:
        """Polygon, shape (M, 2), whose edges stay within `tolerance` px of the curve; joints are among its vertices.

        Parameters
        ----------
        tolerance : float
            Pixels, > 0. The bound is proven (`bezier.chord_count`) and holds for the curve parameter by parameter.

        Returns
        -------
        ndarray of float64, shape (M, 2)
            M >= N vertices, the first not repeated at the end. Degree 1 returns its own vertices.

        Raises
        ------
        ValueError
            When the tolerance is not positive.
        """
        return self.flatten_indexed(tolerance)[0]

    def flatten_indexed(self, tolerance: float = 0.02) -> tuple[Points, NDArray[np.int64]]:
        """Vertices as `flatten` gives them, and for each the index of the patch its outgoing edge belongs to."""
        if not tolerance > 0.0:
            raise ValueError(f"tolerance is {tolerance}: flattening needs a positive tolerance in pixels")
        patches = self.patches
        counts = bezier.chord_count(patches, tolerance)
        owner = np.repeat(np.arange(len(patches)), counts)
        step = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
        return bezier.evaluate(patches[owner], step / counts[owner]), owner

    def reversed(self) -> FreeForm:
        """The same curve run the other way from the same first point: the signed area changes its sign."""
        return FreeForm.trusted(np.ascontiguousarray(np.roll(self.control_points[::-1], 1, axis=0)), self.degree)

    def affine(self, matrix: ArrayLike, offset: ArrayLike = (0.0, 0.0)) -> FreeForm:
        """Image under ``p -> matrix @ p + offset``; a matrix of negative determinant also changes the area's sign.

        Raises
        ------
        ValueError
            When the matrix is not of shape (2, 2), the offset not of shape (2,), or a number not finite.
        """
        turned, by = np.asarray(matrix, dtype=np.float64), np.asarray(offset, dtype=np.float64)
        if turned.shape != (2, 2) or by.shape != (2,):
            raise ValueError(
                f"matrix and offset have shapes {turned.shape} and {by.shape}: a map needs (2, 2) and (2,)"
            )
        return FreeForm(self.control_points @ turned.T + by, self.degree)

    def elevated(self, degree: int | None = None) -> FreeForm:
        """The same curve with patches of a higher degree (by default one more).

        Raises
        ------
        ValueError
            When the degree is lower than the contour's or above 6.
        """
        target = self.degree + 1 if degree is None else degree
        bezier.check_degree(target)
        if target < self.degree:
            raise ValueError(f"degree {target} is below the contour's degree {self.degree}: elevation only raises it")
        patches = self.patches
        for _ in range(target - self.degree):
            patches = bezier.elevate(patches)
        return FreeForm.from_patches(patches)


def chained(points: Points, ends: Sequence[int], degree: int) -> tuple[FreeForm, ...]:
    """Contours of points that lie one after another, contour c from ``ends[c]`` to ``ends[c + 1]``.

    Their areas are computed all at once: they are asked of every contour of a result.

    Raises
    ------
    ValueError
        If a coordinate is not finite.
    """
    areas = _core.signed_areas(points, np.array(ends), _area_matrix(degree))
    contours = tuple(FreeForm.trusted(points[a:b], degree) for a, b in pairwise(ends))
    for contour, area in zip(contours, areas, strict=True):
        object.__setattr__(contour, "_area", area)
    return contours


def _set(contour: FreeForm, points: Points, degree: int) -> None:
    points.setflags(write=False)
    object.__setattr__(contour, "control_points", points)
    object.__setattr__(contour, "degree", degree)
    object.__setattr__(contour, "_area", None)


@cache
def _area_matrix(degree: int) -> Points:
    """Matrix K with ``x^T K y`` = integral of ``(x y' - y x') / 2`` over one patch; skew-symmetric, rational.

    The integral of b_{d,i} b_{d-1,j} over [0, 1] is C(d,i) C(d-1,j) / (2d C(2d-1,i+j)).
    """

    def product(i: int, j: int) -> Fraction:
        if not 0 <= j < degree:
            return Fraction(0)
        return Fraction(comb(degree, i) * comb(degree - 1, j), 2 * degree * comb(2 * degree - 1, i + j))

    size = range(degree + 1)
    slope = [[degree * (product(i, j - 1) - product(i, j)) for j in size] for i in size]
    return np.array([[float((slope[i][j] - slope[j][i]) / 2) for j in size] for i in size])


def _bulging(patches: Points, joints: Points) -> Points:
    """Patches with an inner control point outside the box of all joints: only these can widen the box."""
    low, high = joints.min(axis=0), joints.max(axis=0)
    outside = ((patches < low) | (patches > high)).any(axis=(1, 2))
    bulging: Points = patches[outside]
    return bulging


def _turning_points(patch: Points) -> Points:
    """Points of the patch where a coordinate may be extreme.

    Every root, complex or outside [0, 1] as well, is brought to a real parameter in [0, 1]: a surplus point of the
    curve cannot widen its box, so no tolerance is needed.
    """
    slope = bezier.derivative(patch)
    scale = np.abs(slope).max(initial=_TINY)
    roots = [np.roots(_power_form(slope[:, axis] / scale)) for axis in (0, 1)]
    return bezier.evaluate(patch, np.clip(np.concatenate(roots).real, 0.0, 1.0))


def _power_form(values: Points) -> Points:
    """Coefficients, highest power first, of the polynomial with these Bernstein coefficients."""
    degree = len(values) - 1
    rows = np.array([comb(degree, k) * np.diff(values, n=k)[0] for k in range(degree, -1, -1)])
    rows[np.abs(rows) < _POWER_NOISE] = 0.0
    return rows


_TINY = 1e-300
"""Keeps the scale of a patch that is a single point from being zero."""

_POWER_NOISE = 1e-14
"""Coefficients below this are rounding of values scaled to 1; a leading one would send roots to infinity."""

_GAUSS_NODES, _LENGTH_HALVINGS = 16, 4
"""16 Gauss nodes on 16 pieces of a patch: 1e-9 relative on speeds that do not come near zero."""


def _arc_lengths(patches: Points) -> NDArray[np.float64]:
    pieces, (nodes, weights) = 2**_LENGTH_HALVINGS, np.polynomial.legendre.leggauss(_GAUSS_NODES)
    t = ((np.arange(pieces)[:, None] + (nodes + 1.0) / 2.0) / pieces).ravel()
    speed = bezier.evaluate(bezier.derivative(patches)[:, None], t)
    lengths: NDArray[np.float64] = np.hypot(speed[..., 0], speed[..., 1]) @ np.tile(weights, pieces) / (2.0 * pieces)
    return lengths
