"""Images and planes in another size, laid out by a homography, or read between their pixels."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Array, Image, Level, Plane
from ffseg.image.appearance import reduced_shape, reduction


def resized(plane: NDArray[Level], shape: tuple[int, int]) -> NDArray[Level]:
    """An image or a plane in another size: reduced by the mean of what becomes a pixel, enlarged linearly.

    Parameters
    ----------
    plane : ndarray of uint8 or float32, shape (H, W) or (H, W, 3)
    shape : tuple of int
        (H, W) wanted.
    """
    way = cv2.INTER_AREA if shape[0] < plane.shape[0] or shape[1] < plane.shape[1] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(np.ascontiguousarray(plane), shape[::-1], interpolation=way), plane.dtype)


def copy_of(image: Image, longest: int) -> tuple[Image, int]:
    """The image with a longer side of at most so many pixels, and how many of its own a side are one of these."""
    factor = reduction(image.shape, longest)
    return image if factor == 1 else resized(image, reduced_shape(image.shape, factor)), factor


OUTSIDE = -1e4
"""Pixel of what is not shown."""


def laid_out(table: Plane, homography: Array, count: int) -> tuple[Plane, ...]:
    """Values of a table, shape (n, n, 4), where a homography takes columns and rows: four planes of `count` a side."""
    how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    laid = cv2.warpPerspective(table, homography, (count, count), flags=how, borderValue=(OUTSIDE,) * 4)
    return tuple(np.asarray(plane, np.float32) for plane in cv2.split(laid))


def read_at(plane: Image, x: Plane, y: Plane, *, nearest: bool = False) -> Image:
    """A plane at pixels: linear between them, or that of the nearest; 0 outside."""
    found = np.empty(x.shape, np.uint8)
    cv2.remap(plane, x, y, cv2.INTER_NEAREST if nearest else cv2.INTER_LINEAR, dst=found)
    return found


def of_shares(part: Image, whole: Image, table: Plane) -> Plane:
    """The values, shape (256,), of how many 255ths of each pixel of a plane another is; the first where there is nothing."""
    return np.asarray(cv2.LUT(cv2.divide(part, whole, scale=255.0), table), np.float32)
