"""Mask files read back, images and masks written, boxes round truths."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ffseg.io.masks import decode_mask
from ffseg.metrics import INSIDE


def read_mask(path: str | Path) -> NDArray[np.bool_]:
    """The region of a mask file, shape (H, W)."""
    return decode_mask(Path(path).read_bytes())


def write_image(path: Path, levels: NDArray[np.generic]) -> None:
    """Write levels, or 255 inside and 0 outside of a mask, into a folder that need not be there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pixels = np.where(levels, np.uint8(255), np.uint8(0)) if levels.dtype == bool else levels
    path.write_bytes(cv2.imencode(path.suffix, pixels)[1].tobytes())


def box_round(truth: NDArray[np.uint8], further: ArrayLike = 0.0) -> NDArray[np.float64]:
    """Left, top, right, bottom of what is inside; each side so much further out, in parts of the mean of the sides."""
    left, top, width, height = cv2.boundingRect((truth == INSIDE).astype(np.uint8))
    tight = np.array([left, top, left + width, top + height]) - 0.5
    return tight + np.array([-1, -1, 1, 1]) * further * (width + height) / 2
