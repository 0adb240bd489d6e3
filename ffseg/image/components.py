"""Enclosed components of a segmentation: the inner contours and what they enclose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.geometry.freeform import FreeForm
from ffseg.image.raster import rasterize

Mask = NDArray[np.bool_]


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
        rows, columns = np.nonzero(self.mask)
        if not len(rows):
            return float("nan"), float("nan")
        return float(columns.mean() + self.origin[0]), float(rows.mean() + self.origin[1])

    def window(self) -> tuple[slice, slice]:
        """Rows and columns of the image that ``mask`` covers."""
        x, y = self.origin
        return slice(y, y + self.mask.shape[0]), slice(x, x + self.mask.shape[1])

    def grown(self, by: int, shape: tuple[int, int]) -> Component:
        """The component grown by ``by`` pixels (a square), within an image of ``shape``."""
        x, y = self.origin
        x0, y0 = max(x - by, 0), max(y - by, 0)
        x1, y1 = min(x + self.mask.shape[1] + by, shape[1]), min(y + self.mask.shape[0] + by, shape[0])
        wide = np.zeros((y1 - y0, x1 - x0), np.uint8)
        wide[y - y0 : y - y0 + self.mask.shape[0], x - x0 : x - x0 + self.mask.shape[1]] = self.mask
        size = 2 * by + 1
        return Component(self.index, (x0, y0), cv2.dilate(wide, np.ones((size, size), np.uint8)) > 0)


def component_of(index: int, mask: Mask) -> Component:
    """A component from a mask of the whole image."""
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    if not len(rows):
        return Component(index, (0, 0), np.zeros((0, 0), np.bool_))
    window = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return Component(index, (int(columns[0]), int(rows[0])), window.copy())


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
    return inner, [_filled(index, contours[place], shape) for index, place in enumerate(inner)]


def _filled(index: int, contour: FreeForm, shape: tuple[int, int]) -> Component:
    low, high = contour.control_box
    x0, y0 = (int(max(0, np.floor(value))) for value in low)
    x1, y1 = min(shape[1], int(np.ceil(high[0])) + 1), min(shape[0], int(np.ceil(high[1])) + 1)
    window = (max(0, y1 - y0), max(0, x1 - x0))
    local = FreeForm(contour.control_points - [x0, y0], contour.degree).reversed()
    return Component(index, (x0, y0), rasterize([local], window))


def merged(region: Mask, components: Sequence[Component]) -> Mask:
    """The region with components given back to it."""
    result = region.copy()
    for component in components:
        result[component.window()] |= component.mask
    return result


def num_holes(region: Mask) -> int:
    """Holes of a region: parts of the background, connected over sides and corners, that do not reach the border.

    The region itself is then connected over sides only. A hole of one pixel counts.
    """
    outside = np.pad(~region, 1, constant_values=True).astype(np.uint8)
    return cv2.connectedComponents(outside, connectivity=8)[0] - 2  # less the region's label and what lies all round
