"""Enclosed components of a segmentation: the inner contours and what they enclose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Mask
from ffseg.geometry.freeform import FreeForm
from ffseg.image.raster import rasterize


@dataclass(frozen=True, slots=True, eq=False)
class Component:
    """What one inner contour encloses.

    Attributes
    ----------
    index : int
        From 0, in the order of the inner contours.
    origin : tuple of int
        (x, y) of the first pixel of ``mask`` in the image.
    mask : ndarray of bool, shape (h, w)
        Pixels of the component in its own window.
    """

    index: int
    origin: tuple[int, int]
    mask: Mask

    @property
    def area(self) -> int:
        """Pixels."""
        return int(np.count_nonzero(self.mask))

    @property
    def centroid(self) -> tuple[float, float]:
        """(x, y) of the mean pixel centre; NaN when empty."""
        across, down = self.mask.sum(axis=0), self.mask.sum(axis=1)
        count = int(across.sum())
        if not count:
            return float("nan"), float("nan")
        x, y = float(across @ np.arange(len(across))), float(down @ np.arange(len(down)))
        return x / count + self.origin[0], y / count + self.origin[1]

    def window(self) -> tuple[slice, slice]:
        """Rows and columns of the image that ``mask`` covers."""
        x, y = self.origin
        return slice(y, y + self.mask.shape[0]), slice(x, x + self.mask.shape[1])


def contour_components(contours: Sequence[FreeForm], shape: tuple[int, int]) -> tuple[list[int], list[Component]]:
    """Components enclosed by the inner contours (those of negative area).

    Returns
    -------
    list of int
        Places of the inner contours among `contours`.
    list of Component
        What each encloses by the pixel-centre rule, cut at the image border; ``index`` counts inner contours.
    """
    inner = [place for place, contour in enumerate(contours) if contour.signed_area < 0]
    return inner, [filled(contours[place], shape, index) for index, place in enumerate(inner)]


def filled(contour: FreeForm, shape: tuple[int, int], index: int = 0) -> Component:
    """What one contour encloses by the pixel-centre rule, whichever way round it runs, cut at the image border."""
    points = contour.control_points
    last = np.array([shape[1], shape[0]])
    x0, y0 = np.clip(np.floor(points.min(axis=0)), 0, last).astype(int).tolist()
    x1, y1 = np.clip(np.ceil(points.max(axis=0)) + 1, (x0, y0), last).astype(int).tolist()
    forward = points if contour.signed_area > 0 else np.concatenate([points[:1], points[:0:-1]])
    local = forward - (x0, y0)
    return Component(index, (x0, y0), rasterize([FreeForm.trusted(local, contour.degree)], (y1 - y0, x1 - x0)))


def merged(region: Mask, components: Sequence[Component]) -> Mask:
    """The region with components given back to it."""
    result = region.copy()
    for component in components:
        result[component.window()] |= component.mask
    return result
