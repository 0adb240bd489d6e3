"""Images as people have them at hand: what cannot be taken is told in one sentence how to become one."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.errors import SegmentationError

_CHANNELS = (1, 3, 4)


def checked_image(image: object) -> NDArray[np.uint8]:
    """The image as the core takes it.

    Raises
    ------
    SegmentationError
        One sentence: what it is, and how to make an image of it.
    """
    if not isinstance(image, np.ndarray):
        raise SegmentationError(_not_an_array(image))
    if image.dtype == np.uint8 and image.size and (image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)):
        return image
    raise SegmentationError(f"the image must be uint8 of shape (H, W) or (H, W, 3); {_remedy(image)}")


def _not_an_array(image: object) -> str:
    if image is None:
        return "the image is None, which cv2.imread returns for a file it cannot read; check the file's name"
    if isinstance(image, str | os.PathLike):
        return f"the image is a file name; read it first: ffseg.segment(ffseg.read_image({os.fspath(image)!r}))"
    if type(image).__module__.startswith("PIL."):
        return "the image is a PIL image; give its pixels: np.asarray(image.convert('RGB'))[..., ::-1]"
    if hasattr(image, "numpy"):
        return f"the image is a {type(image).__name__}; give a NumPy array: image.numpy()"
    return f"the image is of type {type(image).__name__}; give a NumPy array of uint8, shape (H, W) or (H, W, 3)"


def _remedy(image: NDArray[Any]) -> str:
    """What an array that is no image is, and how it becomes one."""
    shape = image.shape
    if not image.size:
        return f"this one of shape {shape} has no pixel"
    if image.ndim == 4:
        return f"shape {shape} is a stack; give one image: images[0]"
    if image.ndim not in (2, 3):
        return f"this one has shape {shape}"
    if image.ndim == 3 and shape[2] not in _CHANNELS:
        first = "image.transpose(1, 2, 0)" if shape[0] in _CHANNELS else "image[..., :3]"
        return f"shape {shape} does not end with the channels; give {first}"
    if image.dtype != np.uint8:
        return _other_pixels(image)
    return f"shape {shape} has {shape[2]} channels; give image[..., {'0' if shape[2] == 1 else ':3'}]"


def _other_pixels(image: NDArray[Any]) -> str:
    if image.dtype == np.bool_:
        return "for bool give image.astype(np.uint8) * 255"
    if image.dtype == np.uint16:
        return "for uint16 give (image // 257).astype(np.uint8)"
    if image.dtype.kind == "f" and not np.isfinite(image).all():
        return f"this one of {image.dtype} holds NaN or infinite values; say first what they are: np.nan_to_num(image)"
    if image.dtype.kind not in "fiu":
        return f"this one is of {image.dtype}, which no pixel is"
    if image.dtype.kind == "f" and image.max() <= 1:
        return f"for {image.dtype} from 0 to 1 give (image * 255).round().astype(np.uint8)"
    return f"for {image.dtype} give image.clip(0, 255).astype(np.uint8)"
