"""Interest points of enclosed components: Harris corners and samples of their edges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Array, Image, Indices
from ffseg.image.components import Component
from ffseg.native import _core

DILATION = 2
"""Pixels: corners and edges lie on the border of a component, which the settled contour cuts through."""


@dataclass(frozen=True, slots=True, eq=False)
class InterestPoints:
    """Points of several components.

    Attributes
    ----------
    owner : ndarray of int, shape (n,)
        Position of the point's component in the list, ascending.
    pixels : ndarray of float64, shape (n, 2)
        Of the image.
    """

    owner: Indices
    pixels: Array


NO_POINTS = InterestPoints(np.empty(0, np.intp), np.empty((0, 2)))


def strongest(corners: InterestPoints, most: int) -> InterestPoints:
    """The first `most` of each component's corners, which stand strongest first."""
    place = np.arange(len(corners.owner)) - np.searchsorted(corners.owner, corners.owner)
    return InterestPoints(corners.owner[place < most], corners.pixels[place < most])


def harris_points(grey: Image, components: Sequence[Component], most: int, grow: int = DILATION) -> InterestPoints:
    """Harris corners inside components, to a part of a pixel; strongest first in each.

    Parameters
    ----------
    grey : ndarray of uint8, shape (H, W)
    most : int
        Corners kept per component.
    grow : int
        Pixels by which components are grown first.

    Notes
    -----
    Gradient products are summed over 3x3 pixels. Peaks below a hundredth of their component's strongest are left out.
    """
    return _points(_core.harris_points, grey, components, most, grow)


def outline_points(grey: Image, components: Sequence[Component], most: int, grow: int = DILATION) -> InterestPoints:
    """Pixels of strongest gradient inside components, at most one per 4x4 cell, evenly thinned to ``most`` in each."""
    return _points(_core.outline_points, grey, components, most, grow)


def _points(
    find: Callable[..., None], grey: Image, components: Sequence[Component], most: int, grow: int
) -> InterestPoints:
    if not components:
        return NO_POINTS
    windows = np.array([(*c.origin, c.mask.shape[1], c.mask.shape[0]) for c in components], np.int64)
    masks = np.concatenate([c.mask.ravel() for c in components]).view(np.uint8)
    points, counts = np.empty((most * len(components), 2)), np.empty(len(components), np.int64)
    find(grey, windows, masks, grow, points, counts)
    return InterestPoints(np.repeat(np.arange(len(components)), counts), points[: counts.sum()])
