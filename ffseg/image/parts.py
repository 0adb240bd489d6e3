"""Connected components of a mask, and what lies near them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image, Indices, Mask, Plane


@dataclass(frozen=True, eq=False)
class Parts:
    """The connected components of a mask, numbered from 1 in the order of their first pixels; 0 is the outside.

    Attributes
    ----------
    labels : ndarray of int32, shape (H, W)
        Number of the part that a pixel belongs to.
    number : int
        N + 1.
    """

    labels: NDArray[np.int32]
    number: int

    @cached_property
    def areas(self) -> Indices:
        """Pixels of each component, 0 for the outside, shape (N + 1,); computed on demand, as few callers need them."""
        return np.bincount(self.labels[self.labels > 0], minlength=self.number)

    def touching(self, mask: Mask) -> NDArray[np.int32]:
        """Numbers of the components with a pixel in a mask."""
        found = np.unique(self.labels.take(np.flatnonzero(mask)))
        return found[found > 0]

    def pixels_of(self, numbers: NDArray[np.integer]) -> Mask:
        """Pixels of some components."""
        chosen = np.zeros(self.number, np.bool_)
        chosen[numbers] = True
        return chosen.take(self.labels)

    def at_least(self, area: float) -> Mask:
        """Pixels of the components of at least this area."""
        return self.pixels_of(np.flatnonzero(self.areas >= max(area, 1)))


def connected_parts(mask: Mask | Image, *, corners: bool = False) -> Parts:
    """The connected components of a mask, 4-connected or 8-connected."""
    number, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8 if corners else 4)
    return Parts(np.asarray(labels, np.int32), number)


def parts_holding(mask: Mask, places: Mask, *, corners: bool = False) -> Mask:
    """Pixels of the components that contain one of the places."""
    found, width = mask.astype(np.uint8), mask.shape[1]
    at = np.flatnonzero(places & mask)
    begun = at[(np.diff(at, prepend=-2) > 1) | (at % width == 0)]  # what lies in a row without a gap hangs together
    framed = np.zeros((len(found) + 2, width + 2), np.uint8)  # without one of ours, each flood makes and clears one
    for row, column in zip(*np.divmod(begun, width), strict=True):
        if found[row, column] == 1:
            cv2.floodFill(found, framed, (int(column), int(row)), 2, flags=8 if corners else 4)
    return np.asarray(found == 2)


def scattered(mask: Mask) -> Iterator[tuple[tuple[slice, slice], Parts]]:
    """Components of a nearly empty mask: rows and columns of windows that hold all of it, and the components in each."""
    filled = np.pad(mask.any(axis=1), 1)
    for top, end in np.flatnonzero(filled[1:] != filled[:-1]).reshape(-1, 2).tolist():
        columns = np.flatnonzero(mask[top:end].any(axis=0)).tolist()
        window = slice(top, end), slice(columns[0], columns[-1] + 1)
        yield window, connected_parts(mask[window])


def dilated(plane: Plane, width: int) -> Plane:
    """The largest value in the square of that odd width round each pixel."""
    return np.asarray(cv2.dilate(plane, np.ones((width, width), np.uint8)), np.float32)
