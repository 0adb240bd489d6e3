"""Region evidence: the colours inside contours and in the bands along them, at the cost of the contours' length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed
from ffseg.image.raster import TOLERANCE
from ffseg.native import _core

BAND = 6.0
"""Pixels; wide enough for a mean against noise, narrow enough to see the ground at the border and not the whole scene."""

BINS = 6
"""Levels of a channel in the joint histogram of three channels: 216 colours."""

ROUNDING = 1.0 / 12.0
"""Variance of rounding to whole grey levels, added to each channel so that a ground of one colour has a distance."""


@dataclass(frozen=True, slots=True, eq=False)
class Colours:
    """Statistics of the colours of a set of pixels.

    Attributes
    ----------
    count : int
        Pixels. Where it is 0, mean and covariance are 0.
    mean : ndarray of float64, shape (C,)
        Grey levels.
    covariance : ndarray of float64, shape (C, C)
        Grey levels squared, of the set itself (divided by ``count``).
    histogram : ndarray of int64, shape (bins,) * C, or (0,)
        Pixels by colour, equal intervals of every channel; empty without bins.
    """

    count: int
    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    histogram: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Colours of a region and of both sides of its boundary.

    Attributes
    ----------
    inside : Colours
        The region: the pixels whose centres it holds.
    inner : Colours
        Pixels of the region within the band of a pixel outside it.
    outer : Colours
        Pixels outside within the band of a pixel of the region.
    """

    inside: Colours
    inner: Colours
    outer: Colours


class ColourSums:
    """Running sums of an image's colours, made once, asked for any contours.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, C)
        One to three channels of any meaning.
    bins : int
        Levels of each channel in the histogram, 0 for none; ``bins ** C`` is at most 512.

    Raises
    ------
    ValueError
        If there are more channels or bins than that.

    Notes
    -----
    Sums along rows are kept at every 32nd column (Green's theorem on the grid of pixels), so that a question costs the
    rows the contours cross and the rows of the band's disc, not the area. All sums are whole numbers and exact: also
    with holes, touching contours and parts outside the image.
    """

    def __init__(self, image: NDArray[np.uint8], bins: int = BINS) -> None:
        planes = image[..., None] if image.ndim == 2 else image
        self._channels, self._bins = planes.shape[2], bins
        self._sums = _core.RowSums(np.ascontiguousarray(planes), bins)

    def measure(self, contours: Sequence[FreeForm], band: float = BAND) -> Evidence:
        """Colours of the region the contours enclose together, and along its boundary.

        Parameters
        ----------
        contours : sequence of FreeForm
            Of one degree; the region is where their winding number is above 0, as in `rasterize`.
        band : float
            Pixels from 1 to 1000: how far from the other side a pixel of a band may lie. Pixels outside the image are
            on no side, so a region has no boundary along the image's own border.

        Raises
        ------
        ValueError
            If the degrees differ or the band is out of range.
        """
        degrees = {contour.degree for contour in contours} or {1}
        if len(degrees) > 1:
            raise ValueError(f"the contours have degrees {sorted(degrees)}; elevate them to one")
        points, offsets = packed(contours)
        table = np.zeros((3, self._sums.length), np.int64)
        self._sums.measure(points, offsets, degrees.pop(), TOLERANCE, band, table)
        inside, inner, outer = (self._colours(row) for row in table)
        return Evidence(inside, inner, outer)

    def _colours(self, totals: NDArray[np.int64]) -> Colours:
        channels = self._channels
        count, *sums = (int(value) for value in totals[: 1 + channels * (channels + 3) // 2])
        first, products = sums[:channels], iter(sums[channels:])
        covariance = np.zeros((channels, channels))
        for i in range(channels):
            for j in range(i, channels):  # whole numbers of any size until the division
                exact = count * next(products) - first[i] * first[j]
                covariance[i, j] = covariance[j, i] = exact / (count * count) if count else 0.0
        mean = np.array([value / count if count else 0.0 for value in first])
        histogram = totals[1 + len(sums) :].reshape((self._bins,) * channels if self._bins else (0,))
        return Colours(count, mean, covariance, histogram)


def bhattacharyya(one: Colours, two: Colours) -> float:
    """Distance of two sets of colours taken for Gaussians: 0 when alike, about 1 when 14 % overlap; inf for an empty one.

    Notes
    -----
    A term for the means, in units of the mean covariance, and one for the covariances. The variance of rounding is
    added to both.
    """
    if not one.count or not two.count:
        return float("inf")
    floor = ROUNDING * np.eye(len(one.mean))
    a, b = one.covariance + floor, two.covariance + floor
    both = (a + b) / 2
    step = one.mean - two.mean
    apart = float(step @ np.linalg.solve(both, step)) / 8
    spread = np.linalg.slogdet(both)[1] - (np.linalg.slogdet(a)[1] + np.linalg.slogdet(b)[1]) / 2
    return apart + max(0.0, float(spread)) / 2


def histogram_distance(one: Colours, two: Colours) -> float:
    """Hellinger distance of two histograms: 0 when alike, 1 when no colour is in both; 1 for an empty one."""
    if not one.count or not two.count:
        return 1.0
    overlap = float(np.sqrt(one.histogram / one.count * (two.histogram / two.count)).sum())
    return sqrt(max(0.0, 1.0 - overlap))


def contrast(evidence: Evidence) -> float:
    """Step of the mean colour across the boundary, in units of the spread along it: Fisher's ratio of the two bands."""
    inner, outer = evidence.inner, evidence.outer
    if not inner.count or not outer.count:
        return 0.0
    spread = float(np.trace(inner.covariance + outer.covariance)) + 2 * ROUNDING * len(inner.mean)
    return float(np.linalg.norm(inner.mean - outer.mean)) / sqrt(spread)
