"""Parts of a mask: pixels that hang together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Parts:
    """The parts of a mask, numbered from 1 in the order of their first pixels; 0 is what lies outside.

    Attributes
    ----------
    labels : ndarray of int32, shape (H, W)
        Number of the part that a pixel belongs to.
    number : int
        N + 1.
    neighbours : int
        Of a pixel: 4 over its sides, 8 over corners too.
    """

    labels: NDArray[np.int32]
    number: int
    neighbours: int

    @cached_property
    def areas(self) -> NDArray[np.intp]:
        """Pixels of each, none for 0, shape (N + 1,); counted when asked for, as half of the callers do not ask."""
        found = np.bincount(self.labels.ravel(), minlength=self.number)
        found[0] = 0
        return found

    def touching(self, mask: NDArray[np.bool_]) -> NDArray[np.int32]:
        """Numbers of those with a pixel in a mask."""
        found = np.unique(self.labels[mask])
        return found[found > 0]

    def at_least(self, area: float) -> NDArray[np.bool_]:
        """Pixels of those that have so many."""
        return np.asarray((self.areas >= max(area, 1))[self.labels], np.bool_)

    def boxes(self) -> NDArray[np.int32]:
        """Column, row, width and height of the box round each, shape (N + 1, 4); looked for only now, as few ask."""
        inside = (self.labels > 0).astype(np.uint8)
        return np.asarray(cv2.connectedComponentsWithStats(inside, connectivity=self.neighbours)[2][:, :4], np.int32)


def parts(mask: NDArray[np.bool_] | NDArray[np.uint8], *, corners: bool = False) -> Parts:
    """The parts of a mask, whose pixels hang together over their sides, or over corners too."""
    neighbours = 8 if corners else 4
    number, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=neighbours)
    return Parts(np.asarray(labels, np.int32), number, neighbours)


def holding(mask: NDArray[np.bool_], places: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels of the parts of a mask that have one of the places in them."""
    found = parts(mask)
    kept = np.zeros(found.number, np.bool_)
    kept[found.touching(places)] = True
    return kept.take(found.labels)


def scattered(mask: NDArray[np.bool_]) -> Iterator[tuple[tuple[slice, slice], Parts]]:
    """Parts of a mask that is nearly empty: rows and columns of windows that hold all of it, and the parts in each."""
    filled = np.pad(mask.any(axis=1), 1)
    for top, end in np.flatnonzero(filled[1:] != filled[:-1]).reshape(-1, 2).tolist():
        columns = np.flatnonzero(mask[top:end].any(axis=0)).tolist()
        window = slice(top, end), slice(columns[0], columns[-1] + 1)
        yield window, parts(mask[window])
