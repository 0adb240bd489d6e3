"""What an image shows wherever a start may lie: in even exposure and reduced, its colours, and textures at several scales."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np

from ffseg.arrays import Image, Plane
from ffseg.native import _core

WORKING_SIZE = 400
"""Pixels: longest side at which features are computed; larger images are first reduced by an integer factor."""

MIN_DEPTH, MAX_SIZE = 12.0, 2400
"""Pixels from the rim to the middle of one of many things in the reduced image: it is reduced less for that, to so many pixels a
side at most. Of nuclei in nine megapixels, all that look alike have an IoU of .80 from a box so, .25 reduced as images are
elsewhere; in 2784x2080 a model from one mask has .93 for .71, and .89 with 1200 pixels a side."""

TEXTURE = (
    "light",
    "red",
    "blue",
    "slope_light",
    "slope_colour",
    "slope",
    "tensor1",
    "tensor2",
)
"""Planes of one scale in the order of the native core: smoothed L, a, b, gradient sizes, structure tensor."""

MEAN_LEVEL, MAX_GAIN, SAMPLE_STEP = 100.0, 4.0, 4
"""Mean grey level after the correction of exposure, the largest factor applied either way, and the sampling step in
pixels."""

DARK_QUANTILE, HAZE_LEVELS = 0.01, (0.4, 0.6)
"""Quantile of the grey levels that should be near zero. If it exceeds these fractions of the mean, part of it (at the
second all of it) is taken for haze or stray light and subtracted."""


@dataclass(frozen=True, eq=False)
class Appearance:
    """An image at the size that features are computed at. What is asked of it is found once.

    Attributes
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey or BGR.
    size : int
        Pixels a side that the reduced image may have.
    even : bool
        Whether it is seen without haze and in even exposure (`normalised_exposure`), as the forests that are shipped see it.
    """

    image: Image
    size: int = WORKING_SIZE
    even: bool = True
    _looks: dict[float, Plane] = field(default_factory=dict, init=False, repr=False)

    @property
    def factor(self) -> int:
        """Pixels a side of the image that become one."""
        return reduction(self.image.shape, self.size)

    @property
    def shape(self) -> tuple[int, int]:
        """(h, w) of the reduced image."""
        return reduced_shape(self.image.shape, self.factor)

    @property
    def usual(self) -> Appearance:
        """The same image as the prior sees it: this one, if that is so."""
        return self if self.even and self.size == WORKING_SIZE else Appearance(self.image)

    @property
    def _shown(self) -> Image:
        """The whole image as it is seen, made anew: kept, it would take as much room as the image."""
        return np.ascontiguousarray(normalised_exposure(self.image) if self.even else self.image)

    @cached_property
    def lab(self) -> Plane:
        """L, a and b, shape (3, h, w)."""
        planes = np.empty((3, *self.shape), np.float32)
        _core.evidence_lab(self._shown, self.factor, planes)
        return planes

    def texture(self, scale: float) -> Plane:
        """``TEXTURE`` at a standard deviation of so many reduced pixels, shape (8, h, w)."""
        if len(self._looks.get(scale, ())) < len(TEXTURE):
            self._looks[scale] = self._looked(_core.evidence_texture, scale, len(TEXTURE))
        return self._looks[scale]

    def smoothed(self, scale: float) -> Plane:
        """L, a and b at that scale, shape (3, h, w)."""
        return self._colours(scale)[:3]

    def slope(self, scale: float) -> Plane:
        """The size of their gradient at that scale, shape (h, w)."""
        look = self._colours(scale)
        plane: Plane = look[TEXTURE.index("slope") if len(look) == len(TEXTURE) else -1]
        return plane

    def _colours(self, scale: float) -> Plane:
        """The texture, if it is known, or four planes that are found in a third of the time: L, a, b, and their gradient."""
        if scale not in self._looks:
            self._looks[scale] = self._looked(_core.evidence_colour, scale, 4)
        return self._looks[scale]

    def _looked(self, look: Callable[[Plane, float, Plane], None], scale: float, count: int) -> Plane:
        planes = np.empty((count, *self.shape), np.float32)
        look(self.lab, scale, planes)
        return planes


def reduction(shape: tuple[int, ...], size: int = WORKING_SIZE) -> int:
    """The integer factor by which an image of this shape is reduced."""
    return max(1, -(-max(shape[:2]) // size))


def size_to_see(shape: tuple[int, ...], depth: float) -> int:
    """Pixels a side that the reduced image may have so that things of this depth, px, are seen `MIN_DEPTH` deep, or nearly."""
    longest = max(shape[:2])
    factor = min(reduction(shape), max(int(depth / MIN_DEPTH), -(-longest // MAX_SIZE), 1))
    return max(WORKING_SIZE, -(-longest // factor))


def reduced_shape(shape: tuple[int, ...], factor: int) -> tuple[int, int]:
    """Rows and columns of the reduced image."""
    return -(-shape[0] // factor), -(-shape[1] // factor)


def normalised_exposure(image: Image) -> Image:
    """The image without haze and with its mean level at `MEAN_LEVEL`."""
    counts = np.bincount(image[::SAMPLE_STEP, ::SAMPLE_STEP].ravel(), minlength=256)
    darkest = float(np.searchsorted(np.cumsum(counts), DARK_QUANTILE * counts.sum()))
    mean = max(float(counts @ np.arange(256)) / float(counts.sum()), 1.0)
    veil = darkest * min(max((darkest / mean - HAZE_LEVELS[0]) / (HAZE_LEVELS[1] - HAZE_LEVELS[0]), 0.0), 1.0)
    gain = min(max(MEAN_LEVEL / max(mean - veil, 1.0), 1 / MAX_GAIN), MAX_GAIN)
    levels = np.clip(np.rint((np.arange(256) - veil) * gain), 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(image, levels), np.uint8)
