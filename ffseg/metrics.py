"""How well a region agrees with its truth: overlap and boundary distances."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Array, Image, Mask
from ffseg.native import _core

INSIDE, IGNORED, OUTSIDE = 255, 128, 0
"""Grey levels of a truth image: the region, what does not count, and all else; any other level is outside too."""

BOUNDARY_TOLERANCE = 2.0
"""Pixels within which a boundary point counts as found (boundary F)."""


@dataclass(frozen=True, slots=True)
class Scores:
    """Agreement of a region with its truth.

    Attributes
    ----------
    iou : float
        Pixels in both over pixels in either; 1 when both are empty.
    boundary_mean : float
        Pixels; mean of the two means of the distances from either boundary to the other. NaN when one is empty.
    boundary_max : float
        Pixels; the largest of these distances (Hausdorff). NaN when one is empty.
    boundary_f : float
        Harmonic mean of the shares of either boundary within `BOUNDARY_TOLERANCE` of the other; where neither has any,
        1 for equal regions and 0 for others. NaN where the truth has an inside and an outside, but only ignored pixels
        between them.
    """

    iou: float
    boundary_mean: float
    boundary_max: float
    boundary_f: float


def scores(mask: Mask, truth: Image) -> Scores:
    """Compare a region with a truth image.

    Parameters
    ----------
    mask : ndarray of bool, shape (H, W)
    truth : ndarray of uint8, shape (H, W)
        255 inside, 128 ignored, else outside.

    Raises
    ------
    ValueError
        If the sizes differ.

    Notes
    -----
    The boundary of either region is the set of the midpoints of the sides between a pixel inside and a pixel outside,
    sides at ignored pixels and at the image border left out. It is taken from the mask for every method, also for one
    that gives sub-pixel contours: the truth is known on the pixel grid only, which would charge an exact contour the
    quarter of a pixel that the grid is off.
    """
    if mask.shape != truth.shape:
        raise ValueError(f"the mask has shape {mask.shape}, the truth {truth.shape}")
    counted, inside = truth != IGNORED, truth == INSIDE
    found, true_boundary, overlap = boundary(mask, counted), boundary(inside, counted), iou(mask, truth)
    if len(found) and len(true_boundary):
        return Scores(overlap, *_boundary_scores(found, true_boundary))
    if not len(true_boundary) and inside.any() and (counted & ~inside).any():
        return Scores(overlap, math.nan, math.nan, math.nan)
    return Scores(overlap, math.nan, math.nan, 0.0 if len(found) or len(true_boundary) else float(overlap == 1))


def iou(mask: Mask, truth: Image) -> float:
    """Intersection over union on the pixels that count; 1 when both are empty."""
    inside = truth == INSIDE
    counted = truth != IGNORED
    either = np.count_nonzero((mask | inside) & counted)
    return float(np.count_nonzero(mask & inside) / either) if either else 1.0


def boundary(mask: Mask, counted: Mask) -> Array:
    """Midpoints (x, y), shape (M, 2), of the sides between inside and outside where both pixels count."""
    across = (mask[:, 1:] != mask[:, :-1]) & counted[:, 1:] & counted[:, :-1]
    down = (mask[1:] != mask[:-1]) & counted[1:] & counted[:-1]
    y, x = np.nonzero(across)
    v, u = np.nonzero(down)
    return np.concatenate([np.stack([x + 0.5, y], axis=1), np.stack([u, v + 0.5], axis=1)]).astype(np.float64)


def _boundary_scores(found: Array, true_boundary: Array) -> tuple[float, float, float]:
    out, back = _core.nearest_distances(found, true_boundary), _core.nearest_distances(true_boundary, found)
    precision = float((out <= BOUNDARY_TOLERANCE).mean())
    recall = float((back <= BOUNDARY_TOLERANCE).mean())
    f = 2 * precision * recall / (precision + recall) if precision + recall else 0.0
    return float(out.mean() + back.mean()) / 2, float(max(out.max(), back.max())), f
