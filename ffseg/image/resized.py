"""Images and planes in another size."""

from __future__ import annotations

from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

Level = TypeVar("Level", np.uint8, np.float32)


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
