"""Masks as 8-bit one-channel PNG files; masks read as truth or domain, and those that come with images."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import Any, TypedDict

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image, Mask
from ffseg.errors import ImageReadError, OutputError, ParameterError
from ffseg.io.files import printable, read_bytes
from ffseg.io.images import Limits, decode_image, read_image
from ffseg.parameters import Parameters

# A mask is runs of two values: run-length matching on unfiltered rows packs the 800x600 scenes into half the bytes of
# OpenCV's default, in three quarters of its time. Releases of OpenCV without the filter option choose one themselves.
_OPTIONS = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
if hasattr(cv2, "IMWRITE_PNG_FILTER"):
    _OPTIONS += [cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE]

MAX_LEVELS = 32
"""More levels than this are a photograph, a soft brush or JPEG rather than a mask or class numbers."""

INSIDE = 128
"""A grey level from here on counts as inside when a mask is read."""


def encode_picture(image: Image, suffix: str, options: list[int]) -> bytes:
    """File of a grey or BGR image, with or without alpha, in a format that OpenCV writes.

    Raises
    ------
    OutputError
        If the image is larger than the format holds.
    """
    done, encoded = cv2.imencode(suffix, image, options)
    if not done and suffix == ".png":  # which holds every image that is read
        raise MemoryError("the PNG encoder failed")
    if not done:
        height, width = image.shape[:2]
        raise OutputError(f"{width}x{height} pixels are more than {suffix} holds; write it as .png")
    data: bytes = encoded.tobytes()
    return data


def encode_png(image: Image, options: list[int]) -> bytes:
    """PNG file of a grey or BGR image."""
    return encode_picture(image, ".png", options)


def encode_mask(mask: Mask) -> bytes:
    """PNG file of a region: 255 inside, 0 outside.

    Parameters
    ----------
    mask : ndarray of bool, shape (H, W)
    """
    image = np.ascontiguousarray(mask).view(np.uint8) * np.uint8(255)
    return encode_png(image, _OPTIONS)


def holds_other_than_mask(path: str | os.PathLike[str]) -> bool:
    """Whether a file holds, or may hold, anything but an image of 0 and 255."""
    try:
        image = read_image(path, None, None)
    except ImageReadError as error:
        return error.reason not in ("missing", "empty")
    return image.ndim != 2 or bool((image + np.uint8(1)).max() > 1)  # 255 becomes 0


def decode_mask(data: bytes, limits: Limits | None = None) -> Mask:
    """Content of a mask file as a region, shape (H, W): True from a grey level of `INSIDE` on."""
    inside: Mask = _strongest(decode_image(data, limits)) >= INSIDE
    return inside


def _strongest(image: NDArray[Any]) -> NDArray[Any]:
    levels: NDArray[Any] = image if image.ndim == 2 else image.max(axis=2)
    return levels


def load_mask(key: str, path: str | None, limits: Limits | None = None) -> Image | None:
    """Mask file that a parameter names, shape (H, W): 255 where it is not 0; None without a file.

    Parameters
    ----------
    key : str
        Of the parameter.

    Raises
    ------
    ParameterError
        If it cannot be read, or has more levels than masks have.
    """
    if path is None:
        return None
    limits = limits or Limits()
    try:
        levels = _strongest(decode_labels(read_bytes(path, limits.max_bytes), limits))
    except ImageReadError as error:
        raise ParameterError(f"{key}: {printable(path)}: {error}") from error
    found = np.count_nonzero(cv2.calcHist([levels], [0], None, [1 << 16], [0, 1 << 16]))
    if found > MAX_LEVELS:
        what = f"{printable(path)} holds {found} levels, as a photograph, a soft brush or JPEG does"
        raise ParameterError(f"{key}: {what}; 0 is outside and 255 inside: draw it with a hard brush, save it as PNG")
    return np.where(levels > 0, np.uint8(255), np.uint8(0))


def decode_labels(data: bytes, limits: Limits | None = None) -> Image | NDArray[np.uint16]:
    """Numbers of a label image as its file stores them, shape (H, W) for grey or (H, W, 3) in BGR order for colours.

    Unlike `decode_image`, 16-bit numbers are not scaled: 1 stays 1. The message of an error does not name the file.
    """
    scaled = decode_image(data, limits)
    stored: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR)
    labels: NDArray[Any] = stored if stored is not None and stored.dtype == np.uint16 else scaled
    if labels.ndim == 3 and (labels[:, :, 1:] == labels[:, :, :1]).all():
        labels = labels[:, :, 0]
    return labels


def hides_levels(data: bytes) -> bool:
    """Whether a PNG has levels other than 0 where it is wholly transparent: what is seen of it is not what is stored."""
    if data[:8] != b"\x89PNG\r\n\x1a\n" or data[25:26] not in (b"\x04", b"\x06"):  # its kinds with transparency
        return False
    stored: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if stored is None or stored.ndim < 3 or stored.shape[2] < 4:
        return False
    return bool(stored[stored[:, :, 3] == 0][:, :3].any())


class Bounds(TypedDict):
    """Where the contour may go, start and may not be, as arguments of `ffseg.segment`."""

    domain: Image | None
    start_mask: Image | None
    background: Image | None


@dataclass(frozen=True, slots=True, eq=False)
class Masks:
    """What is known of an image's pixels before it is segmented: 255 or 0, as `load_mask` gives them, or nothing."""

    domain: Image | None = None
    start: Image | None = None
    background: Image | None = None

    @property
    def bounds(self) -> Bounds:
        """As arguments."""
        return {"domain": self.domain, "start_mask": self.start, "background": self.background}

    def within(self, path: str, limits: Limits | None = None) -> Masks:
        """With the domain of one image out of ``domain.masks``; the same without a path."""
        return replace(self, domain=load_mask("domain.masks", path, limits)) if path else self


NO_MASKS = Masks()


def named_masks(params: Parameters, limits: Limits | None = None) -> Masks:
    """The masks that the parameters name."""
    return Masks(
        load_mask("domain.mask", params.domain.mask, limits),
        load_mask("init.mask", params.init.mask, limits),
        load_mask("init.background_mask", params.init.background_mask, limits),
    )
