"""Patches of one image found again in another through a plane-induced warp."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ffseg.arrays import Array, Image
from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion
from ffseg.native import _core

ALIGN_STEPS = 8
"""Gauss-Newton steps; those that succeed take two to five."""


def grey_image(image: Image) -> Image:
    """The image as one contiguous channel."""
    return np.ascontiguousarray(image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Where points of the current image would lie in the previous one, were they on horizontal planes.

    Attributes
    ----------
    pixels : ndarray of float64, shape (n, k, 2)
        NaN where the previous camera would not see it.
    warps : ndarray of float64, shape (n, k, 4)
        d(previous pixel)/d(current pixel): xx, xy, yx, yy.
    """

    pixels: Array
    warps: Array


def plane_pixels(camera: Camera, motion: Motion, pixels: Array, altitudes: Array) -> Array:
    """Positions of `plane_candidates` alone, shape (n, k, 2)."""
    turned, pull = _seen_from_before(camera, motion, pixels, altitudes)
    return camera.project(turned[:, None] + pull)


def _seen_from_before(camera: Camera, motion: Motion, pixels: Array, altitudes: Array) -> tuple[Array, Array]:
    """Rays of pixels that fall by 1, shape (..., 3), in the previous frame, and what altitudes add to each, shape (k, 3).

    A point at altitude h lies at (H - h) times its ray; only the direction counts: R ray + t / (H - h).
    """
    rays = camera.lift(pixels)
    with np.errstate(invalid="ignore", divide="ignore"):
        rays /= np.maximum(-(rays @ camera.up), 1e-9)[..., None]
    pull: Array = motion.translation / (camera.mounting() - altitudes)[:, None]
    return rays @ motion.rotation.T, pull


WARP_EVERY = 3
"""Altitudes that share the warp of the lowest of them: it changes by about a per cent from one to the next."""


def plane_candidates(camera: Camera, motion: Motion, pixels: Array, altitudes: Array) -> Candidates:
    """Positions and warps induced by horizontal planes.

    Parameters
    ----------
    camera, motion
    pixels : ndarray of float64, shape (n, 2)
        Of the current image, below the horizon.
    altitudes : ndarray of float64, shape (k,)
        Of the planes, metres, below the camera.
    """
    corners = pixels[:, None, :] + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    turned, pull = _seen_from_before(camera, motion, corners, altitudes)
    centers = camera.project(turned[:, None, 0] + pull)
    sparse = np.arange(0, len(altitudes), WARP_EVERY)
    sides = camera.project(turned[:, None, 1:] + pull[sparse, None])
    steps = np.swapaxes(sides - centers[:, sparse, None], 2, 3)  # (n, altitude, axis of the pixel, step)
    warps = steps.reshape(len(pixels), len(sparse), 4)
    return Candidates(centers, warps[:, np.arange(len(altitudes)) // WARP_EVERY])


def patch_scores(
    current: Image, previous: Image, points: Array, candidates: Candidates, radius: int, hopeless: float = -1.0
) -> Array:
    """Normalised cross-correlation of every point's patch with each of its candidates, shape (n, k); NaN outside.

    A candidate whose every second row and column correlate less than `hopeless` is given that correlation.
    """
    n, k = candidates.pixels.shape[:2]
    scores = np.empty((n, k))
    _core.patch_scores(
        current, previous, np.ascontiguousarray(points),
        np.ascontiguousarray(candidates.pixels.reshape(n, 2 * k)),
        np.ascontiguousarray(candidates.warps.reshape(n, 4 * k)), radius, hopeless, scores,
    )  # fmt: skip
    return scores


@dataclass(frozen=True, slots=True, eq=False)
class Alignments:
    """Patches aligned in the previous image.

    Attributes
    ----------
    pixels : ndarray of float64, shape (n, 2)
        Previous image.
    score : ndarray of float64, shape (n,)
        Normalised cross-correlation; NaN where the patch left the image.
    information : ndarray of float64, shape (n, 2, 2)
        Inverse covariance of ``pixels``, 1/px^2: small along an edge, large across it.
    noise : ndarray of float64, shape (n,)
        Variance of what differs between the patches in units of that assumed in ``information``, at most 1.
    """

    pixels: Array
    score: Array
    information: Array
    noise: Array


FINEST_RESIDUAL = 2.0
"""Grey levels: smallest residual; rounding and interpolation leave this much even with perfect sensors."""


def align_patches(
    current: Image, previous: Image, points: Array, start: Candidates, radius: int, steps: int = ALIGN_STEPS
) -> Alignments:
    """Align every point's patch from its first candidate."""
    n = len(points)
    out = np.empty((n, 7))
    _core.align_patches(
        current, previous, np.ascontiguousarray(points), np.ascontiguousarray(start.pixels[:, 0]),
        np.ascontiguousarray(start.warps[:, 0]), radius, steps, out,
    )  # fmt: skip
    variance = np.maximum(out[:, 3], FINEST_RESIDUAL) ** 2
    information = np.stack([out[:, 4], out[:, 5], out[:, 5], out[:, 6]], axis=1).reshape(n, 2, 2)
    noise = out[:, 3] ** 2 / variance
    return Alignments(out[:, :2].copy(), out[:, 2].copy(), information / variance[:, None, None], noise)


def limited_information(information: Array, finest: float) -> Array:
    """Information, shape (n, 2, 2), of positions whose standard deviation is at least ``finest`` in every direction.

    Notes
    -----
    ``(J^-1 + s^2 1)^-1 = (J + s^2 det J 1) / (1 + s^2 tr J + s^4 det J)``, which holds for a singular J as well. NaN
    counts as no information.
    """
    known = np.where(np.isnan(information), 0.0, information)
    floor = finest**2
    determinant = known[:, 0, 0] * known[:, 1, 1] - known[:, 0, 1] ** 2
    trace = known[:, 0, 0] + known[:, 1, 1]
    result: Array = known + (floor * determinant)[:, None, None] * np.eye(2)
    result /= (1.0 + floor * (trace + floor * determinant))[:, None, None]
    return result
