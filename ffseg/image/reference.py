"""The fixed kernel K that timings are divided by: what any user would run first, on one thread."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import cv2

from ffseg.arrays import Image

SIGMA = 1.5
LOW, HIGH = 50, 150
"""Canny thresholds of K; they are part of its definition, as its duration depends on them a little."""


def reference_kernel(grey: Image) -> int:
    """Blur, Canny edges and a flood fill from the middle: the fixed kernel K.

    Parameters
    ----------
    grey : ndarray of uint8, shape (H, W)

    Returns
    -------
    int
        Number of filled pixels, 0 when the middle is an edge pixel.
    """
    smoothed = cv2.GaussianBlur(grey, (0, 0), SIGMA)
    edges = cv2.Canny(smoothed, LOW, HIGH)
    middle = (grey.shape[1] // 2, grey.shape[0] // 2)
    filled, *_ = cv2.floodFill(edges, None, middle, 128)
    return int(filled)


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep OpenCV to one thread meanwhile."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)
