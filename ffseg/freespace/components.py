"""Enclosed components of a segmentation: the inner contours and what they enclose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

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


def enclosed_components(region: Mask) -> list[Component]:
    """Holes of a region: background that no path of pixel sides or corners joins to the image border."""
    outside = np.pad(~region, 1, constant_values=True).view(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(outside, connectivity=8)
    border = labels[0, 0]
    found: list[Component] = []
    for label in range(1, count):
        if label != border:
            x, y, w, h = (int(value) for value in stats[label][:4])
            mask = labels[y : y + h, x : x + w] == label
            found.append(Component(len(found), (x - 1, y - 1), mask))
    return found


def merged(region: Mask, components: Sequence[Component]) -> Mask:
    """The region with components given back to it."""
    result = region.copy()
    for component in components:
        result[component.window()] |= component.mask
    return result
