"""Types of arrays by their content; the docstrings give their shapes."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
"""True inside."""

Image = NDArray[np.uint8]
"""Grey levels, BGR colours, or a mask of bytes."""

Plane = NDArray[np.float32]
"""One value for each pixel."""

Floats = NDArray[np.float32]
"""Such values in another order: features of pixels in rows, odds of some pixels."""

Level = TypeVar("Level", np.uint8, np.float32)
"""Of what may be an image or a plane."""

Array = NDArray[np.float64]

Points = NDArray[np.float64]
"""Coordinates, x and y along the last axis."""

Indices = NDArray[np.intp]
