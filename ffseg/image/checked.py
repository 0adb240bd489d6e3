"""Images as people have them at hand: what cannot be taken is told in one sentence how to become one."""

from __future__ import annotations

import os
import reprlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image
from ffseg.errors import SegmentationError
from ffseg.parameters import Levels

_CHANNELS = (1, 3, 4)
_FEW_LEVELS = 15  # of 4 bits: of floats that end below, rounding would leave no picture
_ORDER = "colours are taken as BGR, as cv2 reads them; with rgb=True as RGB, as others do"

Pixels = Image | NDArray[np.uint16] | NDArray[np.floating[Any]]
"""What `taken_image` takes."""


def to_8_bits(image: NDArray[Any], levels: tuple[float, float]) -> Image:
    """The image as 8 bits, with the level of black as 0 and that of white as 255, rounded; what lies beyond is cut."""
    low, high = levels
    share = (np.clip(image, low, high) - low).astype(np.float32) * np.float32(255 / (high - low))
    return np.asarray(np.rint(share), np.uint8)


def taken_image(image: object, rgb: bool = False, levels: Levels = "auto") -> Image:
    """An image as libraries of the field hand it out, as the core takes it: 8 bits, BGR.

    Parameters
    ----------
    image : ndarray of uint8, uint16 or float, shape (H, W) or (H, W, 3)
        16 bits are cut to the upper 8, floats go from 0 to 1, both as `skimage.img_as_ubyte` does; which bits a file uses
        (``input.range: auto``) is not asked of an array.
    rgb : bool
        The channels are red, green, blue.
    levels : tuple of float or "auto"
        Of black and white of an image of other numbers than 8 bits.

    Raises
    ------
    SegmentationError
        As `checked_image`.
    """
    refuse_masked("image", image)
    auto = isinstance(levels, str) and levels == "auto"
    ends = None if auto else ends_of(levels)
    if ends is None and not auto:
        raise SegmentationError(f'levels: {reprlib.repr(levels)} is not "auto" or (black, white), black below white')
    if isinstance(image, np.ndarray) and image.size:
        if ends is not None and image.dtype.kind in "iuf" and image.dtype != np.uint8 and np.isfinite(image).all():
            image = to_8_bits(image, ends)
        elif image.dtype.kind == "u" and image.dtype.itemsize == 2:
            image = (image >> 8).astype(np.uint8)
        elif image.dtype.kind == "f" and image.min() >= 0 and image.max() <= 1:
            image = np.rint(image * image.dtype.type(255)).astype(np.uint8)
    found = checked_image(image)
    return np.ascontiguousarray(found[..., ::-1]) if rgb and found.ndim == 3 else found


def ends_of(levels: object) -> tuple[float, float] | None:
    """Black and white, the one below the other; None of what is no such pair."""
    ends = np.asarray(levels)
    valid = ends.dtype.kind in "iuf" and ends.shape == (2,) and -np.inf < ends[0] < ends[1] < np.inf
    return (float(ends[0]), float(ends[1])) if valid else None


def refuse_masked(name: str, values: object) -> None:
    """Refuse a masked array, whose mask most functions forget.

    Raises
    ------
    SegmentationError
        One sentence with the remedy.
    """
    if type(values).__module__.startswith("numpy.ma"):
        where = ", and domain=~np.ma.getmaskarray(image) for where it counts" if name == "image" else ""
        raise SegmentationError(f"{name} is a masked array; give {name}.filled(0){where}")


def require_size(what: str, array: NDArray[Any], shape: tuple[int, ...], remedy: str) -> None:
    """Refuse an array of another size than an image of this shape.

    Raises
    ------
    SegmentationError
        One sentence, which ends with the remedy.
    """
    if array.shape != shape[:2]:
        (rows, columns), (height, width) = array.shape, shape[:2]
        raise SegmentationError(f"{what} has {columns} x {rows} pixels, the image {width} x {height}; {remedy}")


def checked_image(image: object) -> Image:
    """The image as the core takes it.

    Raises
    ------
    SegmentationError
        One sentence: what it is, and how to make an image of it.
    """
    if not isinstance(image, np.ndarray):
        raise SegmentationError(_not_an_array(image))
    if image.dtype == np.uint8 and image.size and (image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)):
        return np.asarray(image)  # also of a matrix, or of another kind of array
    raise SegmentationError(f"the image must be uint8 of shape (H, W) or (H, W, 3); {_remedy(image)}")


def _not_an_array(image: object) -> str:
    if image is None:
        return "the image is None, which cv2.imread returns for a file it cannot read; check the file's name"
    if isinstance(image, str | os.PathLike):
        return f"the image is a file name; read it first: ffseg.segment(ffseg.read_image({os.fspath(image)!r}))"
    if type(image).__module__.startswith("PIL."):
        return "the image is a PIL image; give its pixels with rgb=True: np.asarray(image.convert('RGB'))"
    if hasattr(image, "numpy"):
        return f"the image is a {type(image).__name__}; give a NumPy array: image.numpy(); {_ORDER}"
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
        if shape[0] in _CHANNELS:
            return f"shape {shape} does not end with the channels; give image.transpose(1, 2, 0)"
        return f"shape {shape} has {shape[2]} channels or is a stack; give one plane, image[..., 0] or image[0]"
    order = f"; {_ORDER}" if image.ndim == 3 and shape[2] > 1 else ""
    if image.ndim == 3 and shape[2] != 3:
        return f"shape {shape} has {shape[2]} channels; give image[..., {'0' if shape[2] == 1 else ':3'}]{order}"
    return _other_pixels(image) + order


def _other_pixels(image: NDArray[Any]) -> str:
    if image.dtype == np.bool_:
        return "for bool give image.astype(np.uint8) * 255"
    if image.dtype.kind == "f" and not np.isfinite(image).all():
        return f"this one of {image.dtype} holds NaN or infinite values; say first what they are: np.nan_to_num(image)"
    if image.dtype.kind not in "fiu":
        return f"this one is of {image.dtype}, which no pixel is"
    low, high = image.min().item(), image.max().item()
    if image.dtype.kind == "f" and low >= 0 and high <= 1:
        return f"for {image.dtype} from 0 to 1 give (image * 255).round().astype(np.uint8)"
    values = f"for {image.dtype} with values from {low:g} to {high:g}"
    rounds = image.dtype.kind != "f" or high > _FEW_LEVELS or bool((image == np.round(image)).all())
    if low >= 0 and high <= 255 and rounds:
        return f"{values} give image.round().astype(np.uint8)"
    ends = f"({low:g}, {high:g})"
    return f"{values}, black and white, give np.interp(image, {ends}, (0, 255)).round().astype(np.uint8)"
