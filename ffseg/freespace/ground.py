"""Motion read off the ground itself: points of the free space placed in both images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffseg.camera.model import Camera
from ffseg.camera.motion import MIN_INLIERS, Motion, Origin, fit_planar, ground_points, planar_motion
from ffseg.image.keypoints import (
    Alignments,
    Array,
    Candidates,
    Grey,
    Mask,
    align_patches,
    limited,
    plane_candidates,
)  # fmt: skip
from ffseg.image.planes import halved

GRID_STEP = 28
"""Pixels between ground points: some 130 of them in the free space of an 800x600 image."""
PATCH_RADIUS = 6
CLEAR = 10
"""Pixels a ground point keeps from everything that is not free space: its patch must show ground only."""
LEAST_SCORE = 0.6
"""Correlation of a low-contrast ground patch with itself under sensor noise stays above this."""
WORST_SIGMA = 0.7
"""Pixels; a patch that cannot be placed better says nothing."""
FINEST_SIGMA = 0.15
"""Pixels; interpolation and the small curvature of the warp leave this even on strong texture."""
GATE = 3.5
"""Standard deviations of a whitened residual."""
ROUNDS = 4
STILL = 1e-6
"""Metres and radians; a hundredth of what the ground resolves at best."""
SETTLED = 0.3
"""Pixels a motion may have changed its predictions by for the alignments made from them to stand."""
PROBE = 1e-5
"""Metres and radians; far above rounding, far below curvature."""
LEAST_SHARE = 0.4
"""Share of well-placed points that must agree: the rest is what moves, shines or stands up."""


@dataclass(frozen=True, slots=True, eq=False)
class _Tracks:
    """Ground points of the current image and where they were found in the previous one."""

    current: Array
    start: Array
    ground: Array
    previous: Array
    information: Array


def refine_on_ground(
    camera: Camera, prior: Motion, pair: tuple[Grey, Grey], points: Array, coarse: bool, origin: Origin
) -> Motion | None:
    """Correct a motion by a planar one so that ground points of the free space agree with both images.

    Parameters
    ----------
    camera : Camera
    prior : Motion
        Good to about 3 pixels, or 10 with `coarse`.
    pair : tuple of ndarray of uint8, shape (H, W)
        Current and previous image.
    points : ndarray of float64, shape (n, 2)
        Pixels of the current image that show ground, from `ground_grid`.
    coarse : bool
        Look at half the resolution first.
    origin : str
        What the returned motion says of itself.

    Returns
    -------
    Motion or None
        None when the ground shows too little texture or too few of its points agree.
    """
    motion = prior
    for half in (True, False, False) if coarse else (False, False):
        tracks = _track(camera, motion, pair, points, half)
        refined = _fit(camera, motion, tracks, origin)
        if refined is None:
            return None
        moved = _predicted(camera, refined, tracks.ground, np.zeros((1, 3)))[0] - tracks.start
        motion = refined
        if not half and np.nanmedian(np.abs(moved)) < SETTLED:
            break
    return motion


def ground_grid(camera: Camera, free: Mask) -> Array:
    """A grid of pixels well inside the free space and outside the robot's disc, shape (n, 2)."""
    first, size = GRID_STEP // 2, 2 * CLEAR + 1
    if min(free.shape) < size:
        return np.empty((0, 2))
    around = np.lib.stride_tricks.sliding_window_view(free, (size, size))
    rows, columns = np.nonzero(around[first - CLEAR :: GRID_STEP, first - CLEAR :: GRID_STEP].all(axis=(2, 3)))
    points = np.stack([columns, rows], axis=1) * float(GRID_STEP) + first
    away = np.hypot(*(points - camera.center).T) > camera.robot_radius + CLEAR
    kept: Array = points[away]
    return kept


def textured_points(grey: Grey, points: Array) -> int:
    """Number of points whose patch could be placed at all: against itself, as the image stands."""
    unit = np.tile([1.0, 0.0, 0.0, 1.0], (len(points), 1, 1))
    found = align_patches(grey, grey, points, Candidates(points[:, None], unit), PATCH_RADIUS, steps=0)
    return int(np.sum(_placed(found.information)[0] < WORST_SIGMA))


def _track(camera: Camera, motion: Motion, pair: tuple[Grey, Grey], points: Array, half: bool) -> _Tracks:
    candidates = plane_candidates(camera, motion, points, np.zeros(1))
    seen = ~np.isnan(candidates.pixels[:, 0, 0])
    points = points[seen]
    start = Candidates(candidates.pixels[seen], candidates.warps[seen])
    placed = start.pixels[:, 0]
    if half:
        small = [halved(image) for image in pair]
        start = Candidates(start.pixels / 2.0, start.warps)
        found = align_patches(small[0], small[1], points / 2.0, start, PATCH_RADIUS)
        found = Alignments(found.pixels * 2.0, found.score, found.information / 4.0)
    else:
        found = align_patches(*pair, points, start, PATCH_RADIUS)
    spread, information = _placed(found.information)
    good = (found.score > LEAST_SCORE) & (spread < WORST_SIGMA * (2.0 if half else 1.0))
    ground = ground_points(camera, points[good])
    return _Tracks(points[good], placed[good], ground, found.pixels[good], information[good])


def _placed(information: Array) -> tuple[Array, Array]:
    """Larger standard deviation of each placement, pixels, and its information bounded by ``FINEST_SIGMA``."""
    bounded = limited(information, FINEST_SIGMA)
    half, skew = (0.5 * (bounded[:, 0, 0] + sign * bounded[:, 1, 1]) for sign in (1, -1))
    least = half - np.hypot(skew, bounded[:, 0, 1])
    return 1.0 / np.sqrt(np.maximum(least, LEAST_INFORMATION)), bounded


LEAST_INFORMATION = 1e-6
"""1/px^2: a kilopixel of uncertainty stands for a place of which nothing is known."""


def _fit(camera: Camera, prior: Motion, tracks: _Tracks, origin: Origin) -> Motion | None:
    """Planar correction of `prior` by RANSAC in metres, then by least squares in pixels."""
    measured = _back_on_ground(camera, prior, tracks.previous)
    step = np.array([[1.0, 0.0], [0.0, 1.0]])
    stretch = ground_points(camera, (tracks.current[:, None] + step).reshape(-1, 2)).reshape(-1, 2, 2)
    metres = np.sqrt(np.sum((stretch - tracks.ground[:, None]) ** 2, axis=2)).max(axis=1)
    usable = np.isfinite(measured).all(axis=1) & np.isfinite(metres)
    fit = fit_planar(tracks.ground[usable], measured[usable], metres[usable] * WORST_SIGMA)
    if fit is None:
        return None
    parameters, covariance, inliers = _polish(camera, prior, tracks, fit.parameters)
    if covariance is None or inliers < LEAST_SHARE * max(1, len(tracks.current)):
        return None
    sigma = (float(np.sqrt(covariance[[0, 1], [0, 1]].max())), float(np.sqrt(covariance[2, 2])))
    return _compose(prior, planar_motion(camera, parameters, origin, inliers, sigma))


def _compose(prior: Motion, correction: Motion) -> Motion:
    """First the correction, then the prior; what is said of the result comes from the correction."""
    return Motion(
        prior.rotation @ correction.rotation, prior.apply(correction.translation),
        correction.origin, correction.inliers, correction.translation_sigma, correction.rotation_sigma,
    )  # fmt: skip


def _back_on_ground(camera: Camera, motion: Motion, previous: Array) -> Array:
    """Where previous pixels lie on the current camera's ground if `motion` holds: levelled metres, shape (n, 2)."""
    ways = camera.lift(previous) @ motion.rotation
    center = -motion.rotation.T @ motion.translation
    fall = -(ways @ camera.up)
    with np.errstate(invalid="ignore", divide="ignore"):
        reach = np.where(fall > 0, (camera.mounting() + center @ camera.up) / fall, np.nan)
    points: Array = ((center + ways * reach[:, None]) @ camera.level().T)[:, :2]
    return points


def _polish(camera: Camera, prior: Motion, tracks: _Tracks, parameters: Array) -> tuple[Array, Array | None, int]:
    """Gauss-Newton on whitened pixel residuals with a hard gate; parameters, covariance and number of inliers."""
    root = np.linalg.cholesky(tracks.information)
    slope = np.swapaxes(root, 1, 2) @ _jacobian(camera, prior, tracks, parameters)
    covariance, inliers = None, 0
    for _ in range(ROUNDS):
        miss = _predicted(camera, prior, tracks.ground, parameters[None])[0] - tracks.previous
        white = np.einsum("nji,nj->ni", root, miss)
        kept = np.sum(white**2, axis=1) < GATE**2  # false for NaN
        inliers = int(kept.sum())
        if inliers < MIN_INLIERS:
            return parameters, None, inliers
        lever, left = slope[kept].reshape(-1, 3), white[kept].ravel()
        normal = lever.T @ lever
        step = np.linalg.solve(normal, lever.T @ left)
        parameters = parameters - step
        covariance = np.linalg.inv(normal) * max(1.0, float(left @ left) / (2 * inliers - 3))
        if np.abs(step).max() < STILL:
            break
    return parameters, covariance, inliers


def _jacobian(camera: Camera, prior: Motion, tracks: _Tracks, parameters: Array) -> Array:
    """d(previous pixel)/d(x, y, theta), shape (n, 2, 3), by differences; the motion changes too little to renew it."""
    base, *moved = _predicted(camera, prior, tracks.ground, parameters + np.eye(4, 3, -1) * PROBE)
    slopes: Array = np.nan_to_num(np.stack([(one - base) / PROBE for one in moved], axis=2))
    return slopes


def _predicted(camera: Camera, prior: Motion, ground: Array, parameters: Array) -> Array:
    """Previous pixels, shape (v, n, 2), of levelled ground points after planar corrections, shape (v, 3)."""
    x, y, turn = parameters.T[..., None]
    moved = (ground @ [1.0, 1.0j]) * np.exp(1j * turn) + (x + 1j * y)
    level = np.stack([moved.real, moved.imag, np.full(moved.shape, camera.mounting())], axis=2)
    return camera.project(prior.apply(level @ camera.level()))
