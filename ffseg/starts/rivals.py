"""Rival fronts, which grow from background seeds; the contour stops where it meets them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ffseg.arrays import Array, Image, Mask
from ffseg.errors import SegmentationError
from ffseg.image.edges import EdgeMap
from ffseg.native import _core
from ffseg.parameters import Parameters, Seed

SEED_IN_START = "a background seed lies in the start region; move init.background or the start"

POINT_RADIUS = 2.0
"""Pixels: radius of the disc that stands for a point or a smaller circle, as a single pixel may be noise."""

HALF_SPEED_SLOPE = 4.0
"""Grey levels per pixel: gradient at which the speed of a front is halved. On photographs of objects 3 to 12 do equally
well, thresholds from noise worse."""


def within_rivals(edges: EdgeMap, start: Mask, params: Parameters, background: Image | None = None) -> EdgeMap:
    """The edge map with its domain limited to what the start's front reaches before its rivals.

    Parameters
    ----------
    start : ndarray of bool, shape (H, W)
        The start region.
    params : Parameters
        ``init.background`` and ``region.border`` say where rivals start, ``edges.exponent`` how edges slow the fronts.
    background : ndarray of uint8, shape (H, W), optional
        Nonzero where rivals start too.

    Raises
    ------
    SegmentationError
        If a seed of a rival lies in the start region or outside the image, or the mask has another size.

    Notes
    -----
    Both sides grow by fast marching with the speed ``1 / (1 + (|grad| / s)**p)``, s = `HALF_SPEED_SLOPE`, through
    everything the domain leaves: edges slow them and do not stop them, so that they meet on the edges between them and,
    in a gap, half-way. A pixel both reach at once belongs to the start.
    """
    rivals = seeds(params.init.background, start, background)
    if params.region.border == "outside":
        rivals[[0, -1]] = rivals[:, [0, -1]] = True
        rivals &= ~start
    if not rivals.any():
        return edges
    speed = 1.0 / (1.0 + (edges.magnitude() / HALF_SPEED_SLOPE) ** params.edges.exponent)
    ours, theirs = (_arrivals(speed, seed, edges.domain) for seed in (start, rivals))
    return replace(edges, domain=np.where(np.isfinite(ours) & (ours <= theirs), np.uint8(255), np.uint8(0)))


def seeds(points: Iterable[Seed], start: Mask, background: Image | None = None) -> Mask:
    """Pixels known to lie outside: discs, points and a mask; what a disc shares with the start belongs to the start.

    Raises
    ------
    SegmentationError
        If the middle of one lies in the start region, or the mask overlaps it.
    """
    shape = start.shape
    found = np.zeros(shape, np.bool_)
    for column, row, *radius in points:
        if start[min(round(row), shape[0] - 1), min(round(column), shape[1] - 1)]:
            raise SegmentationError(SEED_IN_START)
        add_disc(found, column, row, max([POINT_RADIUS, *radius[:1]]))
    if background is not None:
        if (start & (background > 0)).any():
            raise SegmentationError(SEED_IN_START)
        found |= background > 0
    found &= ~start
    return found


def add_disc(mask: Mask, x: float, y: float, radius: float) -> None:
    """Add the pixels of a disc to a mask."""
    top, bottom, left, right = (max(int(at), 0) for at in (y - radius, y + radius + 1, x - radius, x + radius + 1))
    window = mask[top:bottom, left:right]
    rows, columns = np.ogrid[top : top + window.shape[0], left : left + window.shape[1]]
    window |= np.hypot(columns - x, rows - y) <= radius


def _arrivals(speed: Array, seed: Mask, domain: Image | None) -> Array:
    times: Array = _core.fast_march(speed, 0.0, seed.view(np.uint8), domain)[0]
    return np.where(np.isnan(times), np.inf, times).reshape(speed.shape)
