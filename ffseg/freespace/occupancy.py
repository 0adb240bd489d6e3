"""An occupancy grid of a drive: free space of its frames, fused in log-odds over poses, as ROS's map_server reads it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from math import erf

import numpy as np
from numpy.typing import NDArray

from ffseg.camera.model import Camera
from ffseg.camera.motion import Pose
from ffseg.camera.projections import Array
from ffseg.errors import CalibrationError
from ffseg.freespace.outline import OUTLINE_SIGMA
from ffseg.freespace.sequence import Frame
from ffseg.freespace.skeleton import Skeleton, skeleton_of
from ffseg.freespace.window import Link
from ffseg.image.free import signed_distance
from ffseg.io.files import make_folder, write_all_atomic
from ffseg.io.overlays import Kind, Polyline, encode_overlay
from ffseg.io.tables import csv_table

OCCUPIED, FREE = 0.65, 0.25
"""Probabilities above which a cell is occupied and below which it is free, map_server's own defaults."""
UNKNOWN_LEVEL, FREE_LEVEL, OCCUPIED_LEVEL = 128, 254, 0
"""Grey levels of map.pgm. map_saver's own 205 for unknown stands for 0.196 and would be read as free below 0.25."""
BAND = 0.1
"""Metres behind an outline that are told occupied: what stands there has a front, and nothing is known of its depth."""
BLOCK = 64
"""Cells by which the grid grows, so that a robot that drives on does not copy it at every frame."""
SURE = 4.0
"""Log-odds that one frame tells at most: one outline in fifty is wrong for reasons that no pixel noise explains."""
LIMIT = 8.0
"""Log-odds of a cell at most, so that what has moved away is forgotten after a few frames."""
SAME = 0.35
"""Part of its log-odds that a frame adds to a cell that is known already: neighbouring frames see an outline with the
same error."""
ODOMETRY = 0.02, np.deg2rad(0.5)
"""Standard deviations of a step whose motion says none: relative to its length, and radians."""
ZOOM, WIDEST, MARGIN = 4, 2400, 8
"""Pixels of a cell in the picture, fewer where one of its sides would be longer than that many; cells round what is known."""


@dataclass(frozen=True, slots=True)
class Station:
    """Where the camera was at a frame, on the map.

    Attributes
    ----------
    x, y, theta : float
        Metres and radians, of the levelled camera frame; as in a poses file.
    sigma_m, sigma_rad : float
        Standard deviations against the first frame: 0 where poses were given without their own.
    estimated : bool
        Whether it was read off the ground.

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


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """What a map takes of a frame.

    Attributes
    ----------
    mask : ndarray of bool, shape (H, W)
        Free space.
    camera : Camera
        As it stood.
    links : tuple of Link
        How the ground moved since earlier frames, the nearest first, by the names that the map knows them by.
    sigmas : tuple of float
        Standard deviations of that motion, metres and radians; 0 where it says none.
    """

    mask: NDArray[np.bool_]
    camera: Camera
    links: tuple[Link, ...] = ()
    sigmas: tuple[float, float] = (0.0, 0.0)


def sighting_of(frame: Frame) -> Sighting:
    """What a map takes of a frame.

    Raises
    ------
    CalibrationError
        When the frame is of no camera.
    """
    motion = frame.motion
    sigmas = (0.0, 0.0) if motion is None else (motion.translation_sigma, motion.rotation_sigma)
    return Sighting(frame.mask, frame.standing(), frame.links, sigmas)


class OccupancyMap:
    """A grid on the ground, fed with the frames of a `Sequence`.

    The map's frame is that of the poses; without poses the first frame's. Its x axis is theirs, and its y axis lies to
    the left of it as seen from above: theirs under a mirror, turned over without one.

    Parameters
    ----------
    cell : float
        Side of a cell, metres.
    reach : float
        Metres from the camera up to which a frame is believed.

    Raises
    ------
    CalibrationError
        When one of them is not above 0.

    Examples
    --------
    >>> camera = ffseg.load_camera("pictures/pair/camera.yaml")
    >>> names = ["0001.png", "0002.png"]
    >>> poses = ffseg.load_poses("pictures/pair/poses.csv", names, camera)
    >>> grid, sequence = ffseg.OccupancyMap(cell=0.1), ffseg.Sequence(camera)
    >>> all(grid.add(sequence.feed(ffseg.read_image(f"pictures/pair/{one}"), poses[one]), poses[one]) for one in names)
    True
    >>> len(grid.stations), grid.probability.ndim
    (2, 2)
    """

    def __init__(self, cell: float = 0.05, reach: float = 4.0) -> None:
        if not (cell > 0 and reach > 0 and np.isfinite([cell, reach]).all()):
            raise CalibrationError("cell and reach of a map are metres above 0")
        self.cell, self.reach = cell, reach
        self._odds = np.zeros((0, 0), np.float32)
        self._corner = np.zeros(2, np.int64)  # cell number of the first column and row
        self._stations: dict[str, Station | None] = {}
        self._flip = 1.0

    @property
    def probability(self) -> NDArray[np.float64]:
        """That a cell is occupied, shape (rows, columns): rows along y, columns along x, 0.5 where nothing is known."""
        odds: NDArray[np.float64] = self._odds.astype(np.float64)
        return 1.0 / (1.0 + np.exp(-odds))

    @property
    def origin(self) -> tuple[float, float]:
        """(x, y) of the outer corner of the first cell, metres."""
        x, y = (self._corner * self.cell).tolist()
        return x, y

    @property
    def stations(self) -> tuple[Station | None, ...]:
        """One for each frame; None where neither a pose nor the ground told where it was, and nothing was added."""
        return tuple(self._stations.values())

    @property
    def drift(self) -> tuple[float, float]:
        """Standard deviations of the last station against the first, metres and radians: what the map may be bent by."""
        last = next((one for one in reversed(self.stations) if one is not None), None)
        return (0.0, 0.0) if last is None else (last.sigma_m, last.sigma_rad)

    def add(self, frame: Frame, pose: Pose | None = None) -> bool:
        """Fuse a frame: the next one of its sequence.

        Parameters
        ----------
        frame : Frame
        pose : Pose, optional
            As `Sequence.feed` takes it. Without one the place follows from the motion since an earlier frame.

        Returns
        -------
        bool
            Whether it could be placed; the map stays as it was otherwise.

        Raises
        ------
        CalibrationError
            When the frame is of no camera.
        """
        return self.fuse(str(len(self._stations)), sighting_of(frame), pose)

    def fuse(self, name: str, seen: Sighting, pose: Pose | None = None) -> bool:
        """The same of a frame that is known by a name, which later frames' links may give.

        Parameters
        ----------
        name : str
            Not one that was used before.
        seen : Sighting
        pose : Pose, optional
        """
        station = self._stations[name] = self._placed(seen, pose)
        if station is not None:
            self._flip = 1.0 if seen.camera.mirrored else -1.0
            self._add(seen, station)
        return station is not None

    def miss(self, name: str) -> None:
        """Take note of a frame that is not there."""
        self._stations[name] = None

    def _placed(self, seen: Sighting, pose: Pose | None) -> Station | None:
        if pose is not None:
            turn = pose.rotation @ seen.camera.level().T
            theta = float(np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1]))
            return Station(float(pose.position[0]), float(pose.position[1]), theta, *(pose.sigmas or (0.0, 0.0)))
        if not any(self.stations):
            return Station(0.0, 0.0, 0.0, estimated=True)
        for link in seen.links:
            before = self._stations.get(link.name)
            if before is not None:
                return _moved(before, link.planar, seen.sigmas)
        return None

    def _add(self, seen: Sighting, station: Station) -> None:
        low = np.floor((np.array([station.x, self._flip * station.y]) - self.reach) / self.cell).astype(np.int64)
        count = int(np.ceil(2 * self.reach / self.cell)) + 1
        self._grow(low, count)
        column, row = (low - self._corner).tolist()
        window = self._odds[row : row + count, column : column + count]
        x, y = np.meshgrid(*((first + np.arange(count) + 0.5) * self.cell for first in low.tolist()))
        told = self._told(seen, station, np.stack([x, y], axis=-1).reshape(-1, 2)).reshape(count, count)
        np.clip(window + np.where(window == 0, 1.0, SAME) * told, -LIMIT, LIMIT, out=window)

    def _told(self, frame: Sighting, station: Station, cells: Array) -> Array:
        """Log-odds of cells, shape (n,), that one frame tells: positive occupied, 0 unknown."""
        away = cells * [1.0, self._flip] - [station.x, station.y]
        c, s = np.cos(station.theta), np.sin(station.theta)
        own = away @ np.array([[c, -s], [s, c]])  # the levelled camera frame
        far = np.hypot(*own.T)
        camera, distance = frame.camera, signed_distance(frame.mask)
        pixels = _pixels(camera, own)
        side = _sampled(distance, pixels)
        nearer = _sampled(distance, _pixels(camera, own * np.maximum(1.0 - BAND / np.maximum(far, 1e-9), 0.0)[:, None]))
        sigma = self._sigma(camera, station, own, pixels, distance)
        with np.errstate(invalid="ignore"):
            seen = (far < self.reach) & _shown(camera, pixels)
            told = seen & ((side > 0) | (nearer > 0))
            free = 0.5 * (1.0 + _erf(side / (sigma * np.sqrt(2.0))))
        free = np.clip(np.where(told, free, 0.5), 1e-9, 1.0 - 1e-9)
        odds: Array = np.clip(np.log((1.0 - free) / free), -SURE, SURE)
        return odds

    def _sigma(
        self, camera: Camera, station: Station, own: Array, pixels: Array, distance: NDArray[np.float32]
    ) -> Array:
        """Standard deviation of an outline at cells across itself, pixels: of the outline, and of the pose."""
        if station.sigma_m == 0.0 and station.sigma_rad == 0.0:
            return np.full(len(own), OUTLINE_SIGMA)
        step = 0.01
        slopes = np.stack([(_pixels(camera, own + step * axis) - pixels) / step for axis in np.eye(2)], axis=-1)
        across = np.stack(
            [_sampled(distance, pixels + axis) - _sampled(distance, pixels - axis) for axis in np.eye(2)], axis=-1
        )
        across /= np.maximum(np.hypot(*across.T), 1e-9)[:, None]
        pull = np.einsum("ni,nij->nj", across, slopes)  # pixels across the outline for a metre along x and y
        turned = pull[:, 0] * -own[:, 1] + pull[:, 1] * own[:, 0]
        variance = station.sigma_m**2 * np.sum(pull**2, axis=1) + station.sigma_rad**2 * turned**2
        sigma: Array = np.sqrt(OUTLINE_SIGMA**2 + variance)
        return sigma

    def _grow(self, low: NDArray[np.int64], count: int) -> None:
        """Make the grid hold a square of cells."""
        size = np.array(self._odds.shape[::-1])
        if not size.any():
            self._corner = low.copy()
        before = np.maximum(self._corner - low, 0)
        after = np.maximum(low + count - (self._corner + size), 0)
        if before.any() or after.any():
            before, after = (-(-one // BLOCK) * BLOCK for one in (before, after))
            self._odds = np.pad(self._odds, ((before[1], after[1]), (before[0], after[0])))
            self._corner = self._corner - before

    def levels(self) -> NDArray[np.uint8]:
        """The image of map.pgm: the row of greatest y first; 254 free, 0 occupied, 128 unknown."""
        chance = self.probability[::-1]
        made = np.where(chance > OCCUPIED, OCCUPIED_LEVEL, np.where(chance < FREE, FREE_LEVEL, UNKNOWN_LEVEL))
        return made.astype(np.uint8)

    def skeleton(self, footprint: float = 0.0) -> Skeleton:
        """The ways over free cells as a graph.

        Parameters
        ----------
        footprint : float
            Radius of the robot, metres: only what it can drive is left.
        """
        chance = self.probability
        unknown = (chance >= FREE) & (chance <= OCCUPIED)
        return skeleton_of(chance < FREE, unknown, self.cell, self.origin, footprint)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``map.pgm`` and ``map.yaml`` (ROS's map_server), ``map.png`` to look at, and ``trajectory.csv``.

        Raises
        ------
        OutputError
            When the folder cannot be written.
        """
        make_folder(folder)
        write_all_atomic([(os.path.join(folder, name), data) for name, data in self.files().items()])

    def files(self, ways: Skeleton | None = None) -> dict[str, bytes]:
        """The files that `save` writes, by name; the ways are drawn into the picture."""
        levels = self.levels()
        x, y = self.origin
        head = f"P5\n# {self.cell} m a cell\n{levels.shape[1]} {levels.shape[0]}\n255\n".encode("ascii")
        text = (
            f"image: map.pgm\nmode: trinary\nresolution: {self.cell!r}\norigin: [{x!r}, {y!r}, 0.0]\nnegate: 0\n"
            f"occupied_thresh: {OCCUPIED}\nfree_thresh: {FREE}\n"
        )
        return {
            "map.pgm": head + levels.tobytes(),
            "map.yaml": text.encode("ascii"),
            "map.png": self.picture(ways),
            "trajectory.csv": csv_table(
                ["frame", "x", "y", "theta", "sigma_m", "sigma_rad", "origin"],
                [[name, *_cells(one)] for name, one in self._stations.items()],
            ),
        }

    def picture(self, ways: Skeleton | None = None) -> bytes:
        """PNG file: bright where it is free, dark where occupied; the camera's way magenta, other ways blue."""
        low, high = self._bounds()
        grey = np.rint(255.0 * (1.0 - self.probability[low[1] : high[1], low[0] : high[0]][::-1])).astype(np.uint8)
        zoom = max(1, min(ZOOM, WIDEST // max(grey.shape)))
        large = grey.repeat(zoom, axis=0).repeat(zoom, axis=1)
        way = np.array([[one.x, self._flip * one.y] for one in self.stations if one is not None]).reshape(-1, 2)
        drawn: list[tuple[Array, Kind]] = [(edge.points, "false") for edge in (ways.edges if ways else ())]
        drawn += [(way, "differs")] if len(way) else []
        lines = []
        for points, kind in drawn:
            column, row = ((points / self.cell - self._corner - low) * zoom).T
            line = np.stack([column - 0.5, len(large) - row - 0.5], axis=1)
            lines.append(Polyline(np.concatenate([line, line[::-1]]), kind))
        return encode_overlay(large, lines)

    def _bounds(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """First column and row that the picture shows, and those after the last: what is known, and some round it."""
        row, column = np.nonzero(self._odds)
        size = np.array(self._odds.shape[::-1])
        if not len(row):
            return np.zeros(2, np.intp), size
        low, high = (np.array([edge(column), edge(row)]) for edge in (np.min, np.max))
        return np.maximum(low - MARGIN, 0), np.minimum(high + 1 + MARGIN, size)


def _moved(before: Station, planar: tuple[float, float, float], sigmas: tuple[float, float]) -> Station:
    """The station after a motion; its errors add up, and an error of the turn shifts what lies ahead."""
    x, y, turn = planar
    c, s, length = np.cos(before.theta), np.sin(before.theta), float(np.hypot(x, y))
    step, bend = sigmas if sigmas[0] > 0 else (ODOMETRY[0] * length, ODOMETRY[1])
    return Station(
        float(before.x + c * x - s * y), float(before.y + s * x + c * y), before.theta + turn,
        float(np.sqrt(before.sigma_m**2 + step**2 + (before.sigma_rad * length) ** 2)),
        float(np.hypot(before.sigma_rad, bend)), estimated=True,
    )  # fmt: skip


def _cells(one: Station | None) -> Sequence[str | float]:
    """Cells of a row of the trajectory."""
    if one is None:
        return ["", "", "", "", "", "lost"]
    numbers = [round(one.x, 4), round(one.y, 4), round(one.theta, 5), round(one.sigma_m, 4), round(one.sigma_rad, 5)]
    return [*numbers, "ground" if one.estimated else "pose"]


def _pixels(camera: Camera, own: Array) -> Array:
    """Pixels that show ground of the levelled camera frame, shape (n, 2)."""
    down = np.full((len(own), 1), camera.mounting())
    pixels: Array = camera.project(np.hstack([own, down]) @ camera.level())
    return pixels


def _shown(camera: Camera, pixels: Array) -> NDArray[np.bool_]:
    """Whether pixels lie in the scene."""
    column, row = np.rint(np.nan_to_num(pixels, nan=-1.0)).astype(np.intp).T
    inside = (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
    shown: NDArray[np.bool_] = inside & camera.domain()[np.where(inside, row, 0), np.where(inside, column, 0)]
    return shown


def _sampled(plane: NDArray[np.float32], pixels: Array) -> Array:
    """Values of a plane at pixels, bilinear; NaN outside."""
    height, width = plane.shape
    x, y = pixels.T
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    x, y = np.where(inside, x, 0.0), np.where(inside, y, 0.0)
    column, row = np.minimum(x.astype(np.intp), width - 2), np.minimum(y.astype(np.intp), height - 2)
    u, v = x - column, y - row
    top = plane[row, column] * (1 - u) + plane[row, column + 1] * u
    bottom = plane[row + 1, column] * (1 - u) + plane[row + 1, column + 1] * u
    return np.where(inside, top * (1 - v) + bottom * v, np.nan)


def _erf(values: Array) -> Array:
    """The error function, from a table of steps of 1/500 to what float32 can tell."""
    found: Array = np.interp(values, _ERF_AT, _ERF)
    return found


_ERF_AT = np.linspace(-4.0, 4.0, 4001)
_ERF = np.array([erf(one) for one in _ERF_AT.tolist()])
