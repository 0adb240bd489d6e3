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
    lifted = camera.lift(np.stack([place + step for place in (current, previous) for step in _STEPS]))
    rotations, translations, sigmas = _probes(camera, motion, noise_px)
    centers = -np.einsum("vji,vj->vi", rotations, translations)
    points, epipolar = _meet(lifted[_CURRENT], lifted[_PREVIOUS] @ rotations, centers)
    altitudes = camera.altitude(points)
    slopes = (altitudes[1:] - altitudes[0]) / PROBE
    sigma: Array = np.sqrt(np.sum((slopes * sigmas[:, None]) ** 2, axis=0))
    seen = np.stack([points[0], motion.apply(points[0])])
    miss = camera.project(seen) - np.stack([current, previous])
    error = np.sqrt(np.sum(miss**2, axis=2)).max(axis=0)
    return Triangulation(points[0], altitudes[0], sigma, error, epipolar[0])


_STEPS = PROBE * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
"""Moves of a pixel; the places below are those of the moved pixels, the current image's first."""
_CURRENT = [0, 1, 2, 0, 0, 0, 0, 0]
_PREVIOUS = [3, 3, 3, 4, 5, 3, 3, 3]
"""Rays as they are, each pixel coordinate moved, and as they are three times: there the motion moves."""


def _meet(rays: Array, seen: Array, centers: Array) -> tuple[Array, Array]:
    """Where the rays of either camera meet: the middle of the shortest segment between them.

    Parameters
    ----------
    rays, seen : ndarray of float64, shape (v, n, 3)
        Unit rays from the current camera (the origin) and from the previous one, both in the current frame.
    centers : ndarray of float64, shape (v, 3)
        The previous camera in the current frame.

    Returns
    -------
    points : ndarray of float64, shape (v, n, 3)
        NaN where the rays are parallel or meet behind a camera.
    epipolar : ndarray of float64, shape (v, n)
        Angle between ``seen`` and the epipolar plane of ``rays``, radians.
    """
    cosine = np.einsum("vni,vni->vn", rays, seen)
    along, back = np.einsum("vni,vi->vn", rays, centers), np.einsum("vni,vi->vn", seen, centers)
    # 1 - cosine**2 cancels at small parallax; the cross product does not.
    normal = _cross(rays, seen)
    with np.errstate(invalid="ignore", divide="ignore"):
        determinant = np.einsum("vni,vni->vn", normal, normal)
        reach = (along - cosine * back) / determinant
        reach_seen = (cosine * along - back) / determinant
        points = 0.5 * (rays * reach[..., None] + centers[:, None] + seen * reach_seen[..., None])
        points[~((reach > 0) & (reach_seen > 0))] = np.nan
        across = np.sqrt(np.sum(_cross(centers[:, None], rays) ** 2, axis=2))
        sine = np.abs(np.einsum("vni,vi->vn", normal, centers)) / across
        epipolar: Array = np.arcsin(np.minimum(sine, 1.0))
    return points, epipolar


def _cross(a: Array, b: Array) -> Array:
    """Cross products along the last axis; a quarter of the time of numpy's, which counts among hundreds of points."""
    product: Array = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        product[..., axis] = a[..., one] * b[..., two] - a[..., two] * b[..., one]
    return product


def _probes(camera: Camera, motion: Motion, noise_px: float) -> tuple[Array, Array, Array]:
    """Rotations (8, 3, 3) and translations (8, 3) of the variants, and what each one's slope is worth (7,).

    The motion as it is, five times; moved by ``PROBE`` metres along two level axes; turned by ``PROBE`` radians about
    ``up``.
    """
    rotations, translations = np.tile(motion.rotation, (8, 1, 1)), np.tile(motion.translation, (8, 1))
    translations[5:7] += PROBE * camera.level()[:2]
    x, y, z = camera.up
    spin = np.eye(3) + PROBE * np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotations[7] = spin @ motion.rotation
    moved, turned = motion.translation_sigma, motion.rotation_sigma
    return rotations, translations, np.array([*[noise_px] * 4, moved, moved, turned])
