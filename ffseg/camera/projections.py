"""Projection models: pixels to unit rays and back, each the exact inverse of the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.polynomial.polynomial import polyroots, polyval

from ffseg.arrays import Array

NEWTON_STEPS = 60
"""More than any well-posed inversion takes (under 10); what has not converged by then has no ray."""
CLOSED = 4e-15
"""Relative residual at which an inversion counts as exact: a few units in the last place."""
LAST_STEP = 1e-9
"""A Newton step this small (relative) is followed by an error of its square: below the last place."""


class Projection(Protocol):
    """What a camera model has to offer.

    Examples
    --------
    >>> projection = ffseg.load_camera("pictures/pair/camera.yaml").projection
    >>> rays = projection.lift(np.array([[500.0, 300.0]]))
    >>> projection.project(rays).round(6)
    array([[500., 300.]])
    """

    def lift(self, pixels: Array) -> Array:
        """Unit rays, shape (n, 3), of pixels, shape (n, 2); NaN where no ray exists."""
        ...

    def project(self, points: Array) -> Array:
        """Pixels, shape (n, 2), of points or directions, shape (n, 3); NaN where none exists."""
        ...


@dataclass(frozen=True, slots=True)
class Affine:
    """The last step of a camera: normalised image plane to pixels (K with a skew).

    Attributes
    ----------
    fx, fy, cx, cy : float
        Focal lengths and principal point, pixels.
    skew : float
        K[0, 1], pixels.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    skew: float = 0.0

    def pixels(self, plane: Array) -> Array:
        """Pixels of normalised points, shape (n, 2)."""
        pixels = plane * (self.fx, self.fy)
        pixels += (self.cx, self.cy)
        if self.skew:
            pixels[:, 0] += self.skew * plane[:, 1]
        return pixels

    def plane(self, pixels: Array) -> Array:
        """Normalised points of pixels, shape (n, 2)."""
        plane = pixels - (self.cx, self.cy)
        if self.skew:
            plane[:, 0] -= self.skew / self.fy * plane[:, 1]
        plane /= (self.fx, self.fy)
        return plane


@dataclass(frozen=True, slots=True)
class UnifiedSphere:
    """Unified sphere with radial-tangential distortion (Mei; OpenCV's omnidir parameters).

    A unit direction ``(X, Y, Z)`` falls on ``m = (X, Y) / (Z + xi)``, is distorted as in ``distort`` and scaled by K.

    Attributes
    ----------
    xi : float
        Mirror parameter, 0 (pinhole) and up; 1 is a parabolic mirror.
    distortion : tuple of float
        (k1, k2, p1, p2).
    """

    affine: Affine
    xi: float
    distortion: tuple[float, float, float, float]

    def lift(self, pixels: Array) -> Array:
        """Unit rays, shape (n, 3); NaN outside the model's image."""
        plane = self._undistort(self.affine.plane(pixels))
        square = np.einsum("ni,ni->n", plane, plane)
        rays = np.empty((len(plane), 3))
        with np.errstate(invalid="ignore"):
            eta = (self.xi + np.sqrt(1.0 + (1.0 - self.xi**2) * square)) / (square + 1.0)
        np.multiply(plane, eta[:, None], out=rays[:, :2])
        np.subtract(eta, self.xi, out=rays[:, 2])
        return rays

    def project(self, points: Array) -> Array:
        """Pixels, shape (n, 2); NaN for directions the mirror does not show."""
        z = points[:, 2]
        with np.errstate(invalid="ignore", divide="ignore"):
            norm = np.sqrt(np.einsum("ni,ni->n", points, points))
            depth = z + self.xi * norm
            # Beyond -1/xi (xi > 1) or -xi (xi <= 1) two directions would share a pixel, or fall behind the plane.
            depth[~(z > (-1.0 / self.xi if self.xi > 1.0 else -self.xi) * norm)] = np.nan
            plane: Array = points[:, :2] / depth[:, None]
            if any(self.distortion):
                plane[np.sum(plane**2, axis=1) > self._limit() ** 2] = np.nan
        return self.affine.pixels(distort(plane, self.distortion))

    def _limit(self) -> float:
        """Radius on the undistorted plane up to which the radial distortion does not fold."""
        k1, k2, _, _ = self.distortion
        return _first_root((1.0, 3.0 * k1, 5.0 * k2))

    def _undistort(self, target: Array) -> Array:
        """Newton's inverse of ``distort`` to machine precision, on the branch that contains the centre."""
        if not any(self.distortion):
            return target
        limit = self._limit()
        radius = np.sqrt(np.sum(target**2, axis=1, keepdims=True))
        with np.errstate(invalid="ignore", divide="ignore"):
            guess = target * (self._guess(radius) / np.where(radius > 0, radius, 1.0))
            plane = _newton_plane(guess, target, self.distortion)
            plane[np.sum(plane**2, axis=1) > limit**2] = np.nan
        return plane

    def _guess(self, radius: Array) -> Array:
        """Start radius: below the fold, and far out where the highest power rules (Newton would creep down there)."""
        k1, k2, _, _ = self.distortion
        guess: Array = np.minimum(radius, 0.9 * self._limit())
        if k2 > 0.0:
            guess = np.minimum(guess, (radius / k2) ** 0.2)
        elif k1 > 0.0:
            guess = np.minimum(guess, np.cbrt(radius / k1))
        return guess


def distort(plane: Array, coefficients: tuple[float, float, float, float]) -> Array:
    """Radial-tangential distortion of normalised points, shape (n, 2)."""
    if not any(coefficients):
        return plane
    k1, k2, p1, p2 = coefficients
    x, y = plane[:, 0], plane[:, 1]
    square = x * x + y * y
    radial = 1.0 + square * (k1 + k2 * square)
    return np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
            y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
        ],
        axis=1,
    )


def _newton_plane(plane: Array, target: Array, coefficients: tuple[float, float, float, float]) -> Array:
    """Solve ``distort(plane) = target``; rows without a solution become NaN."""
    scale = 1.0 + np.abs(target).max(axis=1, initial=0.0)
    residual = distort(plane, coefficients) - target
    for _ in range(NEWTON_STEPS):
        if not np.any(np.abs(residual).max(axis=1) > CLOSED * scale):
            break
        candidate = plane - _solve(_distort_jacobian(plane, coefficients), residual)
        better = distort(candidate, coefficients) - target
        # Half a step where a whole one makes it worse; near the root whole steps always win.
        worse = np.sum(better**2, axis=1) > np.sum(residual**2, axis=1)
        candidate[worse] = 0.5 * (candidate[worse] + plane[worse])
        better[worse] = distort(candidate[worse], coefficients) - target[worse]
        plane, residual = candidate, better
    lost = ~(np.abs(residual).max(axis=1, initial=0.0) <= 64 * CLOSED * scale)
    plane[lost] = np.nan
    return plane


def _distort_jacobian(plane: Array, coefficients: tuple[float, float, float, float]) -> Array:
    """Derivative of ``distort``: columns xx, xy (= yx), yy; shape (n, 3)."""
    k1, k2, p1, p2 = coefficients
    x, y = plane[:, 0], plane[:, 1]
    square = x * x + y * y
    radial = 1.0 + square * (k1 + k2 * square)
    slope = 2.0 * k1 + 4.0 * k2 * square
    return np.stack(
        [
            radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
            slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y,
            radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
        ],
        axis=1,
    )


def _solve(symmetric: Array, right: Array) -> Array:
    """Solve a symmetric 2x2 system per row."""
    xx, xy, yy = symmetric.T
    determinant = xx * yy - xy * xy
    adjugate = np.stack([yy * right[:, 0] - xy * right[:, 1], xx * right[:, 1] - xy * right[:, 0]], axis=1)
    solution: Array = adjugate / determinant[:, None]
    return solution


@lru_cache(maxsize=64)
def _first_root(even: tuple[float, ...]) -> float:
    """Smallest r > 0 with ``sum_k even[k] * r**(2k) = 0``, or infinity."""
    coefficients = np.trim_zeros(np.array(even[::-1]), "f")
    roots = np.roots(coefficients)
    real = roots[np.abs(roots.imag) < 1e-12].real
    positive = real[real > 0]
    return float(np.sqrt(positive.min())) if positive.size else float("inf")


@dataclass(frozen=True, slots=True)
class Fisheye:
    """Kannala-Brandt fisheye; all coefficients zero is the equidistant model ``r = f * theta``.

    Attributes
    ----------
    distortion : tuple of float
        (k1, k2, k3, k4) of ``theta * (1 + k1 theta**2 + k2 theta**4 + k3 theta**6 + k4 theta**8)``.
    """

    affine: Affine
    distortion: tuple[float, float, float, float]

    def lift(self, pixels: Array) -> Array:
        """Unit rays, shape (n, 3); NaN beyond the largest angle of the model (at most pi)."""
        plane = self.affine.plane(pixels)
        radius = np.hypot(plane[:, 0], plane[:, 1])
        theta = self._angle(radius)
        with np.errstate(invalid="ignore", divide="ignore"):
            side = np.where(radius > 0, np.sin(theta) / np.where(radius > 0, radius, 1.0), 1.0)
        return np.column_stack([plane * side[:, None], np.cos(theta)])

    def project(self, points: Array) -> Array:
        """Pixels, shape (n, 2); NaN beyond the largest angle of the model."""
        across = np.hypot(points[:, 0], points[:, 1])
        theta = np.arctan2(across, points[:, 2])
        theta[(theta > self._limit()) | ((across == 0) & (points[:, 2] <= 0))] = np.nan
        with np.errstate(invalid="ignore", divide="ignore"):
            scale = np.where(across > 0, self._radius(theta) / np.where(across > 0, across, 1.0), 0.0)
            scale[np.isnan(theta)] = np.nan
        return self.affine.pixels(points[:, :2] * scale[:, None])

    def _radius(self, theta: Array) -> Array:
        square = theta * theta
        k1, k2, k3, k4 = self.distortion
        radius: Array = theta * (1.0 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
        return radius

    def _slope(self, theta: Array) -> Array:
        square = theta * theta
        k1, k2, k3, k4 = self.distortion
        slope: Array = 1.0 + square * (3 * k1 + square * (5 * k2 + square * (7 * k3 + square * 9 * k4)))
        return slope

    def _limit(self) -> float:
        k1, k2, k3, k4 = self.distortion
        return min(np.pi, _first_root((1.0, 3 * k1, 5 * k2, 7 * k3, 9 * k4)))

    def _angle(self, radius: Array) -> Array:
        """Angle in [0, limit], where the radius grows strictly."""
        most = np.full_like(radius, self._limit())
        start = np.clip(radius, 0.0, most)
        theta = _bracketed(start, most, lambda angle: (self._radius(angle) - radius, self._slope(angle)), LAST_STEP)
        theta[~(radius <= self._radius(most))] = np.nan
        return theta


@dataclass(frozen=True, slots=True, eq=False)
class Polynomial:
    """OCamCalib model: the forward polynomial defines it, the inverse is found as its root.

    A pixel at distance ``r`` (after the affine part) has the direction ``(x, y, -f(r))`` with
    ``f(r) = a0 + a1 r + a2 r**2 + ...`` and ``a0 < 0``. The file's own x runs along rows and its z away from the scene;
    here x is right, y down and z toward the scene, as everywhere in ffseg.

    Attributes
    ----------
    coefficients : ndarray of float64
        a0, a1, ... as in the file.
    center : tuple of float
        (x, y) = (column, row) of the distortion centre.
    affine : tuple of float
        (c, d, e) of the file.
    limit : float
        Largest r used: the image's farthest corner, or less where the angle would stop growing.
    """

    coefficients: Array
    center: tuple[float, float]
    affine: tuple[float, float, float]
    limit: float

    def lift(self, pixels: Array) -> Array:
        """Unit rays, shape (n, 3); NaN beyond ``limit``."""
        c, d, e = self.affine
        column, row = pixels[:, 0] - self.center[0], pixels[:, 1] - self.center[1]
        determinant = c - d * e
        down = (row - d * column) / determinant
        right = (c * column - e * row) / determinant
        radius = np.hypot(right, down)
        ray = np.stack([right, down, -polyval(radius, self.coefficients)], axis=1)
        ray[~(radius <= self.limit)] = np.nan
        ray /= np.sqrt(np.sum(ray**2, axis=1, keepdims=True))
        return ray

    def project(self, points: Array) -> Array:
        """Pixels, shape (n, 2); NaN for directions beyond ``limit``."""
        across = np.hypot(points[:, 0], points[:, 1])
        radius = self._radius(across, points[:, 2])
        with np.errstate(invalid="ignore", divide="ignore"):
            scale = np.where(across > 0, radius / np.where(across > 0, across, 1.0), 0.0)
        scale[np.isnan(radius)] = np.nan
        right, down = points[:, 0] * scale, points[:, 1] * scale
        c, d, e = self.affine
        return np.stack([e * down + right + self.center[0], c * down + d * right + self.center[1]], axis=1)

    def _radius(self, across: Array, depth: Array) -> Array:
        """Root of ``f(r) * across + depth * r`` in [0, limit], Newton kept inside a bracket."""
        norm = np.hypot(across, depth)
        with np.errstate(invalid="ignore", divide="ignore"):
            side, ahead = across / norm, depth / norm
        slope = self.coefficients[1:] * np.arange(1, len(self.coefficients))
        high = np.full_like(side, self.limit)
        outside = ~(polyval(high, self.coefficients) * side + ahead * high >= -CLOSED * self.limit)
        start = np.clip(-self.coefficients[0] * side / np.maximum(ahead, 0.2), 0.0, high)

        def at(radius: Array) -> tuple[Array, Array]:
            return polyval(radius, self.coefficients) * side + ahead * radius, polyval(radius, slope) * side + ahead

        radius = _bracketed(start, high, at, LAST_STEP * self.limit)
        radius[outside | (norm == 0)] = np.nan
        return radius


def _bracketed(start: Array, most: Array, at: Callable[[Array], tuple[Array, Array]], last: float) -> Array:
    """Where a value that grows in [0, most] is 0, by Newton's steps inside a shrinking bracket.

    Parameters
    ----------
    at : callable
        Gives value and slope.
    last : float
        A step as small as this is the last one.
    """
    found, low, high = start, np.zeros_like(start), most
    with np.errstate(invalid="ignore", divide="ignore"):
        for _ in range(NEWTON_STEPS):
            value, slope = at(found)
            low, high = np.where(value <= 0, found, low), np.where(value >= 0, found, high)
            step = found - value / slope
            step = np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
            done = not np.any(np.abs(step - found) > last)
            found = step
            if done:
                break
    return found


def polynomial_limit(coefficients: Array, farthest: float) -> float:
    """Largest radius up to ``farthest`` before the angle ``atan2(r, -f(r))`` stops growing.

    The angle grows while ``r f'(r) - f(r) > 0``; the first root is found among the polynomial's own.
    """
    powers = np.arange(len(coefficients))
    growth = coefficients * (powers - 1)
    roots = polyroots(np.trim_zeros(growth, "b"))
    real = roots[np.abs(roots.imag) < 1e-9 * (1.0 + np.abs(roots.real))].real
    positive = real[(real > 0) & (real < farthest)]
    return float(positive.min()) if positive.size else farthest
