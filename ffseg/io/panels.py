"""Panels: results of several methods on one image, side by side with their names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ffseg.arrays import Image, Mask
from ffseg.io.masks import encode_png
from ffseg.io.overlays import Polyline, draw_overlay

TILE_WIDTH = 400
"""Pixels: four tiles fit a screen, and a boundary two pixels off shows in an 800x600 image."""
TILE_HEIGHT = 4 * TILE_WIDTH
"""Pixels; what is taller is shown as narrow as it is, or a strip of pixels would fill the memory."""
COLUMNS = 4
STRIP = 24
"""Pixels of the strip the name stands in."""
_WHITE, _DARK = (255, 255, 255), (32, 32, 32)


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """One method's result.

    Attributes
    ----------
    label : str
        ASCII; what stands above the picture.
    mask : ndarray of bool, shape (H, W), or None
        Region to tint; None when there is no result.
    polylines : sequence of Polyline
        Contours to draw.
    """

    label: str
    mask: Mask | None
    polylines: Sequence[Polyline]


def encode_panel(image: Image, tiles: Sequence[Tile]) -> bytes:
    """PNG file with one tile per method, four in a row.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    tiles : sequence of Tile
        At least one.
    """
    drawn = [_drawn(image, tile) for tile in tiles]
    columns = min(COLUMNS, len(drawn))
    blank = np.full_like(drawn[0], _DARK[0])
    drawn += [blank] * (-len(drawn) % columns)
    rows = [np.hstack(drawn[start : start + columns]) for start in range(0, len(drawn), columns)]
    return encode_png(np.ascontiguousarray(np.vstack(rows)), [cv2.IMWRITE_PNG_COMPRESSION, 3])


def _drawn(image: Image, tile: Tile) -> Image:
    picture = draw_overlay(image, tile.polylines, tile.mask)
    height, width = image.shape[:2]
    scale = min(TILE_WIDTH / width, TILE_HEIGHT / height)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    drawn = np.full((STRIP + size[1], TILE_WIDTH, 3), _DARK, np.uint8)
    cv2.putText(drawn[:STRIP], tile.label, (6, STRIP - 7), cv2.FONT_HERSHEY_SIMPLEX, 0.5, _WHITE, 1, cv2.LINE_AA)
    drawn[STRIP:, : size[0]] = small
    return drawn
