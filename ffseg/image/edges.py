"""Edge maps: gradient magnitude of the smoothed image, diffusion speed (Eq. 8) and Canny edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.errors import ParameterError, SegmentationError
from ffseg.image.checked import Pixels, refuse_masked, require_size, taken_image
from ffseg.image.evening import evened
from ffseg.native import _core
from ffseg.parameters import Edges, Levels

GRADIENT_SCALE = 32.0
"""Units of ``EdgeMap.gradient`` per grey level and pixel: 255/2*sqrt(2)*32 stays below 2**16."""
EDGE = 255
"""Value of edge pixels in ``EdgeMap.edges``."""


OVERLAP_ODDS_RATIO = 3.25
"""Odds of the overlap that the prior expects, over the odds of the true IoU: fitted by logistic regression (slope 1.00)
to 127 drawings that it has not learned from, a dozen of each kind (``python -m tests.campaigns.scoring``)."""

CLICK_WEIGHT = 2.0
"""How much of what is doubted clicks take away: k of them leave 1 / (1 + 2 k) of what ratio and slope differ from one. Scores
then fit the IoU of 300 drawings after one to four clicks that correct the prior (.81, .85, .88, .88 for .82, .86, .90, .91), and
of as many after clicks that correct models (ratios of 12, 7.6, 5.7, 4.7 for 12, 6.5, 4.3, 3.3 by regression)."""


@dataclass(frozen=True, slots=True)
class ScoreCalibration:
    """How the overlap that log odds promise becomes the score, the IoU to expect.

    Attributes
    ----------
    slope : float
        Power of the odds of the overlap. Below one where pixels are sure, or unsure, together.
    ratio : float
        What they are then divided by to be the odds of the IoU.

    Raises
    ------
    ParameterError
        If one of them is not above 0 and finite.

    Examples
    --------
    >>> round(ffseg.ScoreCalibration(slope=1.0, ratio=3.25).iou(0.9), 2)
    0.73
    """

    slope: float
    ratio: float

    def __post_init__(self) -> None:
        if not (0 < self.slope < np.inf and 0 < self.ratio < np.inf):
            raise ParameterError(
                f"a score's calibration of slope {self.slope} and ratio {self.ratio} is none; give numbers above 0"
            )

    def iou(self, overlap: float) -> float:
        """Mean IoU of results of which this overlap is promised."""
        inside, outside = pow(overlap, self.slope), self.ratio * pow(1 - overlap, self.slope)
        return float(inside / (inside + outside))

    def overlap(self, iou: float) -> float:
        """The overlap that is promised where this is the IoU to expect."""
        inside, outside = pow(self.ratio * iou, 1 / self.slope), pow(1 - iou, 1 / self.slope)
        return float(inside / (inside + outside))

    def after(self, clicks: int) -> ScoreCalibration:
        """That of what so many clicks have corrected."""
        left = 1 / (1 + CLICK_WEIGHT * clicks)
        return ScoreCalibration(1 + (self.slope - 1) * left, 1 + (self.ratio - 1) * left)


PRIOR_CALIBRATION = ScoreCalibration(1.0, OVERLAP_ODDS_RATIO)
"""That of the prior, and of what is not measured otherwise."""


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
        The (low, high) Canny thresholds in grey levels per pixel; for ``auto`` those of the quieter windows.
    source : str
        What it was made of: ``gradient``, ``prior``, ``model`` or ``evidence``.
    odds : ndarray of float32, shape (H, W), or None
        Where evidence tells a region: the log odds of inside, 0 where the region ends. The edges wall it in: all that
        hangs together in it belongs together, also through places too narrow for a contour.
    calibration : ScoreCalibration
        What the overlap that these promise is worth.
    kept : ndarray of bool, shape (H, W), or None
        Where clicks correct what a model or a map says: the region it tells, but for what clicks take away.
    trial : tuple, optional
        Where the source has asked for a contour: this map, and what it found (`ffseg.contour.trial_result`). It counts for no
        other map, image or method.

    References
    ----------
    Eq. 8 of the paper. Differs: the strongest colour channel instead of grey.

    Examples
    --------
    >>> image = ffseg.read_image("pictures/toy.png")
    >>> edges = ffseg.edge_map(image, ffseg.load_params().edges)
    >>> edges.gradient.dtype, np.unique(edges.edges), ffseg.segment(image, edges=edges).source
    (dtype('uint16'), array([  0, 255], dtype=uint8), 'given')
    """

    gradient: NDArray[np.uint16]
    edges: NDArray[np.uint8]
    domain: NDArray[np.uint8] | None
    thresholds: tuple[float, float]
    source: str = ""
    odds: NDArray[np.float32] | None = None
    kept: NDArray[np.bool_] | None = None
    trial: tuple[EdgeMap, Any] | None = None
    calibration: ScoreCalibration = PRIOR_CALIBRATION

    def magnitude(self) -> NDArray[np.float64]:
        """Gradient magnitude in grey levels per pixel, shape (H, W)."""
        return self.gradient / GRADIENT_SCALE

    def diffusion(self, exponent: float) -> NDArray[np.float64]:
        """Speed ``F_diff = 1 / (1 + |grad|**exponent)`` of Eq. 8, shape (H, W), in (0, 1].

        Raises
        ------
        SegmentationError
            When the exponent is not above 0.
        """
        if not exponent > 0:
            raise SegmentationError(f"exponent is {exponent}: an edge slows down with one above 0")
        speed: NDArray[np.float64] = 1.0 / (1.0 + self.magnitude() ** exponent)
        return speed


def require_edges(edges: EdgeMap, shape: tuple[int, ...]) -> None:
    """Refuse an edge map that is none of an image of this shape.

    Raises
    ------
    SegmentationError
        Saying what is wrong with it.
    """
    for name, kinds in (("edges", "u1"), ("gradient", "u2"), ("domain", "u1 b1"), ("odds", "f4 f8"), ("kept", "b1 u1")):
        plane: object = getattr(edges, name)
        if plane is None and name not in ("edges", "gradient"):
            continue
        if not isinstance(plane, np.ndarray) or plane.dtype not in map(np.dtype, kinds.split()) or plane.ndim != 2:
            found = f"{plane.dtype} of shape {plane.shape}" if isinstance(plane, np.ndarray) else type(plane).__name__
            raise SegmentationError(
                f"the edge map's {name} is {found}; give {np.dtype(kinds.split()[0])} of shape (H, W)"
            )
        require_size("the edge map", plane, shape, "give the map of this image")
    if not ((edges.edges == 0) | (edges.edges == EDGE)).all():
        raise SegmentationError(f"the edge map's edges are {EDGE} on edge pixels and 0 elsewhere; this one has others")
    numbers = np.asarray(edges.thresholds)
    if numbers.shape != (2,) or numbers.dtype.kind not in "iuf" or not np.isfinite(numbers).all():
        raise SegmentationError(f"the edge map's thresholds are {edges.thresholds!r}; give (low, high)")
    told: object = edges.calibration
    if not isinstance(told, ScoreCalibration):
        raise SegmentationError(f"the edge map's calibration is {type(told).__name__}; give an ffseg.ScoreCalibration")


RAYLEIGH_MEDIAN = 1.1774
"""Median of the gradient magnitude of smoothed white noise (Rayleigh) in units of its scale."""

AUTO_HIGH = 5.5
"""High threshold in units of the noise scale: P(Rayleigh > 5.5) = 2.7e-7, less than one false edge in an image."""

AUTO_LOW_RATIO = 0.5
"""Low threshold as a fraction of the high one (Canny recommends a ratio of two to three)."""

AUTO_HIGH_MIN = 1.5
"""Grey levels per pixel: smallest high threshold. Below it lie the rounding steps of 8-bit images (a step of 6 grey
levels at sigma 1.5)."""

AUTO_SPREAD = 2.0
"""The local noise estimate is kept within this factor of that of the quieter windows: shading down to a third spans a
factor of 3, texture more."""


def edge_map(image: Pixels, params: Edges, domain: NDArray[np.uint8] | None = None, levels: Levels = "auto") -> EdgeMap:
    """Edge map of an image (first step of Algorithm 5, Eq. 8).

    Parameters
    ----------
    image : ndarray of uint8, uint16 or float, shape (H, W) or (H, W, 3)
        As `segment` takes it. Colour images contribute their strongest channel at each pixel, in whatever order.
    params : Edges
        ``levels`` and ``highlights`` prepare the image; ``sigma`` in pixels, ``canny`` thresholds in grey levels per pixel
        of the smoothed image, or ``auto``.
    domain : ndarray of uint8 or bool, shape (H, W), optional
        Nonzero where the contour may go; ``auto`` thresholds are measured inside it.
    levels : tuple of float or "auto"
        Of black and white, as ``input.range``.

    Raises
    ------
    SegmentationError
        If the image or the parameters are none, or the domain has another size or type.

    Notes
    -----
    The gradient is a 3x3 Sobel operator on the Gaussian-smoothed image. ``auto`` sets the high threshold from the
    noise: the median gradient in windows of 64 pixels, held near that of the quieter windows, so that neither shading
    nor a noisy sensor asks for other parameters and texture does not pass for noise.

    References
    ----------
    Eq. 8 of the paper. Differs: the strongest colour channel instead of grey, thresholds from the image's own noise.

    Examples
    --------
    >>> edges = ffseg.edge_map(ffseg.read_image("pictures/toy.png"), ffseg.load_params().edges)
    >>> edges.thresholds, edges.edges.shape
    ((0.75, 1.5), (600, 800))
    """
    pixels = taken_image(image, levels=levels)
    shape = pixels.shape[:2]
    if not isinstance(params, Edges):
        raise SegmentationError(
            f"params is of type {type(params).__name__}; give the edges of a parameter set: params.edges"
        )
    domain = _checked_domain(domain, shape)
    planes = np.empty((3, *shape), np.uint8)  # as two pieces, glibc would give back and fault in all pages each time
    gradient, edges = planes[:2].reshape(-1).view(np.uint16).reshape(shape), planes[2]
    _core.gradient_and_ridges(np.ascontiguousarray(evened(pixels, params)), params.sigma, gradient, edges)
    thresholds = _canny(gradient, params, domain, edges)
    return EdgeMap(gradient, edges, domain, thresholds, "gradient")


def _checked_domain(domain: object, shape: tuple[int, ...]) -> NDArray[np.uint8] | None:
    if domain is None:
        return None
    refuse_masked("domain", domain)
    if not isinstance(domain, np.ndarray) or domain.dtype not in (np.uint8, np.bool_) or domain.shape != shape:
        raise SegmentationError(f"the domain must be an array of uint8 or bool of the image's shape {shape}")
    return np.where(domain > 0, np.uint8(255), np.uint8(0))


def _canny(
    gradient: NDArray[np.uint16], params: Edges, domain: NDArray[np.uint8] | None, edges: NDArray[np.uint8]
) -> tuple[float, float]:
    """Turn ridges into Canny edges and return the thresholds, for ``auto`` those of the quieter windows."""
    if params.canny != "auto":
        low, high = params.canny
        _core.canny(gradient, round(low * GRADIENT_SCALE), round(high * GRADIENT_SCALE), edges)
        return low, high
    factor, least = AUTO_HIGH / RAYLEIGH_MEDIAN, AUTO_HIGH_MIN * GRADIENT_SCALE
    noise = _core.canny_auto(gradient, domain, factor, least, AUTO_LOW_RATIO, AUTO_SPREAD, edges)
    high = max(least, factor * noise) / GRADIENT_SCALE
    return AUTO_LOW_RATIO * high, high
