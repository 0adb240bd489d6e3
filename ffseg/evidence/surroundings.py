"""Further features of the prior: paths at coarse scales, the border of the image, typical gradients."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image, Mask, Plane
from ffseg.evidence.features import (
    BARRIER_FEATURES,
    GEODESIC_SCALE,
    GEODESIC_SCALES,
    GRADIENT_STEP,
    SCALES,
    Features,
    barriers,
    geodesic,
    reduced_region,
)
from ffseg.evidence.maps import logarithm, logarithm_of
from ffseg.image.appearance import reduced_shape
from ffseg.image.parts import dilated
from ffseg.native import _core

STRIDE = 2
"""The forest is evaluated at every second pixel in each direction; neighbouring pixels have nearly the same features."""

OWN_WEIGHT, VOTE_CONTRAST, VOTE_STEPS = 0.02, 2.0, 40
"""Edge-preserving smoothing of the log odds by diffusion, which removes the seams of tiles and specks of light: the
weight of a pixel's own log odds in each step, the difference of L, a, b at which the exchange between neighbours
ends, and the number of steps."""

FINEST, COLOURS = (
    tuple(f"{name}@{scale:g}" for name in ("light", "red", "blue")) for scale in (SCALES[0], GEODESIC_SCALE)
)

FRAME_WIDTH = 0.03
"""Width of the image border whose colours are compared with the start's, as a fraction of the square root of the image
area."""

PASSAGE_WIDTHS = (3, 5)
"""Evaluated pixels: barrier distances are also computed through passages of at least these widths only."""

NEAR_RADII = 5.0
"""Radii of the start within which the typical gradient is measured."""

GRADIENT_FLOOR = 0.02
"""Units of L, a, b per pixel added to gradients before taking logarithms; below sensor noise."""

FINE_SCALES = ("0.7", "1.5")
"""Scales whose gradients are compared with usual ones."""

SURROUNDINGS_FEATURES = (
    *(f"{name}@{scale:g}" for scale in GEODESIC_SCALES[1:] for name in BARRIER_FEATURES),
    "way",
    "frame_hardness",
    "start_or_frame",
    "start_to_frame",
    *(f"{name}~{width}" for width in PASSAGE_WIDTHS for name in BARRIER_FEATURES[1:]),
    "frame_likeness",
    "likeness~3",
    "unusual@0.7",
    "unusual@1.5",
    "start_slope",
    "chroma",
)
"""Names of the planes in their order."""


def surroundings(seen: Features, out: Plane) -> None:
    """Write the planes that ``SURROUNDINGS_FEATURES`` names, all finite.

    Parameters
    ----------
    out : ndarray of float32, shape (len(SURROUNDINGS_FEATURES), ceil(h / STRIDE), ceil(w / STRIDE))
        Of every ``STRIDE``-th pixel each way.
    """
    start = reduced_region(seen.inside > 0, STRIDE)
    slopes = {name: steepest(seen[f"slope@{name}"]) for name in (*FINE_SCALES, "3")}
    colours = colours_of(seen)
    to = dict(zip(SURROUNDINGS_FEATURES, out, strict=True))
    _write_ways(slopes, start, out, to)
    _write_likenesses(seen, colours, to)
    crossed = {FINE_SCALES[0]: strided(seen[f"barrier@{FINE_SCALES[0]}"]), FINE_SCALES[1]: to["barrier@1.5"]}
    _write_compared(slopes, crossed, start > 0, to)
    np.sqrt(colours[1] ** 2 + colours[2] ** 2, out=to["chroma"])


def write_strided(seen: Features, names: tuple[str, ...], out: Plane) -> None:
    """Write every ``STRIDE``-th pixel each way of the planes of those names."""
    _core.evidence_thin([seen[name] for name in names], out)


def colours_of(seen: Features) -> Plane:
    """``COLOURS`` of every ``STRIDE``-th pixel each way."""
    planes = np.empty((len(COLOURS), *reduced_shape(seen.inside.shape, STRIDE)), np.float32)
    write_strided(seen, COLOURS, planes)
    return planes


def likeness(colours: Plane, region: Image) -> Plane:
    """Log likelihood ratio of each colour, in a region over in the whole image."""
    ratio = np.empty(region.shape, np.float32)
    _core.evidence_likelihood(colours, region, ratio)
    return ratio


def likelihood_ratio(colours: Plane, region: Mask) -> Plane:
    """Log likelihood ratio of each colour, in a region over outside it; zero if either is empty."""
    if not region.any() or region.all():
        return np.zeros(region.shape, np.float32)
    return likeness(colours, region.view(np.uint8)) - likeness(colours, (~region).view(np.uint8))


def voted(odds: Plane, seen: Features) -> Plane:
    """Log odds of every ``STRIDE``-th pixel after edge-preserving diffusion."""
    found, lab = np.empty_like(odds), np.empty((len(FINEST), *odds.shape), np.float32)
    write_strided(seen, FINEST, lab)
    _core.evidence_diffuse(np.ascontiguousarray(odds), lab, OWN_WEIGHT, VOTE_CONTRAST, VOTE_STEPS, found)
    return found


def _write_ways(slopes: dict[str, Plane], start: Image, out: Plane, to: dict[str, Plane]) -> None:
    """Geodesic and barrier distances from the start and from the border of the image, also through wide passages only."""
    slope, count = slopes["1.5"], len(BARRIER_FEATURES)
    for at, scale in enumerate(GEODESIC_SCALES[1:]):
        barriers(slopes[f"{scale:g}"], start, out[at * count : (at + 1) * count])
    geodesic(slope, start, to["way"])
    frame = barriers(slope, _frame(slope.shape, 1))[:2]
    to["frame_hardness"][:] = frame[1]
    to["start_or_frame"][:] = logarithm((to["barrier@1.5"] + 1) / (frame[0] + 1))
    to["start_to_frame"][:] = logarithm_of(float(np.median(frame[0][start > 0])) + 1)
    for passage in PASSAGE_WIDTHS:
        wide = barriers(dilated(slope, passage), start)
        for name, plane in zip(BARRIER_FEATURES[1:], wide[1:], strict=True):
            to[f"{name}~{passage}"][:] = plane


def _write_likenesses(seen: Features, colours: Plane, to: dict[str, Plane]) -> None:
    """Log likelihood ratios of colours: border of the image over image, of pixels and of their surroundings."""
    size = float(np.sqrt(seen.inside.shape[0] * seen.inside.shape[1]))
    frame = _frame(colours[0].shape, max(2, int(FRAME_WIDTH * size)) // STRIDE)
    _core.evidence_blur(likeness(colours, frame), 1.0 / STRIDE, to["frame_likeness"])
    _core.evidence_blur(strided(seen["likeness"]), 3.0 / STRIDE, to["likeness~3"])


def _write_compared(slopes: dict[str, Plane], crossed: dict[str, Plane], inside: Mask, to: dict[str, Plane]) -> None:
    """Barriers on the path to a pixel relative to the typical gradient near the start; the gradient in the start."""
    rows, columns = np.nonzero(inside)
    y, x = np.arange(inside.shape[0])[:, None] - rows.mean(), np.arange(inside.shape[1]) - columns.mean()
    near = y * y + x * x <= NEAR_RADII**2 * np.count_nonzero(inside) / np.pi
    for name in FINE_SCALES:
        usual = np.median(slopes[name][near]) + GRADIENT_FLOOR
        to[f"unusual@{name}"][:] = logarithm((crossed[name] * GRADIENT_STEP + GRADIENT_FLOOR) / usual)
    to["start_slope"][:] = logarithm_of(float(np.median(slopes["1.5"][inside]) + np.float32(GRADIENT_FLOOR)))


def steepest(slope: Plane) -> Plane:
    """The largest gradient of each ``STRIDE`` x ``STRIDE`` block, so that no path slips between two evaluated pixels."""
    found = np.empty(reduced_shape(slope.shape, STRIDE), np.float32)
    _core.evidence_steepest(np.ascontiguousarray(slope), found)
    return found


def strided(plane: NDArray[Any]) -> NDArray[Any]:
    """Every ``STRIDE``-th pixel each way, C-contiguous."""
    return np.ascontiguousarray(plane[::STRIDE, ::STRIDE])


def _frame(shape: tuple[int, int], width: int) -> Image:
    frame = np.ones(shape, np.uint8)
    frame[width:-width, width:-width] = 0
    return frame
