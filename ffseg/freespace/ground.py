"""Motion read off the ground itself: a search over the whole ground plane, and its refinement on ground points."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion, Origin, fit_planar, ground_points, planar_motion
from ffseg.image.keypoints import Alignments, Array, Grey, Mask, align_patches, plane_candidates

GRID_STEP = 20
"""Pixels between ground points: about 200 of them in the free space of an 800x600 image."""
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
LEAST_SHARE = 0.4
"""Share of well-placed points that must agree: the rest is what moves, shines or stands up."""


@dataclass(frozen=True, slots=True, eq=False)
class _Tracks:
    """Ground points of the current image and where they were found in the previous one."""

    current: Array
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
    for halved in (True, False) if coarse else (False,):
        tracks = _track(camera, motion, (current, previous), points, halved)
        refined = _fit(camera, motion, tracks, origin)
        if refined is None:
            return None
        motion = refined
    return motion


def ground_grid(camera: Camera, free: Mask) -> Array:
    """A grid of pixels well inside the free space and outside the robot's disc, shape (n, 2)."""
    size = 2 * CLEAR + 1
    inside = cv2.erode(free.view(np.uint8), np.ones((size, size), np.uint8), borderValue=0)
    first = GRID_STEP // 2
    rows, columns = np.nonzero(inside[first::GRID_STEP, first::GRID_STEP])
    points = np.stack([columns, rows], axis=1) * float(GRID_STEP) + first
    away = np.hypot(*(points - camera.center).T) > camera.robot_radius + CLEAR
    return points[away]


def _track(camera: Camera, motion: Motion, pair: tuple[Grey, Grey], points: Array, halved: bool) -> _Tracks:
    candidates = plane_candidates(camera, motion, points, np.zeros(1))
    seen = ~np.isnan(candidates.pixels[:, 0, 0])
    points = points[seen]
    start = type(candidates)(candidates.pixels[seen], candidates.warps[seen])
    if halved:
        small = [cv2.pyrDown(image) for image in pair]
        start = type(start)(start.pixels / 2.0, start.warps)
        found = align_patches(small[0], small[1], points / 2.0, start, PATCH_RADIUS)
        found = Alignments(found.pixels * 2.0, found.score, found.information / 4.0)
    else:
        found = align_patches(*pair, points, start, PATCH_RADIUS)
    spread, information = _placed(found.information)
    good = (found.score > LEAST_SCORE) & (spread < WORST_SIGMA * (2.0 if halved else 1.0))
    ground = ground_points(camera, points[good])
    return _Tracks(points[good], ground, found.pixels[good], information[good])


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
    """Where previous pixels lie on the ground of the current camera if `motion` holds, levelled metres, shape (n, 2)."""
    ways = camera.lift(previous) @ motion.rotation
    center = -motion.rotation.T @ motion.translation
    fall = -(ways @ camera.up)
    with np.errstate(invalid="ignore", divide="ignore"):
        reach = np.where(fall > 0, (camera.mounting() + center @ camera.up) / fall, np.nan)
    points: Array = ((center + ways * reach[:, None]) @ camera.level().T)[:, :2]
    return points


def _polish(
    camera: Camera, prior: Motion, tracks: _Tracks, parameters: Array
) -> tuple[Array, Array | None, int]:
    """Gauss-Newton on whitened pixel residuals with a hard gate; parameters, covariance and number of inliers."""
    root = np.linalg.cholesky(tracks.information)
    covariance, inliers = None, 0
    for _ in range(ROUNDS):
        residual = _residual(camera, prior, tracks, parameters)
        jacobian = np.stack(
            [(_residual(camera, prior, tracks, parameters + probe) - residual) / 1e-5 for probe in np.eye(3) * 1e-5],
            axis=2,
        )
        white = np.einsum("nji,nj->ni", root, residual)
        slope = np.einsum("nji,njk->nik", root, jacobian)
        kept = np.sum(white**2, axis=1) < GATE**2
        inliers = int(kept.sum())
        if inliers < 8:
            return parameters, None, inliers
        normal = np.einsum("nik,nil->kl", slope[kept], slope[kept])
        parameters = parameters - np.linalg.solve(normal, np.einsum("nik,ni->k", slope[kept], white[kept]))
        scale = max(1.0, float(np.sum(white[kept] ** 2)) / (2 * inliers - 3))
        covariance = np.linalg.inv(normal) * scale
    return parameters, covariance, inliers


def _residual(camera: Camera, prior: Motion, tracks: _Tracks, parameters: Array) -> Array:
    """Predicted less found pixels of the previous image, shape (n, 2); points that would not be seen count as far off."""
    c, s = np.cos(parameters[2]), np.sin(parameters[2])
    moved = tracks.ground @ np.array([[c, s], [-s, c]]) + parameters[:2]
    level = np.column_stack([moved, np.full(len(moved), _drop(camera))])
    predicted = camera.project(prior.apply(level @ camera.level()))
    return np.nan_to_num(predicted - tracks.previous, nan=1e6)


def _drop(camera: Camera) -> float:
    """Depth of the ground below the camera along the levelled z axis, metres."""
    return camera.mounting()


CELL = 0.075
"""Metres; the search lands within half a cell, which the half-resolution refinement reaches."""
CELLS = 64
PADDED = 96
"""Cells of the transform: shifts of up to 32 cells (2.4 m) do not wrap."""
TURNS = np.deg2rad(np.arange(-30.0, 30.1, 1.5))
"""Rotations tried between two images: a robot that turns faster needs poses."""
CLIP = 2.0
"""Standard deviations of the ground's own texture at which a cell is cut: paint and boxes weigh no more than ground."""
LEAST_OVERLAP = 0.3
"""Share of the current cells that must find a partner."""
LEAST_PEAK = 0.15
"""Correlation of the two grounds below which the peak is no better than chance (over 41 x 4000 trials it reaches 0.1)."""


def search_ground_motion(camera: Camera, current: Grey, previous: Grey, free: Mask) -> Motion | None:
    """Planar motion that lays the current ground on the previous one: correlation over all turns and shifts.

    Returns
    -------
    Motion or None
        Within half a cell; None without a peak that stands out.
    """
    cells, pixels = _cells(camera)
    now, now_mask = _ground_view(camera, current, pixels, free)
    then, then_mask = _ground_view(camera, previous, pixels, camera.domain())
    size = (PADDED, PADDED)
    seen = [np.fft.rfft2(part, size) for part in (then * then_mask, then**2 * then_mask, then_mask)]
    best, place = LEAST_PEAK, None
    for turn in TURNS:
        surface = _correlation(_turned(now, turn), _turned(now_mask, turn), seen)
        at = np.unravel_index(np.argmax(surface), size)
        if surface[at] > best:
            best, place = float(surface[at]), (turn, _shift(surface, at))
    if place is None:
        return None
    turn, (dy, dx) = place
    return planar_motion(camera, np.array([dx * CELL, dy * CELL, turn]), "ground points", 0, (CELL, TURNS[1] - TURNS[0]))


def _cells(camera: Camera) -> tuple[Array, NDArray[np.float32]]:
    """Ground points of a square raster round the camera and their pixels."""
    axis = (np.arange(CELLS) - (CELLS - 1) / 2.0) * CELL
    x, y = np.meshgrid(axis, axis)
    points = np.stack([x, y, np.full_like(x, _drop(camera))], axis=-1)
    pixels = camera.project(points @ camera.level())
    return points[..., :2], np.nan_to_num(pixels, nan=-1e4).astype(np.float32)


def _ground_view(camera: Camera, grey: Grey, pixels: NDArray[np.float32], mask: Mask) -> tuple[Array, Array]:
    """Clipped high-pass view of the ground from above, and where it is known."""
    smooth = cv2.GaussianBlur(grey, (0, 0), 3.0)
    view = cv2.remap(smooth, pixels, None, cv2.INTER_LINEAR).astype(np.float64)
    known = cv2.remap(mask.view(np.uint8), pixels, None, cv2.INTER_NEAREST).astype(np.float64)
    away = np.hypot(pixels[..., 0] - camera.center[0], pixels[..., 1] - camera.center[1])
    known[away < camera.robot_radius + CLEAR] = 0.0
    weight = cv2.GaussianBlur(known, (0, 0), 4.0) + 1e-6
    high = (view - cv2.GaussianBlur(view * known, (0, 0), 4.0) / weight) * known
    scale = 1.4826 * np.median(np.abs(high[known > 0])) if known.any() else 0.0
    return np.clip(high, -CLIP * scale, CLIP * scale), known


def _turned(view: Array, turn: float) -> Array:
    """The view turned about the camera by `turn`."""
    c, s, middle = np.cos(turn), np.sin(turn), (CELLS - 1) / 2.0
    matrix = np.array([[c, -s, middle * (1 - c + s)], [s, c, middle * (1 - s - c)]])
    turned: Array = cv2.warpAffine(view, matrix, (CELLS, CELLS), flags=cv2.INTER_LINEAR)
    return turned


def _correlation(view: Array, mask: Array, seen: list[NDArray[np.complex128]]) -> Array:
    """Normalised correlation of the masked view with the previous one for every shift (rows, columns)."""
    size = (PADDED, PADDED)
    masked, squares, own = (np.fft.rfft2(part, size).conj() for part in (view * mask, view**2 * mask, mask))
    product = np.fft.irfft2(masked * seen[0], size)
    energy = np.fft.irfft2(squares * seen[2], size) * np.fft.irfft2(own * seen[1], size)
    overlap = np.fft.irfft2(own * seen[2], size)
    enough = (overlap > LEAST_OVERLAP * max(1.0, float(mask.sum()))) & (energy > 0)
    return np.where(enough, product / np.sqrt(np.where(enough, energy, 1.0)), -1.0)


def _shift(surface: Array, at: tuple[np.intp, ...]) -> tuple[float, float]:
    """Signed shift of a peak with the vertex of a parabola per axis."""
    result = []
    for axis in (0, 1):
        line = np.take(surface, at[1 - axis], axis=1 - axis)
        before, middle, after = (float(line[(at[axis] + step) % PADDED]) for step in (-1, 0, 1))
        bend = before + after - 2.0 * middle
        offset = 0.5 * (before - after) / bend if bend < 0 else 0.0
        index = int(at[axis])
        result.append((index if index <= PADDED // 2 else index - PADDED) + float(np.clip(offset, -0.5, 0.5)))
    return result[0], result[1]
