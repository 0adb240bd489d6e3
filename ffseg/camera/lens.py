"""What a lens file can say: a projection with the size of its image and its centre."""

from __future__ import annotations

from dataclasses import dataclass

from ffseg.camera.projections import Projection


@dataclass(frozen=True, slots=True, eq=False)
class Lens:
    """A projection with its image size and centre.

    Attributes
    ----------
    width, height : int
        Pixels.
    center : tuple of float
        (x, y), pixels.
    """

    projection: Projection
    width: int
    height: int
    center: tuple[float, float]
