"""Mask files read back."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ffseg.io.masks import decode_mask


def read_mask(path: str | Path) -> NDArray[np.bool_]:
    """The region of a mask file, shape (H, W)."""
    return decode_mask(Path(path).read_bytes())
