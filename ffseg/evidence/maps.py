"""Edge maps from evidence: the probability of inside, or the strength of edges."""

from __future__ import annotations

from collections.abc import Callable
from math import log

import numpy as np

from ffseg.arrays import Mask, Plane
from ffseg.image.edges import GRADIENT_SCALE, EdgeMap
from ffseg.native import _core

LEVEL = 0.5
"""Probability at which the region ends. Maps are rescaled so that any other requested level becomes this one (`at_level`)."""

SMOOTHING = 1.0
"""Pixels: standard deviation of the smoothing that turns the pixel steps of a binary map into a level set between pixels."""

UNDECIDED_MARGIN = 0.15
"""Edges of the image count where the probability differs from ``LEVEL`` by less than this; elsewhere the map decides."""

RIDGE_WIDTH = 1.2
"""Pixels: standard deviation of the ridge along the level set, on which the contour settles."""

SNAP_WIDTH = 3.0
"""Pixels: standard deviation of the band round the level set in which gradients of the image shift the ridge."""

RIDGE_HEIGHT = 2.0
"""Height of the ridge in multiples of the high threshold: it stops every method, and a clear edge of the image still
outweighs it."""

MAX_PROBABILITY = np.float32(0.999)
"""Probability up to which a pixel of a map is believed: log odds of 7, as the prior's."""

MAX_GRADIENT = 65535.0
"""Largest gradient that can be stored."""

STRENGTH_SCALE = 128.0
"""Grey levels per pixel that correspond to an edge strength of one."""


def log_odds(probability: float) -> float:
    """Log odds of a probability above 0 and below 1."""
    return log(probability / (1 - probability))


def at_level(probability: Plane, level: float) -> Plane:
    """Probabilities with their odds divided by those of a level, which becomes one half; 0 and 1 stay.

    Parameters
    ----------
    probability : ndarray of float32
        From 0 to 1.
    level : float
        Above 0 and below 1; at one half, `probability` itself is returned.
    """
    if level == LEVEL:
        return probability
    inside: Plane = probability * np.float32(1 - level)
    outside: Plane = (1 - probability) * np.float32(level)
    found: Plane = inside / (inside + outside)
    return found


def evidence_edges(
    probability: Plane, image_edges: EdgeMap, source: str = "evidence", odds: Plane | None = None
) -> EdgeMap:
    """An edge map whose edges follow the level set at which the probability of inside falls to one half.

    Parameters
    ----------
    probability : ndarray of float32, shape (H, W)
        From 0 to 1, finite.
    image_edges : EdgeMap
        Of the image itself. Its edges are kept where the map is undecided, and move the level near them.
    source : str, optional
        Name of what has told the probability.
    odds : ndarray of float32, shape (H, W), optional
        Its log odds, where they are known.

    Returns
    -------
    EdgeMap
        `image_edges` itself if the map says nothing: where it is even, or never falls to one half.
    """
    if not _crosses(probability, LEVEL):
        return image_edges
    above = blurred(probability, SMOOTHING)
    above -= np.float32(LEVEL)
    gradient, edges = image_edges.gradient.copy(), image_edges.edges.copy()
    height = min(RIDGE_HEIGHT * image_edges.thresholds[1] * GRADIENT_SCALE, MAX_GRADIENT)
    _core.evidence_level(above, UNDECIDED_MARGIN, SNAP_WIDTH, RIDGE_WIDTH, height, gradient, edges)
    if odds is None:
        odds = certain_odds(probability)
    return EdgeMap(gradient, edges, image_edges.domain, image_edges.thresholds, source, odds)


def certain_odds(probability: Plane) -> Plane:
    """Log odds of probabilities, limited to `MAX_PROBABILITY`."""
    certain = np.clip(probability, 1 - MAX_PROBABILITY, MAX_PROBABILITY)
    return logarithm(certain / (1 - certain))


def expected_overlap(odds: Plane, mask: Mask) -> float:
    """Expected IoU of a region if the probabilities are right: their sum inside it over that of the union.

    Parameters
    ----------
    odds : ndarray of float32, shape (H, W)
        Log odds of inside, 0 where the region ends.
    mask : ndarray of bool, shape (H, W)

    Notes
    -----
    Probabilities below one half count as none: there are many of them far off, where they say more of the size of
    the image than of the region.
    """
    every = (odds > 0) * probability(odds)  # a product, where choices would wait for each pixel
    both = float((every * mask).sum(dtype=np.float64))
    either = float(np.count_nonzero(mask)) + float(every.sum(dtype=np.float64)) - both
    return both / either if either > 0 else 0.0


def odds_edges(odds: Plane, probability: float, image_edges: EdgeMap, source: str) -> EdgeMap:
    """An edge map whose edges follow the level set of log odds at a probability, as `evidence_edges`.

    Parameters
    ----------
    odds : ndarray of float32, shape (H, W)
    probability : float
        Above 0 and below 1.
    """
    shift = np.float32(log_odds(probability))
    odds = odds - shift if shift else odds
    tangent = odds * np.float32(0.25)  # of the probability at one half: the same level, without a rounded exponential
    tangent += np.float32(0.5)
    return evidence_edges(np.clip(tangent, 0, 1, out=tangent), image_edges, source, odds)


def strength_edges(strength: Plane, image_edges: EdgeMap) -> EdgeMap:
    """An edge map with edges where a map of edge strength reaches one half.

    Parameters
    ----------
    strength : ndarray of float32, shape (H, W)
        From 0 to 1, finite; takes the place of the image's gradient.
    image_edges : EdgeMap
        What is returned if the map is even.
    """
    if not _crosses(strength, LEVEL):
        return image_edges
    edges = np.where(strength >= LEVEL, np.uint8(255), np.uint8(0))
    gradient = blurred(strength, SMOOTHING) * np.float32(STRENGTH_SCALE * GRADIENT_SCALE) + np.float32(0.5)
    low = STRENGTH_SCALE * LEVEL / 2
    return EdgeMap(gradient.astype(np.uint16), edges, image_edges.domain, (low, 2 * low), image_edges.source)


def _crosses(values: Plane, level: float) -> bool:
    return bool(values.min() < level <= values.max())


def logarithm(values: Plane) -> Plane:
    """Natural logarithm of positive values, with the same bits on every processor, unlike NumPy's."""
    return _of_each(_core.evidence_logarithm, values)


def logarithm_of(value: float) -> float:
    """The same of one value, in single precision."""
    return float(logarithm(np.full((1, 1), value, np.float32))[0, 0])


def probability(odds: Plane) -> Plane:
    """Probabilities of log odds, with the same bits on every processor."""
    found: Plane = np.float32(1) / (np.float32(1) + _of_each(_core.evidence_exponential, -odds))
    return found


def _of_each(function: Callable[[Plane, Plane], None], values: Plane) -> Plane:
    found = np.empty(values.shape, np.float32)
    function(np.ascontiguousarray(values, np.float32), found)
    return found


def blurred(plane: Plane, sigma: float) -> Plane:
    """A plane smoothed by a Gaussian of that standard deviation, px."""
    out = np.empty_like(plane)
    _core.evidence_blur(np.ascontiguousarray(plane), sigma, out)
    return out
