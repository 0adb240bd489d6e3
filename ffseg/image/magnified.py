"""Enlarged images: the factor, and the image before the enlargement.

Interpolated pixels carry no information: such an image is segmented at its original size, so that it and its enlargement
have the same region.
"""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image, Plane
from ffseg.native import _core

FACTORS = (8, 7, 6, 5, 4, 3, 2)
"""Enlargement factors that are tested."""

INTERPOLATIONS = (cv2.INTER_NEAREST, cv2.INTER_LINEAR, cv2.INTER_CUBIC)

MIN_SIDE = 64
"""Pixels. If the original would have been smaller than this, the image is used as it is."""

LEVEL_TOLERANCE = 2
"""Grey levels by which a pixel may differ from the interpolated value: two roundings, and the cubic kernels of other
programs."""

MAX_DIFFERENT, MAX_DIFFERENT_IN_LINES = 0.01, 0.05
"""Fraction of the pixels, of those unlike their neighbours, that may differ by more: in the whole image, and in a few
lines of it, where cubic kernels clipped at black and white change all pixels near an edge."""

TILES, MAX_DIFFERENT_IN_TILES = 12, 0.02
"""Tiles each way that are tested before the whole image, and the fraction of their pixels that may differ: twice that of all."""

LINE_KNOTS, KERNEL_REACH = 8, 4
"""Pixels of the original from which a tested piece of a line is interpolated, and pixels beside it that the kernel reaches."""

TESTED_LINES, MAX_LINES, LINE_STEP = 2, 100, 8
"""Lines in each direction that are tested before the whole image, those with the largest changes; the most lines that are
compared to find them; and the step, in pixels, at which their changes are measured."""

INVERSION_STEPS, INVERSION_GAIN = 8, 1.5
"""Steps of the iteration that recovers the original, and the gain of each: the finest pattern keeps a quarter of its
amplitude in each direction under interpolation, and at least three eighths of the error is removed."""


def magnification(image: Image, most: float = FACTORS[0]) -> tuple[int, Image]:
    """The integer factor, at most `most`, of an enlargement, and the original; 1 and the image itself if none.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)

    Notes
    -----
    An enlargement by nearest neighbours, linear or cubic interpolation is a picture whose lines lie in the space that the
    enlarged unit vectors span. A few lines each way and tiles all over it tell most others; then the picture before is found by
    back-projection, and must give the whole one.
    """
    height, width = image.shape[:2]
    factors = [
        factor for factor in FACTORS
        if factor <= most and not height % factor and not width % factor and min(height, width) >= MIN_SIDE * factor
    ]  # fmt: skip
    if not factors:
        return 1, image
    plane = image if image.ndim == 2 else image[..., 1]
    rows = _liveliest(plane)
    for factor in factors:
        residuals = _residuals(rows, factor)
        if min(residuals) <= MAX_DIFFERENT_IN_LINES:
            residuals = list(map(max, residuals, _residuals(_liveliest(plane.T), factor)))
        if min(residuals) <= MAX_DIFFERENT_IN_LINES:
            kind = INTERPOLATIONS[residuals.index(min(residuals))]
            if _amiss_in_tiles(plane, factor, kind) > MAX_DIFFERENT_IN_TILES:
                continue
            before = _reduced(image, factor, kind)
            made = cv2.resize(before, (width, height), interpolation=kind)
            unlike = np.count_nonzero(cv2.absdiff(image[:, factor:], image[:, :-factor]) > LEVEL_TOLERANCE)
            if np.count_nonzero(cv2.absdiff(image, made) > LEVEL_TOLERANCE) <= MAX_DIFFERENT * unlike:
                return factor, before
    return 1, image


def _liveliest(plane: Image) -> Plane:
    """The rows with the largest changes, among every few."""
    step = max(1, len(plane) // MAX_LINES)
    return _core.liveliest_lines(plane, TESTED_LINES, step, LINE_STEP).reshape(-1, plane.shape[1])


def _residuals(lines: Plane, factor: int) -> list[float]:
    """For each interpolation, the fraction of the pixels in some lines that it cannot produce from fewer."""
    return _core.lines_amiss(lines, _residual_matrix(factor), factor, LEVEL_TOLERANCE, MAX_DIFFERENT_IN_LINES)


def _amiss_in_tiles(plane: Image, factor: int, kind: int) -> float:
    """Of the pixels unlike their neighbours in some tiles, the fraction that an enlargement cannot produce."""
    side, height, width = (LINE_KNOTS + 2 * KERNEL_REACH) * factor, *plane.shape
    rows, columns = (factor * np.linspace(0, (size - side) // factor, TILES, dtype=int) for size in (height, width))
    if height < side or width < side:
        return 0.0
    tiles = np.stack([plane[y : y + side, x : x + side] for y in rows for x in columns]).astype(np.float32)
    made, reach = _projection(factor, kind), KERNEL_REACH * factor
    inner = tiles[:, reach:-reach, reach:-reach]
    amiss = np.abs(inner - np.clip(made @ tiles @ made.T, 0, 255)) > LEVEL_TOLERANCE
    unlike = np.abs(inner[:, :, factor:] - inner[:, :, :-factor]) > LEVEL_TOLERANCE
    return int(np.count_nonzero(amiss)) / max(int(np.count_nonzero(unlike)), 1)


@cache
def _projection(factor: int, kind: int) -> Plane:
    """Matrix from a line of pixels to the middle of what an interpolation makes of the nearest fewer pixels."""
    made, middle = _interpolation(factor, kind)
    return (made @ np.linalg.pinv(made, rcond=1e-6))[middle].astype(np.float32)


@cache
def _residual_matrix(factor: int) -> Plane:
    """Projection of a line of pixels onto what no interpolation of each kind can produce, shape (L, kinds * L)."""
    found = []
    for kind in INTERPOLATIONS:
        made, middle = _interpolation(factor, kind)
        inner = made[middle]
        found.append(np.eye(len(inner)) - inner @ np.linalg.pinv(inner, rcond=1e-6))
    return np.concatenate(found, axis=1).astype(np.float32)


def _interpolation(factor: int, kind: int) -> tuple[NDArray[np.float64], slice]:
    """Matrix from fewer pixels to a line of pixels, and its middle, which no border reaches."""
    knots = LINE_KNOTS + 2 * KERNEL_REACH
    made = cv2.resize(np.eye(knots, dtype=np.float32), (knots * factor, knots), interpolation=kind).T
    return made.astype(np.float64), slice(KERNEL_REACH * factor, -KERNEL_REACH * factor)


def _reduced(image: Image, factor: int, kind: int) -> Image:
    """The image whose enlargement comes nearest to this one."""
    size = image.shape[1::-1]
    less = (size[0] // factor, size[1] // factor)
    whole = image.astype(np.float32)
    found = cv2.resize(whole, less, interpolation=cv2.INTER_AREA)
    error, change = np.empty_like(whole), np.empty_like(found)
    for _ in range(0 if kind == cv2.INTER_NEAREST else INVERSION_STEPS):
        cv2.resize(found, size, error, interpolation=kind)
        np.subtract(whole, np.clip(error, 0, 255, out=error), out=error)
        cv2.resize(error, less, change, interpolation=cv2.INTER_AREA)
        np.clip(found + np.float32(INVERSION_GAIN) * change, 0, 255, out=found)
    return np.asarray(np.rint(found), np.uint8)
