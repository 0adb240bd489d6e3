"""What one frame adds to a map: the probability that each cell near the robot is free."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Array, Plane
from ffseg.camera.model import Camera
from ffseg.errors import CalibrationError
from ffseg.freespace.leans import Lean, lean_of
from ffseg.freespace.sequence import Frame
from ffseg.freespace.window import Link
from ffseg.image.resized import OUTSIDE, laid_out, of_shares, read_at

BAND = 0.1
"""Metres behind an outline that are marked occupied: the front of an obstacle is seen, its depth is not."""
ERRS_FREE, ERRS_OCCUPIED = 0.005, 0.015
"""Probabilities that a reading well inside, and well behind, an outline is wrong for reasons other than pixel noise. On
rendered drives three cells in ten thousand inside are not free (nothing moves there), and one in thirty behind is
free, though in all frames alike."""
SHARPNESS = 1.7
"""Log odds of free ground per unit of the interpolated mask: what a straight edge at any angle and place gives (1.64 to
1.76 for every reading; tests/unit/test_occupancy.py)."""
TABLE, BEYOND = 0.05, 1.4
"""Metres between the ground points whose pixels are tabulated (linear interpolation loses a millimetre), and the
multiple of the range they cover: a leaning camera sees farther on one side."""
MAX_POSE_ERROR = 0.2
"""Fraction of a cell by which the error of a pose may shift the far end of a frame's range without being sampled: the
map is as well calibrated as with a twentieth, and most frames are read at one pose instead of four."""
SIGMA_POINTS = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
"""Four sigma points of a pose, in standard deviations of x, y and yaw, with its mean and covariance."""
FREE_LEVEL = 127
"""Grey level of an interpolated mask above which it is more likely free than not."""


@dataclass(frozen=True, slots=True)
class Station:
    """Pose of the camera at a frame, on the map.

    Attributes
    ----------
    x, y, theta : float
        Metres, and the direction of the image's x axis, radians counterclockwise from the map's. Under a mirror, as in a
        poses file; without one y and theta have the other sign.
    sigma_m, sigma_rad : float
        Standard deviations, against the frame of the poses; without poses against the first frame.
    estimated : bool
        Whether it was read off the ground.
    walked : tuple of float
        What the motions of the ground put into these deviations, metres and radians; the rest comes from stated poses.

    Examples
    --------
    >>> ffseg.Station(x=1.0, y=2.0, theta=0.5).estimated
    False
    """

    x: float
    y: float
    theta: float
    sigma_m: float = 0.0
    sigma_rad: float = 0.0
    estimated: bool = False
    walked: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """What a map keeps of a frame.

    Attributes
    ----------
    mask : ndarray of bool, shape (H, W)
        Free space.
    camera : Camera
        As it is mounted.
    links : tuple of Link
        How the ground moved since earlier frames, the nearest first, by the names that the map knows them by.
    sigmas : tuple of float
        Standard deviations of that motion, metres and radians; 0 where it says none.
    lean : Lean or None
        How it leaned; None where the ground does not show it.
    domain : ndarray of bool, shape (H, W), or None
        Where the free space could be; None: wherever the camera shows ground.
    contradicted : bool
        Whether the ground says that its pose is wrong, or that of the frame before.
    """

    mask: NDArray[np.bool_]
    camera: Camera
    links: tuple[Link, ...] = ()
    sigmas: tuple[float, float] = (0.0, 0.0)
    lean: Lean | None = None
    domain: NDArray[np.bool_] | None = None
    contradicted: bool = False


def sighting_of(frame: Frame) -> Sighting:
    """What a map keeps of a frame.

    Raises
    ------
    CalibrationError
        When it is none, or of no camera.
    """
    if not isinstance(frame, Frame):
        raise CalibrationError(f"the frame is of type {type(frame).__name__}; give what ffseg.Sequence.feed returns")
    if frame.lens is None:
        raise CalibrationError("the frame is of no camera; segment with ffseg.Sequence(camera, ...)")
    lean, sigmas = lean_of(frame.lens, frame.camera, frame.motion), sigmas_of(frame)
    return Sighting(frame.mask, frame.lens, frame.links, sigmas, lean, frame.domain, frame.contradicted)


def sigmas_of(frame: Frame) -> tuple[float, float]:
    """Standard deviations of a frame's motion, metres and radians; 0 where it states none."""
    if frame.motion is not None:
        return frame.motion.translation_sigma, frame.motion.rotation_sigma
    return frame.links[0].sigmas if frame.links else (0.0, 0.0)


def read_cells(seen: Sighting, lens: Camera, window: Window, reach: float) -> tuple[NDArray[np.bool_], Plane]:
    """The cells of a window that a frame shows, shape (count, count), and the probability that they are free.

    Parameters
    ----------
    lens : Camera
        The same camera as it is mounted.

    Notes
    -----
    A frame tells of a cell that its pixel shows, or that of the ground just before it; given that, the cell is free as far
    as its own pixel is; between pixels, as much as the mask's rounding leaves open. So the top or the side of a box hides
    what lies behind and beside it, and says nothing of it. Of the poses that it may have been taken from, those that show
    neither say nothing, and most must say something.
    """
    table, station = _ground_pixels(lens, reach), window.station
    shown = lens.domain() if seen.domain is None else seen.domain | seen.mask
    inside = 255 * (seen.mask >= shown).view(np.uint8)  # where the view or the domain ends is no outline
    pixels = [window.laid(table, lens)]
    covered = window.within() & (read_at(shown.view(np.uint8), *pixels[0][:2], nearest=True) > 0)
    if station.sigma_m + reach * station.sigma_rad >= MAX_POSE_ERROR * window.step[0]:
        around = SIGMA_POINTS * [station.sigma_m, station.sigma_m, station.sigma_rad]
        beside = [
            replace(station, x=station.x + x, y=station.y + y, theta=station.theta + turn) for x, y, turn in around
        ]
        pixels = [replace(window, station=one).laid(table, lens) for one in beside]
    (free, often), chances = np.zeros((2, *covered.shape), np.float32), _chances()
    for one in pixels:
        own = read_at(inside, *one[:2])
        most = np.maximum(own, read_at(inside, *one[2:]))
        often += most > FREE_LEVEL
        free += np.where(most > FREE_LEVEL, of_shares(own, most, chances), np.float32(0.5))
    return covered & (2 * often > len(pixels)), free / np.float32(len(pixels))


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """A square of cells round a station: the middle of the first, and the step to the next along x and y; metres.

    Also up to where the station tells of them, and the rotation that levels the camera.
    """

    station: Station
    first: Array
    step: Array
    count: int
    reach: float
    level: Array

    def within(self) -> NDArray[np.bool_]:
        """Cells within range."""
        x, y = (self.first - [self.station.x, self.station.y] + np.arange(self.count)[:, None] * self.step).T
        near: NDArray[np.bool_] = x**2 + (y**2)[:, None] < self.reach**2
        return near

    def laid(self, table: Plane, lens: Camera) -> tuple[Plane, ...]:
        """Values of the table at the cells, as seen by the leaning camera."""
        c, s = np.cos(self.station.theta), np.sin(self.station.theta)
        x, y = self.first - [self.station.x, self.station.y]
        cells = np.array([[self.step[0], 0.0, x], [0.0, self.step[1], y], [0.0, 0.0, lens.mounting()]])
        rays = lens.level() @ self.level.T @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ cells
        middle = len(table) // 2
        places = np.array(
            [[lens.mounting(), 0.0, middle * TABLE], [0.0, lens.mounting(), middle * TABLE], [0.0, 0.0, TABLE]]
        )
        return laid_out(table, places @ rays, self.count)


@lru_cache(maxsize=1)
def _chances() -> Plane:
    """Probability of free ground for each interpolated level of the mask, shape (256,)."""
    part = np.linspace(0.0, 1.0, 256) ** SHARPNESS
    sharp = part / (part + part[::-1])
    return (ERRS_OCCUPIED + (1.0 - ERRS_OCCUPIED - ERRS_FREE) * sharp).astype(np.float32)


@lru_cache(maxsize=2)
def _ground_pixels(camera: Camera, reach: float) -> Plane:
    """Pixels of ground points `TABLE` metres apart, with the camera in the middle, and of those within `BAND` of it.

    Shape (n, n, 4): rows along y of the levelled frame, columns along x; far away where nothing is shown.
    """
    along = TABLE * np.arange(-(side := int(np.ceil(BEYOND * reach / TABLE))), side + 1)
    x, y = np.meshgrid(along, along)
    nearer = np.maximum(1.0 - BAND / np.maximum(np.hypot(x, y), 1e-9), 0.0)
    places = [np.stack([share * x, share * y, np.full_like(x, camera.mounting())], axis=-1) for share in (1.0, nearer)]
    shown, before = (camera.project(place @ camera.level()) for place in places)
    pixels = np.concatenate([shown, before], axis=-1)
    return np.where(np.isfinite(pixels), pixels, OUTSIDE).astype(np.float32)
