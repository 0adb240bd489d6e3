"""One exposure for all pictures that are learned from and asked of."""

from __future__ import annotations

import cv2
import numpy as np

from ffseg.arrays import Image

MIDDLE, MOST_GAIN, EVERY = 100.0, 4.0, 4
"""Grey level that the mean of an image is brought to, the most it is multiplied or divided by, and which pixels count."""

DARKEST, HAZE = 0.01, (0.4, 0.6)
"""The darkest hundredth of the levels lies near zero; where it lies above so much of the mean, a part of it or all of it is
haze or stray light over the whole picture, and is taken off."""


def normalised_exposure(image: Image) -> Image:
    """The image without haze and with its mean level brought to `MIDDLE`, as another exposure would have given it."""
    counts = np.bincount(image[::EVERY, ::EVERY].ravel(), minlength=256)
    darkest = float(np.searchsorted(np.cumsum(counts), DARKEST * counts.sum()))
    mean = max(float(counts @ np.arange(256)) / float(counts.sum()), 1.0)
    veil = darkest * min(max((darkest / mean - HAZE[0]) / (HAZE[1] - HAZE[0]), 0.0), 1.0)
    gain = min(max(MIDDLE / max(mean - veil, 1.0), 1 / MOST_GAIN), MOST_GAIN)
    levels = np.clip(np.rint((np.arange(256) - veil) * gain), 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(image, levels), np.uint8)
