"""Decoded inputs: images, evidence maps, true masks; doubtful ones are refused."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image, Plane
from ffseg.batch.plan.beside import ARRAY_SUFFIX
from ffseg.batch.plan.reading import display_path, read_input
from ffseg.batch.plan.sources import InputImage
from ffseg.errors import ImageReadError
from ffseg.io.files import printable
from ffseg.io.images import Limits, decode_image
from ffseg.io.masks import MAX_LEVELS, decode_labels, hides_levels
from ffseg.metrics import IGNORED, INSIDE
from ffseg.parameters import Levels

LabelImage = NDArray[Any]

_DEEP = 257
"""A level of 8 bits is this many of 16."""
_SHOWN = 6
_LOSSY = (".jpg", ".jpeg", ".jpe")
"""Suffixes of files whose levels are not those that were drawn, however few there are."""
_WHITE = {np.dtype(np.uint8): 255.0, np.dtype(np.uint16): 65535.0}
"""What stands for one in whole numbers."""


def read_source(source: InputImage, levels: Levels = "auto") -> Image:
    """Image of a source, shape (H, W) for grey or (H, W, 3) in BGR order.

    Raises
    ------
    ImageReadError
        With one of ``REASONS``; the message names the file.
    """
    try:
        return decode_image(read_input(source.path, Limits().max_bytes, source.span), None, levels)
    except ImageReadError as error:
        raise ImageReadError(error.reason, f"{printable(display_path(source.content))}: {error}") from None


def read_evidence(path: str, limits: Limits | None = None) -> Plane:
    """Map of an image.

    Parameters
    ----------
    path : str
        For `read_input`: grey image of 8 or 16 bits, or a NumPy file of these or of numbers from 0 to 1.

    Returns
    -------
    ndarray of float32, shape (H, W)
        From 0 to 1.

    Raises
    ------
    ImageReadError
        With the reason ``evidence``, naming the file.
    """
    limits, name = limits or Limits(), display_path(path)
    try:
        data = read_input(path, limits.max_bytes)
        if name.lower().endswith(ARRAY_SUFFIX):
            return _array(data)
        levels = decode_labels(data, limits)
        if levels.ndim != 2:
            raise ValueError("it is in colour; save it in grey")
        return _parts(levels)
    except (ImageReadError, ValueError) as error:
        raise ImageReadError("evidence", f"the map {printable(name)} cannot be used: {error}") from error


def _parts(levels: NDArray[Any]) -> Plane:
    """Whole numbers as parts of the largest of their kind."""
    white = _WHITE[levels.dtype]
    if levels.max(initial=0) == 1:
        raise ValueError(f"it holds nothing but 0 and 1, where {white:.0f} is certain; multiply it by {white:.0f}")
    return (levels / np.float32(white)).astype(np.float32)


def _array(data: bytes) -> Plane:
    try:
        values = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    except Exception as error:  # the header is Python text, whose parser raises many kinds
        raise ValueError("it is no NumPy array file (.npy) of numbers") from error
    if not isinstance(values, np.ndarray) or values.ndim != 2 or values.size == 0:
        raise ValueError("it does not hold one value for each pixel, shape (H, W)")
    if values.dtype in _WHITE:
        return _parts(values)
    if values.dtype == np.bool_:
        return values.astype(np.float32)
    if values.dtype.kind != "f" or not (np.isfinite(values).all() and values.min() >= 0 and values.max() <= 1):
        raise ValueError(f"its {values.dtype} values are none of bool, uint8, uint16, and floats from 0 to 1")
    return np.ascontiguousarray(values, np.float32)


def read_truth(path: str, shape: tuple[int, int], label: int | None = None, limits: Limits | None = None) -> Image:
    """True mask of an image.

    Parameters
    ----------
    path : str
        For `read_input`.
    shape : tuple of int
        Height and width of the image.
    label : int or None
        Number that means inside; 255 then is not counted, unless it is the label, and all other numbers are outside.
        None: 255 is inside, 128 not counted, 0 outside, and a file of 0 and 1 only has 1 inside.

    Returns
    -------
    ndarray of uint8, shape (H, W)
        255 inside, 128 not counted, 0 outside.

    Raises
    ------
    ImageReadError
        With the reason ``truth``, naming the file: it cannot be read, has another size, no pixel that counts, or
        numbers whose meaning is not known.
    """
    name, limits = printable(display_path(path)), limits or Limits()
    try:
        data = read_input(path, limits.max_bytes)
        labels = decode_labels(data, limits)
    except ImageReadError as error:
        raise ImageReadError("truth", f"the true mask {name} cannot be used: {error.reason}: {error}") from error
    if hides_levels(data):
        hidden = "has other levels than 0 under transparent pixels; fill those with 0 or 255 and save it without transparency"
        raise ImageReadError("truth", f"the true mask {name} {hidden}")
    if labels.shape[:2] != shape:
        sizes = f"{labels.shape[1]}x{labels.shape[0]}, the image {shape[1]}x{shape[0]}"
        raise ImageReadError("truth", f"the true mask {name} has {sizes} pixels; it must have the image's size")
    try:
        levels = _levels(labels, lossy=name.lower().endswith(_LOSSY)) if label is None else _chosen(labels, label)
    except ValueError as error:
        raise ImageReadError("truth", f"the true mask {name} {error}") from None
    if (levels == IGNORED).all():
        raise ImageReadError(
            "truth", f"the true mask {name} has no pixel that counts: all are {IGNORED}; mark what is known"
        )
    return levels


def _levels(labels: LabelImage, *, lossy: bool) -> Image:
    """Levels of a truth that must say by itself what is inside."""
    if labels.ndim > 2:  # a picture of a mask: what counts is whether a pixel has any colour
        strongest = labels.max(axis=2)
        if not np.isin(strongest, (0, INSIDE)).all():
            raise ValueError("is in colour; save it in grey, 255 inside and 0 outside, or its class numbers")
        return np.asarray(strongest, np.uint8)
    found = np.unique(labels)
    if set(found.tolist()) <= {0, IGNORED, INSIDE}:
        return labels.astype(np.uint8)
    if set(found.tolist()) <= {0, 1}:
        return np.where(labels == 1, np.uint8(INSIDE), np.uint8(0))
    if set(found.tolist()) <= {0, IGNORED * _DEEP, INSIDE * _DEEP}:
        return (labels // _DEEP).astype(np.uint8)
    if lossy or len(found) > MAX_LEVELS:
        raise ValueError(
            f"holds {len(found)} levels, as a soft brush or JPEG leaves at edges; 255 is inside, 128 ignored and 0 outside: "
            "draw it with a hard brush, save it as PNG; or say --truth-label K if they are class numbers"
        )
    shown = ", ".join(map(str, found[:_SHOWN].tolist())) + (", ..." if len(found) > _SHOWN else "")
    raise ValueError(
        f"holds the levels {shown}; 255 is inside, 128 ignored and 0 outside: say --truth-label K if they are class "
        "numbers, or save it anew"
    )


def _chosen(labels: LabelImage, label: int) -> Image:
    """Levels of a truth of which one number is inside."""
    if labels.ndim > 2:
        raise ValueError("is in colour; class numbers need a grey image")
    levels = np.where(labels == label, np.uint8(INSIDE), np.uint8(0))
    if label != INSIDE:
        levels[labels == INSIDE] = IGNORED
    return levels
