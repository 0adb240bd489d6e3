"""The closed free-form contour of Definition 1 as an immutable value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class FreeForm:
    """A closed chain of Bezier patches of one degree.

    Attributes
    ----------
    control_points : ndarray of float64, shape (N * d, 2)
        Pixels, (x, y), as in Definition 1: patch i has the points ``[i*d : i*d + d + 1]``, the last wraps to the first.
    degree : int
        d, 1 to 6.
    """

    control_points: NDArray[np.float64]
    degree: int
