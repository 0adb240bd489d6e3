"""Samples of components' outlines, tested for lying on the ground."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ffseg.arrays import Array, Image, Indices, Mask
from ffseg.freespace.pairs import MIN_SCORE, MIN_SIGMAS, NOISE_PX, ImagePair, MotionUncertainty, propagated
from ffseg.image.components import Component
from ffseg.image.interest import outline_points
from ffseg.image.keypoints import Alignments, Candidates, align_patches, limited_information, plane_candidates

MAX_SAMPLES = 22
"""Outline samples per component: one per few pixels of a mark of medium size."""
OUTLINE_RADIUS = 3
OUTLINE_STEPS = 4
"""Iterations: a sample on the ground starts at its place and takes two; one that needs more is not on the ground."""
MISS_GATE = 16.0
"""Four standard deviations across the epipolar curve."""
MAX_NOISE = 0.08
"""Largest noise of a sample as a fraction of its contrast: with twice as much, right matches fall below ``MIN_SCORE``."""


def outline_votes(
    pair: ImagePair,
    components: Sequence[Component],
    epsilon: float,
    uncertainty: MotionUncertainty,
    samples: list[Array] | None = None,
) -> tuple[Indices, Indices]:
    """Samples of each component's edges that lie on the ground, and those that do not.

    A sample is aligned from where the ground would put it. Its displacement along the epipolar curve is an altitude,
    as certain as the edge crosses the curve; across the curve it must be small. Samples that cannot tell are left out.
    """
    found = outline_points(pair.current, components, MAX_SAMPLES)
    ground = plane_candidates(pair.camera, pair.motion, found.pixels, np.array([0.0, epsilon]))
    start = Candidates(ground.pixels[:, :1], ground.warps[:, :1])
    aligned = align_patches(pair.current, pair.previous, found.pixels, start, OUTLINE_RADIUS, OUTLINE_STEPS)
    shift, covariance = propagated(pair, found, uncertainty)
    flat, raised = _judge(aligned, ground, shift, covariance)
    tells = pair.noise**2 < MAX_NOISE * _contrast(pair.current, found.pixels)
    flat, raised, count = flat & tells, raised & tells, len(components)
    if samples is not None:
        samples.append(np.column_stack([found.pixels, flat.astype(np.float64) - raised]))
    return np.bincount(found.owner[flat], minlength=count), np.bincount(found.owner[raised], minlength=count)


def _contrast(grey: Image, pixels: Array) -> Array:
    """Variance of the pixels round each sample, squared grey levels."""
    steps = np.arange(-OUTLINE_RADIUS, OUTLINE_RADIUS + 1)
    columns, rows = np.rint(pixels).astype(np.intp).T[..., None] + steps
    rows, columns = np.clip(rows, 0, grey.shape[0] - 1), np.clip(columns, 0, grey.shape[1] - 1)
    around = grey[rows[:, :, None], columns[:, None, :]].reshape(len(pixels), len(steps) ** 2).astype(np.float64)
    mean = around.mean(axis=1)
    variance: Array = np.einsum("ni,ni->n", around, around) / around.shape[1] - mean * mean
    return variance


def _judge(aligned: Alignments, ground: Candidates, moved: Array, covariance: Array) -> tuple[Mask, Mask]:
    shift = aligned.pixels - ground.pixels[:, 0] - moved
    parallax = ground.pixels[:, 1] - ground.pixels[:, 0]
    information = limited_information(aligned.information, NOISE_PX)
    # (J^-1 + C)^-1, which holds for an edge's singular J as well.
    information = information @ _inverse(np.eye(2) + covariance @ information)
    weighted = np.einsum("nij,nj->ni", information, parallax)
    certainty = np.sum(weighted * parallax, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        altitude = np.sum(weighted * shift, axis=1) / certainty
        sigma = 1.0 / np.sqrt(certainty)
        left = shift - altitude[:, None] * parallax
        miss = np.einsum("ni,nij,nj->n", left, information, left)
        similar = aligned.score > MIN_SCORE
        raised = ~similar | (np.abs(altitude) - MIN_SIGMAS * sigma > 1.0) | (miss > MISS_GATE)
        flat = similar & (np.abs(altitude) + MIN_SIGMAS * sigma < 1.0) & ~raised
    seen = np.isfinite(aligned.score) & np.isfinite(parallax).all(axis=1)
    return flat & seen, raised & seen


def _inverse(matrices: Array) -> Array:
    """Inverses of matrices, shape (n, 2, 2), in closed form: a tenth of the time of the general routine."""
    a, b, c, d = matrices.reshape(-1, 4).T
    adjugate = np.stack([d, -b, -c, a], axis=1).reshape(-1, 2, 2)
    result: Array = adjugate / (a * d - b * c)[:, None, None]
    return result
