"""Images of inputs, decoded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ffseg.batch.plan.reading import read_input, told
from ffseg.batch.plan.sources import Source
from ffseg.errors import ImageReadError
from ffseg.io.files import printable
from ffseg.io.images import Limits, decode_image
from ffseg.parameters import Levels


def read_source(source: Source, limits: Limits | None = None, levels: Levels = "auto") -> NDArray[np.uint8]:
    """Image of a source, shape (H, W) for grey or (H, W, 3) in BGR order.

    Raises
    ------
    ImageReadError
        With one of ``REASONS``; the message names the file.
    """
    limits = limits or Limits()
    try:
        return decode_image(read_input(source.path, limits.max_bytes, source.span), limits, levels)
    except ImageReadError as error:
        raise ImageReadError(error.reason, f"{printable(told(source.content))}: {error}") from None
