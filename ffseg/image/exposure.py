"""Correction of exposure and haze, for all images that forests learn from and are applied to."""

from __future__ import annotations

import cv2
import numpy as np

from ffseg.arrays import Image

MEAN_LEVEL, MAX_GAIN, SAMPLE_STEP = 100.0, 4.0, 4
"""Mean grey level after the correction of exposure, the largest factor applied either way, and the sampling step in
pixels."""

DARK_QUANTILE, HAZE_LEVELS = 0.01, (0.4, 0.6)
"""Quantile of the grey levels that should be near zero. If it exceeds these fractions of the mean, part of it (at the
second all of it) is taken for haze or stray light and subtracted."""


def normalised_exposure(image: Image) -> Image:
    """The image without haze and with its mean level at `MEAN_LEVEL`."""
    counts = np.bincount(image[::SAMPLE_STEP, ::SAMPLE_STEP].ravel(), minlength=256)
    darkest = float(np.searchsorted(np.cumsum(counts), DARK_QUANTILE * counts.sum()))
    mean = max(float(counts @ np.arange(256)) / float(counts.sum()), 1.0)
    veil = darkest * min(max((darkest / mean - HAZE_LEVELS[0]) / (HAZE_LEVELS[1] - HAZE_LEVELS[0]), 0.0), 1.0)
    gain = min(max(MEAN_LEVEL / max(mean - veil, 1.0), 1 / MAX_GAIN), MAX_GAIN)
    levels = np.clip(np.rint((np.arange(256) - veil) * gain), 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(image, levels), np.uint8)
