"""An occupancy grid of a drive: free space of its frames, fused in log-odds over poses, as ROS's map_server reads it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Array
from ffseg.camera.model import Camera
from ffseg.camera.motion import Pose, planar_place, require_pose
from ffseg.errors import CalibrationError, OutputError
from ffseg.freespace.leans import Leans
from ffseg.freespace.sequence import Frame
from ffseg.freespace.sightings import Sighting, Station, Window, read_cells, sighting_of
from ffseg.freespace.skeleton import Skeleton, skeleton_of
from ffseg.freespace.window import WINDOW
from ffseg.io.files import make_folder, write_all_atomic
from ffseg.io.overlays import Kind, Polyline, encode_overlay
from ffseg.io.tables import csv_table

OCCUPIED, FREE = 0.65, 0.25
"""Probabilities above which a cell is occupied and below which it is free; the defaults of map_server."""
UNKNOWN_LEVEL, FREE_LEVEL, OCCUPIED_LEVEL = 128, 254, 0
"""Grey levels of map.pgm. map_saver's own 205 for unknown stands for 0.196 and would be read as free below 0.25."""
BLOCK = 64
"""Cells by which the grid grows, so that it is not copied at every frame."""
MAX_CELLS = 2**25
"""Cells of a map: 290 x 290 m at 5 cm. Map and graph take at most 118 bytes per cell (measured on maps of 5 and 18
million), 4 GB."""
FRAME_CORRELATION = 0.3
"""Correlation between the errors of two frames' readings of a cell, which share the bias of the outline and much of the
pose. n of them have the weight of n / (1 + (n - 1) FRAME_CORRELATION) independent ones (Clemen and Winkler 1985,
Limits for the precision and value of information from dependent sources). Measured on 20 rendered drives, by the
likelihood of the cells of 1, 2, 4 and 20 frames."""
MEMORY_FRAMES = 30.0
"""Largest number of frames that count in a cell: beyond it older ones fade, and what has moved away is forgotten."""
ODOMETRY = 0.02, float(np.deg2rad(0.5))
"""Standard deviations of a step that states none: relative to its length, and radians."""
MAX_LEAN_SHIFT = 0.25
"""Fraction of a cell by which one standard deviation of the camera's lean may shift the ground for a frame to be used.
On 12 rendered drives with nods, at least .85 of the cells called .9 free are free; with a third, .5 to .7."""
MIN_UPRIGHT_COSINE = float(np.cos(np.deg2rad(15.0)))
"""Least cosine between the z axis of the poses' world and the camera's vertical: ramps rise by up to 9 degrees, and nods
of 4.5 are accepted."""
ZOOM, MAX_PICTURE_SIDE, MARGIN = 4, 2400, 8
"""Pixels per cell in the picture (fewer where a side would exceed the second number), and cells shown round what is known."""


class OccupancyMap:
    """A grid on the ground, fed with the frames of a `Sequence`.

    The map's frame is that of the poses; without poses the first frame's. Its x axis is theirs, and its y axis lies to
    the left of it as seen from above. That is theirs under a mirror, as in a poses file, and without one where their
    world's z axis points up; else it is theirs turned over.

    Parameters
    ----------
    cell : float
        Side of a cell, metres.
    reach : float
        Metres from the camera up to which a frame is believed.

    Raises
    ------
    CalibrationError
        When one of them is not above 0, or a frame alone would hold more than 2**25 cells.

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
        if (2.0 * reach / cell) ** 2 > MAX_CELLS:
            raise CalibrationError(f"a frame would hold more than {MAX_CELLS} cells; make them larger")
        self.cell, self.reach = cell, reach
        self._told = np.zeros((2, 0, 0), np.float32)  # sums of log odds, and of the readings they are of
        self._corner = np.zeros(2, np.int64)  # cell number of the first column and row
        self._stations: dict[str, Station | None] = {}  # as the poses have it, y not turned over yet
        self._last: Station | None = None
        self._lens: Camera | None = None
        self._errors = np.zeros(3)  # squared differences between poses and ground, metres and radians, and their number
        self._flip = 1.0
        self._down = 0.0  # 1 where the z axis of the poses' world points down, -1 where up
        self._leans = Leans()
        self._begun: list[tuple[str, Sighting, Station]] = []  # as long as no nod was seen

    @property
    def probability(self) -> NDArray[np.float64]:
        """Probability of being occupied, shape (rows, columns): rows along y, columns along x, 0.5 where unknown."""
        odds, looks = self._told.astype(np.float64)
        return 1.0 / (1.0 + np.exp(-odds / (1.0 + FRAME_CORRELATION * np.maximum(looks - 1.0, 0.0))))

    @property
    def origin(self) -> tuple[float, float]:
        """(x, y) of the outer corner of the first cell, metres."""
        x, y = (self._corner * self.cell).tolist()
        return x, y

    @property
    def stations(self) -> tuple[Station | None, ...]:
        """One station per frame; None where neither pose nor ground located it, and nothing was added."""
        return tuple(
            one if one is None or self._flip > 0 else replace(one, y=0.0 - one.y, theta=0.0 - one.theta)
            for one in self._stations.values()
        )

    @property
    def drift(self) -> tuple[float, float]:
        """Standard deviations of the last station, metres and radians: how far the map may be bent."""
        return (0.0, 0.0) if self._last is None else (self._last.sigma_m, self._last.sigma_rad)

    def add(self, frame: Frame, pose: Pose | None = None) -> bool:
        """Fuse the next frame of the sequence.

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
            When the frame is none or of no camera, or the pose is none. When the z axis of the pose's world is not vertical,
            or the other way than before, or the map would hold more than 2**25 cells: the frame has no station then.
        """
        return self.fuse(str(len(self._stations)), sighting_of(frame), pose)

    def fuse(self, name: str, seen: Sighting, pose: Pose | None = None) -> bool:
        """Fuse a frame under a name that links of later frames may refer to.

        Parameters
        ----------
        name : str
            Not one that was used before.
        seen : Sighting
        pose : Pose, optional
        """
        if pose is not None:
            require_pose(pose)
        self.miss(name)
        self._flip = 1.0 if seen.camera.mirrored else -1.0
        station = self._placed(seen, pose)
        if station is not None:
            self._check_size(station)
            self._stations[name] = self._last = station
            self._leans.follow(name, seen.links, seen.lean)
            for one in self._due((name, seen, station)):
                self._add(*one)
        return station is not None

    def _due(self, now: tuple[str, Sighting, Station]) -> list[tuple[str, Sighting, Station]]:
        """Frames to add: the drive's whole beginning again once its first nod shows how far the camera may have leaned."""
        begun, self._begun = self._begun, []
        if self._leans.informative:
            if begun:
                self._told[:] = 0.0
            return [*begun, now]
        self._begun = [*begun, now] if len(self._stations) <= WINDOW else []
        return [now]

    def miss(self, name: str) -> None:
        """Record that a frame is missing."""
        self._stations[name] = None

    def _placed(self, seen: Sighting, pose: Pose | None) -> Station | None:
        """Station of a frame: by its pose, by the motion since an earlier frame, or by both."""
        before = next(((one, link) for link in seen.links if (one := self._stations.get(link.name)) is not None), None)
        led = None if before is None else _moved(before[0], before[1].planar, seen.sigmas)
        if pose is None:
            return led if self._last is not None else Station(0.0, 0.0, 0.0, estimated=True)
        self._check_upright(pose.rotation @ seen.camera.up)
        by_pose = Station(*planar_place(seen.camera, pose), *(pose.sigmas or (0.0, 0.0)))
        if led is None or not seen.sigmas[0]:
            return by_pose
        return self._between(by_pose, led, seen.sigmas, stated=pose.sigmas is not None)

    def _check_upright(self, up: Array) -> None:
        down = self._down or (-1.0 if up[2] > 0.0 else 1.0)
        if -down * up[2] < MIN_UPRIGHT_COSINE:
            raise CalibrationError(
                f"the camera's up is ({up[0]:.2f}, {up[1]:.2f}, {up[2]:.2f}) in the world of its pose; a map needs a world "
                "whose z axis is vertical, up or down for all poses: turn the poses into such a one"
            )
        self._down = down

    def _check_size(self, station: Station) -> None:
        last, place = self._last or station, np.array([station.x, self._flip * station.y])
        first, end = self._corner * self.cell, (self._corner + self._told.shape[:0:-1]) * self.cell
        width, height = (np.maximum(end, place + self.reach) - np.minimum(first, place - self.reach)).tolist()
        if self._last is not None and width * height > MAX_CELLS * self.cell**2:
            far = float(np.hypot(station.x - last.x, station.y - last.y))
            raise CalibrationError(
                f"the frame lies {far:.0f} m from the last one in the map, which would be {width:.0f} x {height:.0f} m with it, "
                f"more than {MAX_CELLS} cells of {self.cell:g} m; check its pose and the unit, or map the drive in parts"
            )

    def _between(self, by_pose: Station, led: Station, step: tuple[float, float], *, stated: bool) -> Station:
        """Pose and ground motion, weighted by their variances; poses without stated ones by how much both have differed.

        Of the ground the part counts by which its steps err alone, so many times a step's variance, and all that it has from
        stated poses before.
        """
        x, y, turn = by_pose.x - led.x, by_pose.y - led.y, (by_pose.theta - led.theta + np.pi) % (2 * np.pi) - np.pi
        self._errors += [0.5 * (x * x + y * y), turn * turn, 1.0]
        own = np.square([by_pose.sigma_m, by_pose.sigma_rad]) if stated else self._errors[:2] / self._errors[2]
        walked, posed = np.array(led.walked), _posed(led)
        ground = walked * step + posed
        share = ground / np.maximum(own + ground, 1e-18)
        posed, walked = posed * (1.0 - share) ** 2 + own * share**2 * stated, np.sqrt(1.0 - share) * walked
        a, b = share.tolist()
        return _station((led.x + a * x, led.y + a * y, led.theta + b * turn), walked, posed, estimated=False)

    def _add(self, name: str, seen: Sighting, station: Station) -> None:
        low = np.floor((np.array([station.x, self._flip * station.y]) - self.reach) / self.cell).astype(np.int64)
        count, step = int(np.ceil(2 * self.reach / self.cell)) + 1, self.cell * np.array([1.0, self._flip])
        self._grow(low, count)
        self._lens = self._lens or seen.camera
        lean, sigma = self._leans.of(name)
        height, moves = seen.camera.mounting(), MAX_LEAN_SHIFT * self.cell / max(sigma, 1e-9)
        near = min(self.reach, float(np.sqrt(max(height * (moves - height), 0.0))))
        cells = Window(station, (low + 0.5) * step, step, count, near, _levelled(seen.camera, lean))
        seen_cells, chance = read_cells(seen, self._lens, cells, self.reach)
        column, row = (low - self._corner).tolist()
        window = self._told[:, row : row + count, column : column + count]
        new = seen_cells.astype(np.float32)
        window *= 1.0 - new / np.float32(MEMORY_FRAMES)
        window[0] += np.log(1.0 / chance - 1.0) * new
        window[1] += new

    def _grow(self, low: NDArray[np.int64], count: int) -> None:
        """Enlarge the grid to hold a square of cells."""
        size = np.array(self._told.shape[:0:-1])
        if not size.any():
            self._corner = low.copy()
        before = np.maximum(self._corner - low, 0)
        after = np.maximum(low + count - (self._corner + size), 0)
        if before.any() or after.any():
            before, after = (-(-one // BLOCK) * BLOCK for one in (before, after))
            self._told = np.pad(self._told, ((0, 0), (before[1], after[1]), (before[0], after[0])))
            self._corner = self._corner - before

    def levels(self) -> NDArray[np.uint8]:
        """Grey levels of map.pgm: the row of greatest y first; 254 free, 0 occupied, 128 unknown."""
        chance = self.probability[::-1]
        made = np.where(chance > OCCUPIED, OCCUPIED_LEVEL, np.where(chance < FREE, FREE_LEVEL, UNKNOWN_LEVEL))
        return made.astype(np.uint8)

    def skeleton(self, footprint: float = 0.0) -> Skeleton:
        """Graph of the passages over free cells.

        Parameters
        ----------
        footprint : float
            Radius of the robot, metres: only what it can drive is left.

        Raises
        ------
        CalibrationError
            If the footprint is below 0 or not a number.
        """
        if not footprint >= 0:
            raise CalibrationError(f"footprint is {footprint!r}; give metres from 0 on")
        chance = self.probability
        unknown = (chance >= FREE) & (chance <= OCCUPIED)
        return skeleton_of(chance < FREE, unknown, self.cell, self.origin, footprint)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``map.pgm`` and ``map.yaml`` (ROS's map_server), ``map.png``, and ``trajectory.csv``.

        Raises
        ------
        OutputError
            When the folder cannot be written, or no frame has a place on the map.
        """
        files = self.files()
        make_folder(folder)
        write_all_atomic([(os.path.join(folder, name), data) for name, data in files.items()])

    def files(self, ways: Skeleton | None = None) -> dict[str, bytes]:
        """Contents of the files that `save` writes, by name; the graph is drawn into the picture."""
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
                [[name, *_cells(one)] for name, one in zip(self._stations, self.stations, strict=True)],
            ),
        }

    def picture(self, ways: Skeleton | None = None) -> bytes:
        """PNG file: free cells bright, occupied ones dark, the camera's path magenta, the graph blue."""
        if not self._told.size:
            raise OutputError("the map is empty: no frame has a place on it")
        low, high = self._bounds()
        grey = np.rint(255.0 * (1.0 - self.probability[low[1] : high[1], low[0] : high[0]][::-1])).astype(np.uint8)
        zoom = max(1, min(ZOOM, MAX_PICTURE_SIDE // max(grey.shape)))
        large = grey.repeat(zoom, axis=0).repeat(zoom, axis=1)
        way = np.array([[one.x, one.y] for one in self.stations if one is not None]).reshape(-1, 2)
        drawn: list[tuple[Array, Kind]] = [(edge.points, "false") for edge in (ways.edges if ways else ())]
        drawn += [(way, "differs")] if len(way) else []
        lines = []
        for points, kind in drawn:
            column, row = ((points / self.cell - self._corner - low) * zoom).T
            line = np.stack([column - 0.5, len(large) - row - 0.5], axis=1)
            lines.append(Polyline(np.concatenate([line, line[::-1]]), kind))
        return encode_overlay(large, lines)

    def _bounds(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Ranges of columns and rows shown in the picture: all known cells, with a margin."""
        row, column = np.nonzero(self._told[1])
        size = np.array(self._told.shape[:0:-1])
        if not len(row):
            return np.zeros(2, np.intp), size
        low, high = (np.array([edge(column), edge(row)]) for edge in (np.min, np.max))
        return np.maximum(low - MARGIN, 0), np.minimum(high + 1 + MARGIN, size)


def _moved(before: Station, planar: tuple[float, float, float], sigmas: tuple[float, float]) -> Station:
    """The station after a motion; errors add up, and an error of yaw shifts what lies ahead."""
    x, y, turn = planar
    c, s, length = np.cos(before.theta), np.sin(before.theta), float(np.hypot(x, y))
    step, bend = sigmas if sigmas[0] > 0 else (ODOMETRY[0] * length, ODOMETRY[1])
    (far, turned), posed = before.walked, _posed(before)
    place = float(before.x + c * x - s * y), float(before.y + s * x + c * y), before.theta + turn
    walked = np.array([far + np.hypot(step, turned * length), turned + bend])
    return _station(place, walked, posed + [posed[1] * length**2, 0.0], estimated=True)


def _posed(station: Station) -> Array:
    """The part of a station's variances, m2 and rad2, that comes from stated poses."""
    return np.square([station.sigma_m, station.sigma_rad]) - np.square(station.walked)


def _station(place: tuple[float, float, float], walked: Array, posed: Array, *, estimated: bool) -> Station:
    sigma_m, sigma_rad = np.hypot(walked, np.sqrt(np.maximum(posed, 0.0))).tolist()
    return Station(*place, sigma_m, sigma_rad, estimated, tuple(walked.tolist()))


def _cells(one: Station | None) -> Sequence[str | float]:
    if one is None:
        return ["", "", "", "", "", "lost"]
    numbers = [round(one.x, 4), round(one.y, 4), round(one.theta, 5), round(one.sigma_m, 4), round(one.sigma_rad, 5)]
    return [*(one + 0.0 for one in numbers), "ground" if one.estimated else "pose"]


def _levelled(camera: Camera, lean: Array) -> Array:
    """Rotation that levels a camera with this lean, from the frame that is level as mounted."""
    x, y = lean.tolist()
    return replace(camera, up=np.array([x, y, -np.sqrt(1.0 - x * x - y * y)]) @ camera.level()).level()
