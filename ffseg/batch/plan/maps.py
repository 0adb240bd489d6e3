"""Maps of evidence by the names of their images: probability of inside or edge strength, from 0 to 1."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.batch.plan.beside import ARRAY_SUFFIX
from ffseg.batch.plan.reading import read_input, told
from ffseg.errors import ImageReadError
from ffseg.io.files import printable
from ffseg.io.images import Limits

REASON = "evidence"
"""Of a failed row: the map of an image cannot be used."""

_WHITE = {np.dtype(np.uint8): 255.0, np.dtype(np.uint16): 65535.0}
"""What stands for one in whole numbers."""


def read_evidence(path: str, limits: Limits | None = None) -> NDArray[np.float32]:
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
    limits, name = limits or Limits(), told(path)
    try:
        data = read_input(path, limits.max_bytes)
        values = _array(data) if name.lower().endswith(ARRAY_SUFFIX) else _levels(data, limits)
    except (ImageReadError, ValueError) as error:
        raise ImageReadError(REASON, f"the map {printable(name)} cannot be used: {error}") from error
    return values


def _levels(data: bytes, limits: Limits) -> NDArray[np.float32]:
    from ffseg.io.masks import decode_labels

    levels = decode_labels(data, limits)
    if levels.ndim != 2:
        raise ValueError("it is in colour; save it in grey")
    return _parts(levels)


def _parts(levels: NDArray[Any]) -> NDArray[np.float32]:
    """Whole numbers as parts of the largest of their kind."""
    white = _WHITE[levels.dtype]
    if levels.max(initial=0) == 1:
        raise ValueError(f"it holds nothing but 0 and 1, where {white:.0f} is certain; multiply it by {white:.0f}")
    return (levels / np.float32(white)).astype(np.float32)


def _array(data: bytes) -> NDArray[np.float32]:
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
        raise ValueError(f"its {values.dtype} values are not all from 0 to 1")
    return np.ascontiguousarray(values, np.float32)
