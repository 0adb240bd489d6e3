"""The robot's footprint on the ground plane: the cell that each pixel shows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ffseg.camera.model import Camera  # loads what images of other cameras do not need

RADIUS_CELLS = 8
"""Cells of the ground plane per radius of the footprint: the resolution at which passages are measured."""
MAX_CELLS = 2048
"""Cells along a side of the ground plane: 128 radii to each side of the camera. Passages beyond are never closed."""
OUTSIDE_PLANE = -2
"""Cell number of ground beyond the plane."""


@dataclass(frozen=True, slots=True, eq=False)
class Footprint:
    """A disc on the ground plane that a camera sees.

    Attributes
    ----------
    cells : ndarray of int32, shape (H, W)
        Cell of the plane that each pixel's centre shows, ``row << 16 | column``; `OUTSIDE_PLANE` where that lies beyond the
        plane, -1 where it shows no ground, or the robot itself.
    diameter : float
        Of the disc, in cells.
    radius_m : float
        Metres.

    Examples
    --------
    >>> from ffseg.camera.footprint import footprint_of
    >>> footprint = footprint_of(ffseg.load_camera("pictures/pair/camera.yaml"), radius=0.2, own=0.0)
    >>> footprint.cells.shape, footprint.diameter
    ((600, 800), 16.0)
    """

    cells: NDArray[np.int32]
    diameter: float
    radius_m: float


@lru_cache(maxsize=2)
def footprint_of(camera: Camera, radius: float, own: float) -> Footprint:
    """The footprint of a robot in its camera's images.

    Parameters
    ----------
    radius : float
        Metres, above 0.
    own : float
        Pixels round the camera's centre that show the robot itself: edges there are no obstacles.

    Raises
    ------
    CalibrationError
        When the camera file has no mount_height.
    """
    ground = camera.ground()
    cells = np.rint(ground * (RADIUS_CELLS / radius)) + MAX_CELLS // 2
    with np.errstate(invalid="ignore"):
        shown = ((cells >= 0) & (cells < MAX_CELLS)).all(axis=-1)
    beyond = ~shown & np.isfinite(ground).all(axis=-1)
    x, y = np.arange(camera.width) - camera.center[0], np.arange(camera.height) - camera.center[1]
    shown &= x**2 + (y**2)[:, None] > own**2
    column, row = np.where(shown[..., None], cells, 0.0).astype(np.int32).transpose(2, 0, 1)
    packed = np.ascontiguousarray(
        np.where(shown, row << 16 | column, np.where(beyond, np.int32(OUTSIDE_PLANE), np.int32(-1)))
    )
    packed.setflags(write=False)
    return Footprint(packed, 2.0 * RADIUS_CELLS, radius)
