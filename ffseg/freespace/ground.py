"""Motion read off the ground itself: points of the free space placed in both images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffseg.camera.model import Camera
from ffseg.camera.motion import MIN_INLIERS, Motion, Origin, fit_planar, ground_points, planar_motion
from ffseg.image.keypoints import Alignments, Array, Candidates, Grey, Mask, align_patches, plane_candidates
from ffseg.image.planes import eroded, halved

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
    camera: Camera, prior: Motion, current: Grey, previous: Grey, free: Mask, coarse: bool, origin: Origin
) -> Motion | None:
    """Correct a motion by a planar one so that ground points of the free space agree with both images.

    Parameters
    ----------
    camera : Camera
    prior : Motion
        Good to about 3 pixels, or 10 with `coarse`.
    current, previous : ndarray of uint8, shape (H, W)
    free : ndarray of bool, shape (H, W)
        Free space of the current image without its enclosed components.
    coarse : bool
        Look at half the resolution first.
    origin : str
        What the returned motion says of itself.

    Returns
    -------
    Motion or None
        None when the ground shows too little texture or too few of its points agree.
    """
    points = ground_grid(camera, free)
    motion = prior
    for half in (True, False, False) if coarse else (False, False):
        tracks = _track(camera, motion, (current, previous), points, half)
        refined = _fit(camera, motion, tracks, origin)
        if refined is None:
            return None
        moved = _predicted(camera, refined, tracks.ground, np.zeros(3)) - tracks.start
        motion = refined
        if not half and np.nanmedian(np.abs(moved)) < SETTLED:
            break
    return motion


def ground_grid(camera: Camera, free: Mask) -> Array:
    """A grid of pixels well inside the free space and outside the robot's disc, shape (n, 2)."""
    inside = eroded(free, CLEAR)
    first = GRID_STEP // 2
    rows, columns = np.nonzero(inside[first::GRID_STEP, first::GRID_STEP])
    points = np.stack([columns, rows], axis=1) * float(GRID_STEP) + first
    away = np.hypot(*(points - camera.center).T) > camera.robot_radius + CLEAR
    kept: Array = points[away]
    return kept


def textured_points(camera: Camera, grey: Grey, free: Mask) -> int:
    """Number of ground points whose patch could be placed at all: against itself, as the image stands."""
    points = ground_grid(camera, free)
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
    values, vectors = np.linalg.eigh(np.nan_to_num(information))
    variance = 1.0 / np.maximum(values, 1e-6) + FINEST_SIGMA**2
    bounded = np.einsum("nij,nj,nkj->nik", vectors, 1.0 / variance, vectors)
    return np.sqrt(variance.max(axis=1)), bounded


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
    slope = np.einsum("nji,njk->nik", root, _jacobian(camera, prior, tracks, parameters))
    covariance, inliers = None, 0
    for _ in range(ROUNDS):
        white = np.einsum("nji,nj->ni", root, _predicted(camera, prior, tracks.ground, parameters) - tracks.previous)
        kept = np.sum(white**2, axis=1) < GATE**2  # false for NaN
        inliers = int(kept.sum())
        if inliers < MIN_INLIERS:
            return parameters, None, inliers
        normal = np.einsum("nik,nil->kl", slope[kept], slope[kept])
        parameters = parameters - np.linalg.solve(normal, np.einsum("nik,ni->k", slope[kept], white[kept]))
        scale = max(1.0, float(np.sum(white[kept] ** 2)) / (2 * inliers - 3))
        covariance = np.linalg.inv(normal) * scale
    return parameters, covariance, inliers


def _jacobian(camera: Camera, prior: Motion, tracks: _Tracks, parameters: Array) -> Array:
    """d(previous pixel)/d(x, y, theta), shape (n, 2, 3), by differences; the motion changes too little to renew it."""
    base = _predicted(camera, prior, tracks.ground, parameters)
    columns = [_predicted(camera, prior, tracks.ground, parameters + step) - base for step in np.eye(3) * PROBE]
    return np.nan_to_num(np.stack(columns, axis=2) / PROBE)


def _predicted(camera: Camera, prior: Motion, ground: Array, parameters: Array) -> Array:
    """Previous pixels of levelled ground points after the planar correction, shape (n, 2)."""
    c, s = np.cos(parameters[2]), np.sin(parameters[2])
    moved = ground @ np.array([[c, s], [-s, c]]) + parameters[:2]
    level = np.column_stack([moved, np.full(len(moved), camera.mounting())])
    return camera.project(prior.apply(level @ camera.level()))
