"""Thumbnails as text, embedded in the report page."""

from __future__ import annotations

import base64
import os

import cv2
import numpy as np

from ffseg.errors import ImageReadError
from ffseg.io.files import read_bytes
from ffseg.io.images import Limits, decode_image

WIDTH = 280
"""px; the page shows cards up to this wide without scaling up."""
_QUALITY = 70
MAX_BYTES = 1 << 28
_LIMITS = Limits(max_bytes=MAX_BYTES, max_pixels=50_000_000)
"""A thumbnail is not worth more; the page links the picture instead."""


def thumbnail(path: str | os.PathLike[str]) -> str:
    """``data:`` address of a WebP of at most `WIDTH` px; empty where the file cannot be read as an image."""
    try:
        return thumbnail_of(read_bytes(path, MAX_BYTES))
    except ImageReadError:
        return ""


def thumbnail_of(data: bytes) -> str:
    """The same of the content of a file; empty also where there is no memory for it."""
    try:
        image = decode_image(data, _LIMITS, "auto")
    except (ImageReadError, MemoryError):
        return ""
    height, width = image.shape[:2]
    scale = min(1.0, WIDTH / max(width, height))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    done, packed = cv2.imencode(".webp", np.ascontiguousarray(small), [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])
    return "data:image/webp;base64," + base64.b64encode(packed.tobytes()).decode("ascii") if done else ""
