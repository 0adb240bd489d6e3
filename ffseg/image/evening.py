"""Correction of shading and removal of bright streaks, before the gradient is taken."""

from __future__ import annotations

import cv2
import numpy as np

from ffseg.arrays import Array, Image
from ffseg.parameters import Edges

LOG_OFFSET = 10.0
"""Grey levels added before the logarithm: below about 10 an 8-bit image holds more noise and rounding than light."""

GREY_FRACTION = 0.35
"""What a highlight adds is nearly grey: its channels differ by at most this part of the largest..."""

GREY_SLACK = 4
"""...and a few grey levels of noise."""


def evened(image: Image, params: Edges) -> Image:
    """The image whose gradient becomes the edge map.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    params : Edges
        ``highlights`` takes bright grey streaks out, ``levels`` evens the grey levels; without either the image itself is
        returned.
    """
    found = without_streaks(image, params.highlights) if params.highlights >= 1 else image
    return found if params.levels == "linear" else _TABLES[params.levels][found]


def without_streaks(image: Image, width: float) -> Image:
    """The image without bright grey structures narrower than `width` pixels, such as glossy streaks and painted lines.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    width : float
        Pixels, at least 1.

    Notes
    -----
    A morphological opening by a disc, taken where what it removes is grey: light that a surface mirrors adds the lamp's
    colour and not the surface's. A coloured structure stays.
    """
    size = 2 * int(width / 2) + 1
    opened: Image = np.asarray(
        cv2.morphologyEx(image, cv2.MORPH_OPEN, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))), np.uint8
    )
    if image.ndim == 2:
        return opened
    removed = cv2.subtract(image, opened)
    largest, least = removed.max(axis=2), removed.min(axis=2)
    grey = largest - least <= GREY_FRACTION * largest + GREY_SLACK
    found: Image = np.where(grey[..., None], opened, image)
    return found


def _table(curve: Array) -> Image:
    """A curve over the 256 grey levels, stretched to 0..255."""
    return np.asarray(np.rint((curve - curve[0]) * (255 / (curve[-1] - curve[0]))), np.uint8)


_LEVELS = np.arange(256, dtype=np.float64)
_TABLES = {"root": _table(np.sqrt(_LEVELS)), "log": _table(np.log(_LEVELS + LOG_OFFSET))}
