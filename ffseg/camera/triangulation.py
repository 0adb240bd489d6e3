"""Triangulation of two rays with the uncertainty of its altitude."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion
from ffseg.camera.projections import Array

PROBE = 1e-3
"""Pixels by which a match is moved to see how its altitude answers: far above rounding, far below curvature."""


@dataclass(frozen=True, slots=True, eq=False)
class Triangulation:
    """Points seen in two images.

    Attributes
    ----------
    points : ndarray of float64, shape (n, 3)
        Metres, current camera frame; NaN where the rays do not meet in front of both cameras.
    altitude : ndarray of float64, shape (n,)
        Metres above the ground.
    altitude_sigma : ndarray of float64, shape (n,)
        Standard deviation of the altitude, metres, from pixel noise and the motion's uncertainty.
    reprojection : ndarray of float64, shape (n,)
        Larger of the distances between a pixel and its point's projection in the two images, pixels.
    epipolar : ndarray of float64, shape (n,)
        Angle between the previous ray and the epipolar plane of the current one, radians.
    """

    points: Array
    altitude: Array
    altitude_sigma: Array
    reprojection: Array
    epipolar: Array


def triangulate(camera: Camera, motion: Motion, current: Array, previous: Array, noise_px: float) -> Triangulation:
    """Triangulate matched pixels.

    Parameters
    ----------
    camera : Camera
    motion : Motion
    current, previous : ndarray of float64, shape (n, 2)
        The same points in the current and in the previous image, pixels.
    noise_px : float
        Standard deviation of the match per axis, pixels.
    """
    rays, seen = camera.lift(current), camera.lift(previous) @ motion.rotation
    center = -motion.rotation.T @ motion.translation
    points = midpoints(rays, seen, center)
    altitude = camera.altitude(points)
    error = np.maximum(
        _distance(camera.project(points), current), _distance(camera.project(motion.apply(points)), previous)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        normal = _cross(np.broadcast_to(center, rays.shape), rays)
        normal /= np.sqrt(np.sum(normal**2, axis=1, keepdims=True))
        epipolar = np.abs(np.arcsin(np.clip(np.sum(normal * seen, axis=1), -1.0, 1.0)))
    sigma = _altitude_sigma(camera, motion, (current, previous), noise_px)
    return Triangulation(points, altitude, sigma, error, epipolar)


def midpoints(rays: Array, seen: Array, center: Array) -> Array:
    """Middle of the shortest segment between the rays of either camera.

    Parameters
    ----------
    rays, seen : ndarray of float64, shape (n, 3)
        Unit rays from the current camera (the origin) and from the previous one, both in the current frame.
    center : ndarray of float64, shape (3,)
        The previous camera in the current frame.

    Returns
    -------
    ndarray of float64, shape (n, 3)
        NaN where the rays are parallel or meet behind a camera.
    """
    cosine = np.sum(rays * seen, axis=1)
    along, back = rays @ center, seen @ center
    with np.errstate(invalid="ignore", divide="ignore"):
        # 1 - cosine**2 cancels at small parallax; the cross product does not.
        determinant = np.sum(_cross(rays, seen) ** 2, axis=1)
        reach = (along - cosine * back) / determinant
        reach_seen = (cosine * along - back) / determinant
        points = 0.5 * (rays * reach[:, None] + center + seen * reach_seen[:, None])
        points[~((reach > 0) & (reach_seen > 0))] = np.nan
    result: Array = points
    return result


def _cross(a: Array, b: Array) -> Array:
    """Cross products per row; a quarter of the time of numpy's, which counts among hundreds of points."""
    product: Array = np.empty(b.shape)
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        product[:, axis] = a[:, one] * b[:, two] - a[:, two] * b[:, one]
    return product


def _distance(projected: Array, pixels: Array) -> Array:
    distance: Array = np.hypot(*(projected - pixels).T)
    return distance


def _altitude_sigma(camera: Camera, motion: Motion, pair: tuple[Array, Array], noise_px: float) -> Array:
    """First-order propagation: the four pixel coordinates by ``noise_px``, the motion's axes by its own sigmas."""
    lifted = [camera.lift(pixels) for pixels in pair]
    base = _altitude(camera, motion.rotation, motion.translation, lifted)
    variance = np.zeros(len(base))
    for image in range(2):
        for axis in range(2):
            moved = pair[image].copy()
            moved[:, axis] += PROBE
            changed = list(lifted)
            changed[image] = camera.lift(moved)
            slope = (_altitude(camera, motion.rotation, motion.translation, changed) - base) / PROBE
            variance += (slope * noise_px) ** 2
    for rotation, translation, sigma in _probes(camera, motion):
        if sigma > 0:
            slope = (_altitude(camera, rotation, translation, lifted) - base) / PROBE
            variance += (slope * sigma) ** 2
    sigma_m: Array = np.sqrt(variance)
    return sigma_m


def _probes(camera: Camera, motion: Motion) -> list[tuple[Array, Array, float]]:
    """The motion moved by ``PROBE`` metres along two level axes and turned by ``PROBE`` radians about ``up``."""
    level = camera.level()
    x, y, z = camera.up
    spin = np.eye(3) + PROBE * np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return [
        (motion.rotation, motion.translation + PROBE * level[0], motion.translation_sigma),
        (motion.rotation, motion.translation + PROBE * level[1], motion.translation_sigma),
        (spin @ motion.rotation, motion.translation, motion.rotation_sigma),
    ]


def _altitude(camera: Camera, rotation: Array, translation: Array, lifted: list[Array]) -> Array:
    points = midpoints(lifted[0], lifted[1] @ rotation, -rotation.T @ translation)
    return camera.altitude(points)
