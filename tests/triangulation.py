"""Triangulation of two rays with the uncertainty of its altitude."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffseg.camera.model import Camera
from ffseg.camera.motion import PARAMETERS, Motion, perturbed
from ffseg.camera.projections import Array

PROBE = 1e-3
"""Pixels by which a match is moved to see how its altitude answers: far above rounding, far below curvature."""
MOTION_PROBE = 1e-6
"""Metres and radians, the same for a motion."""


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
    pixel_sigma : ndarray of float64, shape (n,)
        The part of it that pixel noise makes.
    slopes : ndarray of float64, shape (n, 8)
        d(altitude)/d(parameters of the motion), as `perturbed` takes them.
    reprojection : ndarray of float64, shape (n,)
        Larger of the distances between a pixel and its point's projection in the two images, pixels.
    epipolar : ndarray of float64, shape (n,)
        Angle between the previous ray and the epipolar plane of the current one, radians.
    """

    points: Array
    altitude: Array
    altitude_sigma: Array
    pixel_sigma: Array
    slopes: Array
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
    rays, seen = (camera.lift(place + _STEPS[:, None]) for place in (current, previous))
    rotations, translations, ups = perturbed(camera, motion, _PROBES)
    centers = -np.einsum("vji,vj->vi", rotations, translations)
    points, epipolar = _meet(rays[_CURRENT], seen[_PREVIOUS] @ rotations, centers)
    altitudes = camera.mounting() + np.einsum("vni,vi->vn", points, ups)
    moved = altitudes[1:] - altitudes[0]
    pixel_sigma = np.sqrt(np.sum(moved[:4] ** 2, axis=0)) * (noise_px / PROBE)
    slopes = moved[4:].T / MOTION_PROBE
    sigma: Array = np.sqrt(pixel_sigma**2 + np.sum((slopes @ motion.errors().T) ** 2, axis=1))
    back = np.stack([points[0], motion.apply(points[0])])
    miss = camera.project(back) - np.stack([current, previous])
    error = np.sqrt(np.sum(miss**2, axis=2)).max(axis=0)
    return Triangulation(points[0], altitudes[0], sigma, pixel_sigma, slopes, error, epipolar[0])


_STEPS = PROBE * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
"""Moves of a pixel; the places below are rows of it for either image, while the motion stays and then moves."""
_CURRENT = [0, 1, 2, 0, 0] + [0] * PARAMETERS
_PREVIOUS = [0, 0, 0, 1, 2] + [0] * PARAMETERS
_PROBES = np.concatenate([np.zeros((5, PARAMETERS)), MOTION_PROBE * np.eye(PARAMETERS)])


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
