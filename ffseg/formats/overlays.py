"""Overlays: the image with its contours drawn on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.formats.masks import encode_png

Kind = Literal["outer", "obstacle", "false", "untested"]
COLOURS: dict[Kind, tuple[int, int, int]] = {
    "outer": (80, 220, 60),
    "obstacle": (60, 60, 240),
    "false": (240, 180, 40),
    "untested": (40, 200, 250),
}
"""BGR: green free space, red obstacles, blue ground given back, yellow what no point tested."""

_SHIFT = 4  # bits of a pixel fraction OpenCV draws with: 1/16 px, below what a line of one pixel can show
_FAR = 1 << 14  # px: fixed-point coordinates overflow 32 bits beyond 2**27; 2**14 is outside every image that is read


@dataclass(frozen=True, slots=True, eq=False)
class Polyline:
    """One flattened closed contour.

    Attributes
    ----------
    points : ndarray of float64, shape (n, 2)
        Pixels, (x, y), integer values at pixel centres; the last point joins the first.
    kind : {"outer", "obstacle", "false", "untested"}
    """

    points: NDArray[np.float64]
    kind: Kind


def draw_overlay(image: NDArray[np.uint8], polylines: Sequence[Polyline]) -> NDArray[np.uint8]:
    """Image with closed antialiased lines, outer ones last so that they stay visible.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    polylines : sequence of Polyline

    Returns
    -------
    ndarray of uint8, shape (H, W, 3), BGR
    """
    canvas: NDArray[np.uint8] = np.ascontiguousarray(
        image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    )
    canvas = canvas.copy() if canvas is image else canvas
    thickness = 1 if max(canvas.shape[:2]) < 1000 else 2
    for line in sorted(polylines, key=lambda line: line.kind == "outer"):
        fixed = np.rint(np.clip(line.points, -_FAR, _FAR) * (1 << _SHIFT)).astype(np.int32)
        cv2.polylines(canvas, [fixed], True, COLOURS[line.kind], thickness, cv2.LINE_AA, _SHIFT)
    return canvas


def encode_overlay(image: NDArray[np.uint8], polylines: Sequence[Polyline]) -> bytes:
    """PNG file of `draw_overlay`, packed for speed."""
    return encode_png(draw_overlay(image, polylines), [cv2.IMWRITE_PNG_COMPRESSION, 1])
