"""Overlays: the image with its contours drawn on it."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from ffseg.arrays import Image, Mask, Points
from ffseg.geometry.freeform import FreeForm
from ffseg.io.masks import encode_picture

Kind = Literal["outer", "obstacle", "false", "untested", "agrees", "differs", "silent"]
COLOURS: dict[Kind, tuple[int, int, int]] = {
    "outer": (80, 220, 60),
    "obstacle": (60, 60, 240),
    "false": (240, 180, 40),
    "untested": (40, 200, 250),
    "agrees": (255, 255, 120),
    "differs": (160, 60, 255),
    "silent": (170, 170, 170),
}
"""BGR: green free space, red obstacles, blue ground given back, yellow what no point tested; of points drawn on demand:
cyan agrees with the ground, magenta differs, grey says nothing."""

_TINT_FRACTION = 0.25
"""Of the green in what is inside: the picture stays readable below."""
_TINTED = np.rint((1 - _TINT_FRACTION) * np.arange(256)[:, None] + _TINT_FRACTION * np.array(COLOURS["outer"])).astype(
    np.uint8
)[:, None, :]
"""What each level of each channel becomes inside, shape (256, 1, 3)."""
FLATNESS = 0.1
"""Tolerance of the lines drawn on pictures, px: a tenth of a line's width."""
_SHIFT = 4  # bits of a pixel fraction OpenCV draws with: 1/16 px, below what a line of one pixel can show
_FAR = 1 << 14  # px: fixed-point coordinates overflow 32 bits beyond 2**27; 2**14 is outside every image that is read


@dataclass(frozen=True, slots=True, eq=False)
class Polyline:
    """One flattened closed contour.

    Attributes
    ----------
    points : ndarray of float64, shape (n, 2)
        Pixels, (x, y), integer values at pixel centres; the last point joins the first.
    kind : {"outer", "obstacle", "false", "untested", "agrees", "differs", "silent"}
    """

    points: Points
    kind: Kind


def polylines(contours: Iterable[FreeForm], tolerance: float = FLATNESS) -> list[Polyline]:
    """Contours within `tolerance` pixels, as lines to draw: those of positive area as outer ones, holes as obstacles."""
    return [Polyline(one.flatten(tolerance), "outer" if one.signed_area > 0 else "obstacle") for one in contours]


def as_colour(image: Image) -> Image:
    """The image in BGR, contiguous: itself if it is so."""
    return np.ascontiguousarray(image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2))


def draw_overlay(image: Image, polylines: Sequence[Polyline], mask: Mask | None = None) -> Image:
    """Image with the region tinted and closed antialiased lines, outer ones last so that they stay visible.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    mask : ndarray of bool, shape (H, W), optional
        Region to tint.

    Returns
    -------
    ndarray of uint8, shape (H, W, 3), BGR
    """
    canvas = as_colour(image)
    canvas = canvas.copy() if canvas is image else canvas
    if mask is not None:
        inside = np.ascontiguousarray(mask).view(np.uint8)
        canvas = np.asarray(cv2.copyTo(cv2.LUT(canvas, _TINTED), inside, canvas), np.uint8)
    thickness = 1 if max(canvas.shape[:2]) < 1000 else 2
    for line in sorted(polylines, key=lambda line: line.kind == "outer"):
        fixed = np.rint(np.clip(line.points, -_FAR, _FAR) * (1 << _SHIFT)).astype(np.int32)
        cv2.polylines(canvas, [fixed], True, COLOURS[line.kind], thickness, cv2.LINE_AA, _SHIFT)
    return canvas


def encode_overlay(
    image: Image, polylines: Sequence[Polyline], mask: Mask | None = None, suffix: str = ".png"
) -> bytes:
    """File of `draw_overlay`: PNG packed for speed, or JPEG or WebP by the suffix."""
    options = [cv2.IMWRITE_PNG_COMPRESSION, 1] if suffix == ".png" else []
    return encode_picture(draw_overlay(image, polylines, mask), suffix, options)


def encode_cutout(image: Image, mask: Mask, suffix: str = ".png") -> bytes:
    """PNG or WebP file of the image inside the region, transparent and black elsewhere."""
    opaque = np.where(mask, np.uint8(255), np.uint8(0))
    cut = np.ascontiguousarray(np.dstack([as_colour(image) * mask[..., None], opaque]))
    return encode_picture(cut, suffix, [] if suffix == ".png" else [cv2.IMWRITE_WEBP_QUALITY, _LOSSLESS])


_LOSSLESS = 101
"""From 101 on OpenCV's WebP keeps every pixel."""


def encode_jpeg(image: Image, quality: int, *, sharp: bool = False) -> bytes:
    """JPEG file of a grey or BGR image, of a quality from 0 to 100; where it is to be sharp, with a colour for each pixel."""
    how = [cv2.IMWRITE_JPEG_QUALITY, quality]
    if sharp:
        how += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    return encode_picture(np.ascontiguousarray(image), ".jpg", how)


def jpeg_address(image: Image, quality: int) -> str:
    """``data:`` address of `encode_jpeg`, to stand in a document."""
    return "data:image/jpeg;base64," + base64.b64encode(encode_jpeg(image, quality)).decode("ascii")
