"""Bird's-eye view of one image: the ground in the robot's frame with the outline of its free space."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ffseg.arrays import Image, Indices, Mask
from ffseg.camera.model import Camera
from ffseg.camera.motion import to_pixels
from ffseg.freespace.outline import Ground
from ffseg.io.overlays import Polyline, encode_overlay

HALF_M, SCALE = 4.0, 80.0
"""Metres from the robot to each side, and pixels a metre."""
UNSEEN_LEVEL = 24
"""Grey level of what the camera does not show as ground."""
SCALE_BAR = np.array([[0.0, 0.0], [0.0, -6.0], [0.0, 0.0], [SCALE, 0.0], [SCALE, -6.0], [SCALE, 0.0]])
"""Polyline of a bar of one metre with ticks at its ends, pixels."""
SCALE_LETTERS = (
    np.array([[-3.0, -9.0], [0.0, -12.0], [0.0, 0.0], [0.0, -12.0]]),
    np.array([[6.0, 0.0], [6.0, -8.0], [10.0, -8.0], [10.0, 0.0], [10.0, -8.0], [14.0, -8.0], [14.0, 0.0], [14.0, -8.0],
              [6.0, -8.0]]),
)  # fmt: skip
"""Polylines of "1 m", drawn forth and back."""


def birds_eye(image: Image, ground: Ground) -> bytes:
    """PNG file of the bird's-eye view: forward up, the robot in the middle; outline, holes and a scale bar of 1 m.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    ground : Ground
        Its free space.
    """
    row, column, seen = _laid_out(ground.camera)
    seen = seen & ground.seen[row, column]
    above = np.where(seen if image.ndim == 2 else seen[..., None], image[row, column], np.uint8(UNSEEN_LEVEL))
    lines = [
        Polyline((HALF_M - ring[:, ::-1]) * SCALE - 0.5, "outer" if number == 0 else "obstacle")
        for rings in ground.polygons
        for number, ring in enumerate(rings)
    ]
    corner = np.array([16.0, above.shape[0] - 14.0])
    lines.append(Polyline(corner + SCALE_BAR, "untested"))
    lines += [Polyline(corner + [SCALE / 2 - 6.0, -8.0] + stroke, "untested") for stroke in SCALE_LETTERS]
    return encode_overlay(above, lines)


Table = tuple[Indices, Indices, Mask]


@lru_cache(maxsize=2)  # most images stand as the camera is mounted
def _laid_out(camera: Camera) -> Table:
    """Row and column in the image of each pixel of the view, and whether it lies in the image."""
    axis = HALF_M - (np.arange(round(2 * HALF_M * SCALE)) + 0.5) / SCALE
    pixels = to_pixels(camera, np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1))
    column, row = np.rint(np.nan_to_num(pixels, nan=-1.0)).astype(np.intp).transpose(2, 0, 1)
    seen = (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
    return np.where(seen, row, 0), np.where(seen, column, 0), seen
