"""Edge maps: gradient magnitude of the smoothed image, diffusion speed (Eq. 8) and Canny edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GRADIENT_SCALE = 32.0
"""Units of ``EdgeMap.gradient`` per grey level and pixel: 255/2*sqrt(2)*32 stays below 2**16."""


@dataclass(frozen=True, slots=True, eq=False)
class EdgeMap:
    """What stops a contour, shared by all segmenters.

    Attributes
    ----------
    gradient : ndarray of uint16, shape (H, W)
        ``|grad (G_sigma * I)|`` in units of 1/32 grey level per pixel (strongest channel of a colour image).
    edges : ndarray of uint8, shape (H, W)
        255 on Canny edge pixels (one pixel thin), 0 elsewhere.
    domain : ndarray of uint8, shape (H, W), or None
        255 where the contour may go, 0 elsewhere; None means the whole image.
    thresholds : tuple of float
        The (low, high) Canny thresholds that were used, in grey levels per pixel.
    """

    gradient: NDArray[np.uint16]
    edges: NDArray[np.uint8]
    domain: NDArray[np.uint8] | None
    thresholds: tuple[float, float]

    def magnitude(self) -> NDArray[np.float64]:
        """Gradient magnitude in grey levels per pixel, shape (H, W)."""
        return self.gradient / GRADIENT_SCALE

    def diffusion(self, exponent: float) -> NDArray[np.float64]:
        """Speed ``F_diff = 1 / (1 + |grad|**exponent)`` of Eq. 8, shape (H, W), in (0, 1]."""
        speed: NDArray[np.float64] = 1.0 / (1.0 + self.magnitude() ** exponent)
        return speed
