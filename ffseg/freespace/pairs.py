"""A pair of images, and where the ground is expected in the previous one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Array, Image, Indices
from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion
from ffseg.freespace.motion.ground import Doubt, GroundFit, position_slopes, shared_doubt
from ffseg.image.interest import InterestPoints

MIN_SCORE = 0.85
"""Least correlation of a match; wrong ones of 9x9 patches rarely exceed 0.7."""
NOISE_PX = 0.2
"""Pixels: standard deviation of a match per axis, as measured on rendered and real board corners."""
MIN_SIGMAS = 2.0
"""Standard deviations between an altitude and the threshold for it to count."""


@dataclass(frozen=True, slots=True, eq=False)
class ImagePair:
    """Two images of one camera and the motion between them.

    Attributes
    ----------
    current, previous : ndarray of uint8, shape (H, W)
    camera : Camera
        With its true ``up`` at the current image.
    noise : float
        Standard deviation of the pixels' noise, grey levels.
    """

    current: Image
    previous: Image
    camera: Camera
    motion: Motion
    noise: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class MotionUncertainty:
    """Uncertainty of the motion in the previous image, at each component.

    Attributes
    ----------
    shift : ndarray of float64, shape (count, 2)
        Pixels by which the ground would be seen elsewhere.
    covariance : ndarray of float64, shape (count, 2, 2)
        Of that place, squared pixels.
    small : bool
        Whether it is so little that the middle of a component stands for all of it.
    """

    doubt: Doubt
    shift: Array
    covariance: Array
    small: bool

    def of(self, places: list[int]) -> MotionUncertainty:
        """The values of some components."""
        return MotionUncertainty(self.doubt.of(places), self.shift[places], self.covariance[places], self.small)


MAX_SWAY = 0.1
"""Pixels, half the precision of a match: the ends of a component may differ by a third of it, which is negligible beside
the match."""


def motion_uncertainty(pair: ImagePair, middles: Array, doubt: Doubt, fit: GroundFit | None) -> MotionUncertainty:
    """Uncertainty of the motion at the middles of components, shape (count, 2), pixels."""
    slopes = position_slopes(pair.camera, pair.motion, middles) if fit is None else fit.slopes_near(middles)
    shift, covariance = _expected(slopes, doubt, np.arange(len(middles)))
    worst = max(np.abs(shift).max(initial=0.0), np.sqrt(np.trace(covariance, axis1=1, axis2=2).max(initial=0.0)))
    return MotionUncertainty(doubt, shift, covariance, bool(worst < MAX_SWAY))


def propagated(pair: ImagePair, found: InterestPoints, uncertainty: MotionUncertainty | None) -> tuple[Array, Array]:
    """Ground positions of points predicted by the motion from all other components, with their covariances."""
    if uncertainty is None:
        doubt = shared_doubt(pair.motion, 1)
        return _expected(position_slopes(pair.camera, pair.motion, found.pixels), doubt, np.zeros_like(found.owner))
    if uncertainty.small:
        return uncertainty.shift[found.owner], uncertainty.covariance[found.owner]
    return _expected(position_slopes(pair.camera, pair.motion, found.pixels), uncertainty.doubt, found.owner)


def _expected(slopes: Array, doubt: Doubt, owner: Indices) -> tuple[Array, Array]:
    """Shifts of pixels by the corrected motion, shape (n, 2), and their covariances, shape (n, 2, 2)."""
    shift = np.einsum("nij,nj->ni", slopes, doubt.steps[owner])
    covariance: Array = slopes @ doubt.covariances[owner] @ np.swapaxes(slopes, 1, 2)
    return shift, covariance
