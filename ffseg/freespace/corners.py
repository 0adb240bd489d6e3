"""Corners of components, matched along their epipolar curves and triangulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ffseg.arrays import Array, Indices, Mask
from ffseg.freespace.motion.candidates import MAX_CORNERS
from ffseg.freespace.pairs import MIN_SCORE, NOISE_PX, ImagePair, MotionUncertainty, propagated
from ffseg.image.components import Component
from ffseg.image.interest import InterestPoints, harris_points
from ffseg.image.keypoints import Candidates, align_patches, patch_scores, plane_candidates

CORNER_RADIUS = 4
MIN_COARSE_CORRELATION = 0.5
"""Correlation of every second row and column of a patch below which the full patch cannot reach that of a right match."""
RIVAL_DISTANCE = 2.5
"""Pixels: a second peak farther from the best one than this is another place."""
RIVAL_MARGIN = 0.03
"""Difference in correlation below which a second peak makes a match ambiguous; ambiguous matches are dropped."""
REPROJECTION_GATE = 2.0
"""Pixels across the epipolar curve: rays may miss each other by one pixel in each image."""


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Interest points with their matches.

    Attributes
    ----------
    owner : ndarray of int, shape (n,)
        Position of the point's component in the list.
    current, previous : ndarray of float64, shape (n, 2)
        Pixels.
    altitude, altitude_sigma : ndarray of float64, shape (n,)
        Metres.
    good : ndarray of bool, shape (n,)
        Unique, similar and consistent with the motion.
    """

    owner: Indices
    current: Array
    previous: Array
    altitude: Array
    altitude_sigma: Array
    good: Mask


def match_corners(
    pair: ImagePair,
    components: Sequence[Component],
    epsilon: float,
    uncertainty: MotionUncertainty | None = None,
    corners: InterestPoints | None = None,
) -> Matches:
    """Match Harris corners of components along their epipolar curves and triangulate them.

    Along its curve a match is as high as the plane that puts the corner there, and the nearness of that plane (one over
    its distance from the camera) grows evenly with the way along the curve.
    """
    found = harris_points(pair.current, components, MAX_CORNERS) if corners is None else corners
    start, rate, nearness, unique = _sweep(pair, found.pixels, epsilon)
    aligned = align_patches(pair.current, pair.previous, found.pixels, start, CORNER_RADIUS)
    moved, covariance = propagated(pair, found, uncertainty)
    step = aligned.pixels - start.pixels[:, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        square = np.sum(rate**2, axis=1)
        along = np.sum(rate * (step - moved), axis=1) / square
        miss = np.sqrt(np.sum((step - moved - along[:, None] * rate) ** 2, axis=1))
        near = nearness + along
        altitude = pair.camera.mounting() - 1.0 / near
        sigma = np.sqrt(_match_variance(rate, start.warps[:, 0], covariance)) / (square * near**2)
    stayed = np.sum(step**2, axis=1) < RIVAL_DISTANCE**2
    good = unique & stayed & (aligned.score > MIN_SCORE) & (miss < REPROJECTION_GATE) & (near > 0)
    good &= np.isfinite(altitude) & np.isfinite(sigma)
    return Matches(found.owner, found.pixels, aligned.pixels, altitude, sigma, good)


def _match_variance(rate: Array, warps: Array, covariance: Array) -> Array:
    """Variance of ``rate . place``: noise of both images (the current one's warped), and uncertainty of the ground."""
    back = np.stack(
        [rate[:, 0] * warps[:, 0] + rate[:, 1] * warps[:, 2], rate[:, 0] * warps[:, 1] + rate[:, 1] * warps[:, 3]],
        axis=1,
    )
    noise = NOISE_PX**2 * (np.sum(rate**2, axis=1) + np.sum(back**2, axis=1))
    doubt = np.einsum("ni,nij,nj->n", rate, covariance, rate)
    variance: Array = noise + doubt
    return variance


MAX_ALTITUDE = 0.7
"""Fraction of the mount height up to which altitudes are tested: above it a pixel shows the far wall beyond an object's
top."""
FINE_STEPS, COARSE_STEPS = 6, 21


@lru_cache(maxsize=4)
def _altitudes(mounting: float, epsilon: float) -> Array:
    """Tested altitudes: fine near the ground, then evenly spaced in parallax up to ``MAX_ALTITUDE``."""
    fine = np.linspace(-epsilon, epsilon, FINE_STEPS)
    nearness = np.linspace(1.0 / (mounting - epsilon), 1.0 / (mounting * (1.0 - MAX_ALTITUDE)), COARSE_STEPS + 1)[1:]
    altitudes: Array = np.concatenate([fine, mounting - 1.0 / nearness])
    altitudes.setflags(write=False)
    return altitudes


def _sweep(pair: ImagePair, points: Array, epsilon: float) -> tuple[Candidates, Array, Array, Mask]:
    """Best candidate of each point over all altitudes, and how it moves.

    Returns the candidate, the rate at which its place moves with the nearness, that nearness, and whether no other place
    rivals it.
    """
    mounting = pair.camera.mounting()
    altitudes = _altitudes(mounting, epsilon)
    candidates = plane_candidates(pair.camera, pair.motion, points, altitudes)
    scores = patch_scores(pair.current, pair.previous, points, candidates, CORNER_RADIUS, MIN_COARSE_CORRELATION)
    scores[np.isnan(scores)] = -1.0
    best = np.argmax(scores, axis=1) if scores.size else np.zeros(len(points), np.intp)
    rows, nearness = np.arange(len(points)), 1.0 / (mounting - altitudes)
    place, warp = candidates.pixels[rows, best], candidates.warps[rows, best]
    low, high = np.maximum(best - 1, 0), np.minimum(best + 1, len(altitudes) - 1)
    rate = candidates.pixels[rows, high] - candidates.pixels[rows, low]
    rate /= (nearness[high] - nearness[low])[:, None]
    top = scores[rows, best]
    step = candidates.pixels - place[:, None]
    away = step[..., 0] ** 2 + step[..., 1] ** 2 > RIVAL_DISTANCE**2
    rival = np.where(away, scores, -1.0).max(axis=1, initial=-1.0)
    unique = (top > 0) & (rival < top - RIVAL_MARGIN)
    return Candidates(place[:, None], warp[:, None]), rate, nearness[best], unique
