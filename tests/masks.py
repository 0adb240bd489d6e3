"""Mask files read back, images and masks written."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.io.masks import decode_mask


def read_mask(path: str | Path) -> NDArray[np.bool_]:
    """The region of a mask file, shape (H, W)."""
    return decode_mask(Path(path).read_bytes())


def write_image(path: Path, levels: NDArray[np.generic]) -> None:
    """Write levels, or 255 inside and 0 outside of a mask, into a folder that need not be there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pixels = np.where(levels, np.uint8(255), np.uint8(0)) if levels.dtype == bool else levels
    path.write_bytes(cv2.imencode(path.suffix, pixels)[1].tobytes())
