"""What a result was made of, as far as its files tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """What a result was made of.

    Attributes
    ----------
    name : str
        Stands in titles and documents.
    image : ndarray of uint8, shape (H, W) or (H, W, 3), or None
        Needed for an overlay.
    behind : str
        Name of an image file that an SVG shows behind its contours.
    """

    name: str = ""
    image: NDArray[np.uint8] | None = None
    behind: str = ""


NO_SOURCE = Source()
