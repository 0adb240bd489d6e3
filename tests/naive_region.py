"""Slow, obvious twins of the region evidence. Imports nothing from ffseg."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]


def near(mask: Mask, radius: float) -> Mask:
    """Pixels whose centre lies no farther than `radius` from that of a pixel of the mask."""
    height, width = mask.shape
    found = np.zeros_like(mask)
    for v in range(-height + 1, height):
        for u in range(-width + 1, width):
            if u * u + v * v <= radius * radius:
                rows, columns = slice(max(0, v), height + min(0, v)), slice(max(0, u), width + min(0, u))
                back = slice(max(0, -v), height + min(0, -v)), slice(max(0, -u), width + min(0, -u))
                found[rows, columns] |= mask[back]
    return found


def parts(mask: Mask, band: float) -> tuple[Mask, Mask, Mask]:
    """The region, its pixels near the rest, the pixels of the rest near it."""
    return mask, mask & near(~mask, band), ~mask & near(mask, band)


def moments(image: NDArray[np.uint8], mask: Mask) -> tuple[int, NDArray[np.float64], NDArray[np.float64]]:
    """Count, mean and covariance of the colours of a mask."""
    channels = 1 if image.ndim == 2 else image.shape[2]
    colours = image[mask].astype(np.float64).reshape(-1, channels)
    if not len(colours):
        return 0, np.zeros(channels), np.zeros((channels, channels))
    mean = colours.mean(axis=0)
    return len(colours), mean, (colours - mean).T @ (colours - mean) / len(colours)


def histogram(image: NDArray[np.uint8], mask: Mask, bins: int) -> NDArray[np.int64]:
    """Counts of the colours of a mask, `bins` equal intervals a channel."""
    planes = image[..., None] if image.ndim == 2 else image
    counts = np.zeros((bins,) * planes.shape[2], np.int64)
    for colour in planes[mask]:
        counts[tuple(int(value) * bins // 256 for value in colour)] += 1
    return counts
