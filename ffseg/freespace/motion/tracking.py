"""Points of the current image placed in the previous one, each with its precision."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ffseg.arrays import Array, Image, Indices
from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion
from ffseg.freespace.motion.candidates import FREE, GroundCandidates
from ffseg.image.keypoints import (
    Alignments,
    Candidates,
    align_patches,
    limited_information,
    patch_scores,
    plane_candidates,
)
from ffseg.image.planes import halved

Look = Literal["far", "half", "full"]

PATCH_RADIUS = 6
FAR_RADIUS = 4
MIN_SCORE = 0.35
"""Least correlation of a patch of 169 pixels; noise alone reaches it once in ten thousand, which the robust fit tolerates."""
NOISE_SLOPES = 0.2
"""Apparent information per pixel of a patch of pure noise: its own squared slopes over its variance."""
MAX_SIGMA = 0.7
"""Pixels, in the best direction: patches placed less precisely are dropped."""
MIN_SIGMA = 0.15
"""Pixels: smallest standard deviation of a placement; interpolation and the curvature of the warp leave this even on
strong texture."""
HALF_SIGMA, FAR_SIGMA = 0.5, 0.8
"""Pixels: the same at half the resolution, where an approximate prediction suffices, and after a wide search."""
FAR_STEPS = 8
"""Pixels at half the resolution: range of the wide search to each side."""
FAR_SCORE = 0.6
"""Least correlation of the best place of a wide search; over 289 places noise alone reaches 0.45."""
TINY = 1e-12
"""1/px^2, added where a placement has no information in a direction, to avoid 0/0."""
FAINT = 1e-9
"""1/px^2, added to keep the information of a placement along an edge from being singular."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackedPoints:
    """Placed points.

    Attributes
    ----------
    current, start, previous : ndarray of float64, shape (n, 2)
        In the current image, where the previous one was expected to show them, and where it does.
    information : ndarray of float64, shape (n, 2, 2)
        Inverse covariance of ``previous``, 1/px^2.
    owner : ndarray of int, shape (n,)
    num_expected : int
        Points that should have been placed: all but those of the free space without texture.
    """

    current: Array
    start: Array
    previous: Array
    information: Array
    owner: Indices
    num_expected: int


def track_points(
    camera: Camera, motion: Motion, pair: tuple[Image, Image], candidates: GroundCandidates, look: Look
) -> TrackedPoints:
    """Place points, starting from where the ground would put them.

    Parameters
    ----------
    camera, motion
    pair : tuple of ndarray
        Current and previous image.
    look : str
        ``far``, ``half`` or ``full``.
    """
    there = plane_candidates(camera, motion, candidates.pixels, np.zeros(1))
    seen = np.isfinite(there.pixels[:, 0]).all(axis=1) & np.isfinite(there.warps[:, 0]).all(axis=1)
    points, owner = candidates.pixels[seen], candidates.owner[seen]
    expected = Candidates(there.pixels[seen], there.warps[seen])
    if look == "full":
        found = align_patches(*pair, points, expected, PATCH_RADIUS)
        information = placement_information(found, PATCH_RADIUS, MIN_SIGMA)
    else:
        found, information = _halved(pair, points, expected, look)
    half, skew, both = _symmetric(information)
    sure = half + np.hypot(skew, both) > MAX_SIGMA**-2 * (1.0 if look == "full" else 0.25)
    good = (found.score > MIN_SCORE) & sure & np.isfinite(found.pixels).all(axis=1)
    num_expected = int(np.count_nonzero(good | (owner != FREE)))
    information = information[good] + FAINT * np.eye(2)
    return TrackedPoints(
        points[good], expected.pixels[good, 0], found.pixels[good], information, owner[good], num_expected
    )


def placement_information(found: Alignments, radius: int, finest: float) -> Array:
    """Information of placements in excess of that of pure noise, and no finer than `finest` pixels."""
    pretended = NOISE_SLOPES * (2 * radius + 1) ** 2 * found.noise
    information, pretended = np.nan_to_num(found.information), np.nan_to_num(pretended)
    half, skew, both = _symmetric(information)
    length = np.hypot(skew, both)
    large, small = (np.maximum(half + sign * length - pretended, 0.0) for sign in (1.0, -1.0))
    mean, bend = 0.5 * (large + small), 0.5 * (large - small) / np.maximum(length, TINY)
    rows = [mean + bend * skew, bend * both, bend * both, mean - bend * skew]
    return limited_information(np.stack(rows, axis=1).reshape(-1, 2, 2), finest)


def _symmetric(information: Array) -> tuple[Array, Array, Array]:
    """Mean and half the difference of the diagonal, and the corner, of matrices of shape (n, 2, 2)."""
    a, b, _, d = information.reshape(-1, 4).T
    return 0.5 * (a + d), 0.5 * (a - d), b


def _halved(pair: tuple[Image, Image], points: Array, expected: Candidates, look: Look) -> tuple[Alignments, Array]:
    """Placements at half the resolution, in pixels of the full image."""
    small = halved(pair[0]), halved(pair[1])
    start, sigma = Candidates(expected.pixels / 2.0, expected.warps), HALF_SIGMA
    if look == "far":
        start, sigma = _searched(small, points / 2.0, start), FAR_SIGMA
    found = align_patches(*small, points / 2.0, start, PATCH_RADIUS)
    information = placement_information(found, PATCH_RADIUS, sigma / 2.0) / 4.0
    return Alignments(found.pixels * 2.0, found.score, found.information / 4.0, found.noise), information


def _searched(small: tuple[Image, Image], points: Array, start: Candidates) -> Candidates:
    """The best place of each point within ``FAR_STEPS`` of its prediction; NaN without one."""
    axis = np.arange(-FAR_STEPS, FAR_STEPS + 1.0)
    steps = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    places = start.pixels + steps
    warps = np.broadcast_to(start.warps, (len(points), len(steps), 4))
    scores = np.nan_to_num(patch_scores(*small, points, Candidates(places, warps), FAR_RADIUS, 0.4), nan=-1.0)
    rows, best = np.arange(len(points)), np.argmax(scores, axis=1)
    found = np.where((scores[rows, best] > FAR_SCORE)[:, None], places[rows, best], np.nan)
    return Candidates(found[:, None], start.warps)
