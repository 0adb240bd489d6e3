"""How sure a result is: the IoU to expect, from 0 to 1."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ffseg.contour import Found
from ffseg.evidence.boundary import Boundary
from ffseg.evidence.surroundings import STRIDE, thinned


def judged(found: Found, mask: NDArray[np.bool_]) -> float:
    """Score of a region: the overlap that the evidence lets expect, else the share of the boundary on clear edges."""
    edges = found.scene.edges
    if edges.odds is not None:
        return expected_overlap(edges.odds, mask)
    return Boundary(found.outcome.contours, edges).clear_share()


def expected_overlap(odds: NDArray[np.float32], mask: NDArray[np.bool_]) -> float:
    """The IoU to be expected of a region if the probabilities are true: their sum in it over that of its union.

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
    few, inside = thinned(odds), mask[::STRIDE, ::STRIDE]
    every = (few > 0) / (1 + np.exp(-few))  # products and quotients, where choices would wait for each pixel
    both = float((every * inside).sum(dtype=np.float64))
    either = float(np.count_nonzero(inside)) + float(every.sum(dtype=np.float64)) - both
    return both / either if either > 0 else 0.0
