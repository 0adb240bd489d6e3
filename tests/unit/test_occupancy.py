"""The occupancy grid of a drive: against the rendered world, and its files by a reader of map_server's format."""

import re
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
import pytest
import rendered
import shapely
import yaml
from worlds import footprint, free_ground

import ffseg
from ffseg.camera.motion import planar_pose, rotation_matrices
from ffseg.errors import CalibrationError, OutputError
from ffseg.freespace.leans import Lean
from ffseg.freespace.occupancy import FRAME_CORRELATION, OccupancyMap
from ffseg.freespace.sequence import Frame
from ffseg.freespace.sightings import SHARPNESS, Sighting
from ffseg.freespace.window import Link
from ffseg.rendering.pairs import RenderedSequence, sample_camera

CAMERA = replace(sample_camera(), footprint=0.1)


@lru_cache(maxsize=1)
def driven() -> tuple[RenderedSequence, list[Frame]]:
    drive = replace(rendered.drive(), views=rendered.drive().views[:3], poses=rendered.drive().poses[:3])
    sequence = ffseg.Sequence(CAMERA)
    poses = [planar_pose(CAMERA, *pose) for pose in drive.poses]
    return drive, [sequence.feed(view.image, pose) for view, pose in zip(drive.views, poses, strict=True)]


def mapped(frames: list[Frame], poses: list[ffseg.Pose | None]) -> OccupancyMap:
    grid = OccupancyMap()
    assert all(grid.add(frame, pose) for frame, pose in zip(frames, poses, strict=True))
    return grid


def centres(grid: OccupancyMap) -> np.ndarray:
    rows, columns = grid.probability.shape
    x, y = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
    return np.stack([x, y], axis=-1) * grid.cell + np.array(grid.origin)


def contains(ground: shapely.Geometry, places: np.ndarray) -> np.ndarray:
    return shapely.contains_xy(ground, places[..., 0], places[..., 1])


def check(grid: OccupancyMap, drive: RenderedSequence, places: np.ndarray, least: float) -> None:
    """Free cells are those of the world; none of a box; beyond the walls nothing is known but a band."""
    chance = grid.probability
    world = free_ground(drive.scene)
    true, known = contains(world, places), chance != 0.5
    free, occupied = chance < 0.25, chance > 0.65
    assert (free & true).sum() / ((free | true) & known).sum() >= least
    deep = [footprint(box).buffer(-0.03) for box in drive.scene.boxes]
    assert not (contains(shapely.union_all(deep), places) & free).any()
    assert not (known & ~contains(world.convex_hull.buffer(0.25), places)).any()
    assert (occupied & ~true).sum() > 0.9 * occupied.sum() > 100


def test_free_cells_are_those_of_the_world() -> None:
    drive, frames = driven()
    grid = mapped(frames, [planar_pose(CAMERA, *pose) for pose in drive.poses])
    check(grid, drive, centres(grid), 0.985)
    assert 0.0 < grid.drift[0] < 0.001, "the poses are exact, and the ground says so"


def test_poses_are_believed_as_far_as_the_ground_confirms_them() -> None:
    """Odometry whose steps are off by 2 % and half a degree: the map is as sharp as with exact poses; a deviation that is
    stated counts as it is."""
    drive, frames = driven()
    random, exact = np.random.default_rng(4), np.array(drive.poses)
    steps = np.diff(exact, axis=0, prepend=exact[:1])
    off = exact + np.cumsum(random.normal(size=steps.shape) * [0.0024, 0.0024, np.deg2rad(0.5)], axis=0)
    off -= off[0] - exact[0]
    grid = mapped(frames, [planar_pose(CAMERA, *pose) for pose in off.tolist()])
    check(grid, drive, centres(grid), 0.98)
    ends = [abs(np.sin(theta - exact[-1][2])) for theta in (grid.stations[-1].theta, off[-1][2])]
    assert ends[0] < 0.3 * ends[1]
    stated = mapped(frames, [planar_pose(CAMERA, *pose, sigmas=(1e-6, 1e-6)) for pose in off.tolist()])
    assert np.hypot(stated.stations[-1].x - off[-1][0], stated.stations[-1].y - off[-1][1]) < 1e-4


def test_without_poses_the_map_stands_in_the_first_frame_and_says_its_drift() -> None:
    drive, frames = driven()
    grid = mapped(frames, [None] * len(frames))
    x, y, theta = drive.poses[0]
    c, s = np.cos(theta), np.sin(theta)
    check(grid, drive, centres(grid) @ np.array([[c, s], [-s, c]]) + [x, y], 0.98)
    assert 0.0 < grid.drift[0] < 0.02
    assert grid.drift[1] > 0.0
    true = np.array([[c, s], [-s, c]]) @ (np.array(drive.poses[-1][:2]) - [x, y])
    assert np.hypot(*(np.array([grid.stations[-1].x, grid.stations[-1].y]) - true)) < 0.01


def test_an_uncertain_pose_makes_outlines_uncertain() -> None:
    drive, frames = driven()
    poses = (planar_pose(CAMERA, *drive.poses[1], sigmas=one) for one in (None, (0.2, 0.1)))
    sure, unsure = (mapped(frames[1:2], [pose]) for pose in poses)
    near = (sure.probability > 0.6) & (unsure.probability != 0.5)
    told = [np.abs(grid.probability - 0.5)[near].mean() for grid in (sure, unsure)]
    assert told[1] < 0.6 * told[0]


def test_what_stands_before_the_ground_says_nothing_of_it() -> None:
    """A wall all round, seen whole, with ground behind it: at its near side cells are doubtful, at the far one none is."""
    reach = np.hypot(*np.moveaxis(CAMERA.ground(), -1, 0))
    grid = OccupancyMap(cell=0.02)
    assert grid.fuse("0", Sighting((reach < 1.2) | (reach > 1.5), CAMERA), planar_pose(CAMERA, 0.0, 0.0, 0.0))
    away, chance = np.hypot(*np.moveaxis(centres(grid), -1, 0)), grid.probability
    assert ((chance > 0.1) & (chance < 0.9) & (chance != 0.5) & (away < 1.3)).sum() > 100
    beyond = chance[(away > 1.4) & (away < 2.5)]
    assert beyond[beyond != 0.5].max() < 0.05


def test_what_a_domain_leaves_out_is_unknown() -> None:
    """Free ground all round but in a sector: the band before its border is a wall, or nothing where the domain ends there."""
    x, y = np.moveaxis(CAMERA.ground(), -1, 0)
    mask, walls = (np.hypot(x, y) < 1.5) & (np.abs(np.arctan2(y, x)) > 0.2), []
    domain = CAMERA.domain() & ((np.abs(np.arctan2(y, x)) > 0.2) | (np.hypot(x, y) > 1.5))
    for one in (None, domain):
        grid = OccupancyMap(cell=0.02)
        assert grid.fuse("0", Sighting(mask, CAMERA, domain=one), planar_pose(CAMERA, 0.0, 0.0, 0.0))
        walls.append(int(((grid.probability > 0.65) & (np.hypot(*np.moveaxis(centres(grid), -1, 0)) < 1.3)).sum()))
    assert walls[0] >= 8  # with OpenCV 4.11; with 5 it is 10 or more
    assert walls[1] == 0


def test_a_mask_read_between_its_pixels_is_as_sharp_as_its_edges() -> None:
    """Straight edges at any angle and place, drawn by the rule of pixel centres and read linearly between four of them."""
    random = np.random.default_rng(5)
    x, y, turn, off = random.uniform([0, 0, 0, -1.2], [1, 1, 2 * np.pi, 1.2], (400_000, 4)).T

    def inside(column: np.ndarray | int, row: np.ndarray | int) -> np.ndarray:
        return (column - 0.5) * np.cos(turn) + (row - 0.5) * np.sin(turn) < off

    upper, lower = ((1 - x) * inside(0, row) + x * inside(1, row) for row in (0, 1))
    read, free = (1 - y) * upper + y * lower, inside(x, y)
    for low in (0.1, 0.2, 0.3, 0.6, 0.7, 0.8):
        some = (read >= low) & (read < low + 0.1)
        odds = [np.log(part / (1.0 - part)) for part in (free[some].mean(), read[some].mean())]
        assert abs(odds[0] / odds[1] - SHARPNESS) < 0.1


def test_frames_that_see_alike_err_alike() -> None:
    """However many show the same, they are worth no more than 1 / FRAME_CORRELATION that err alone."""
    _, frames = driven()
    once, often = mapped(frames[:1], [None]), OccupancyMap()
    pose = planar_pose(CAMERA, 0.0, 0.0, 0.0)
    for _ in range(8):
        often.add(frames[0], pose)
    single, eight = (np.log(1.0 / grid.probability - 1.0) for grid in (once, often))
    told = np.abs(single) > 0.1
    ratio = eight[told] / single[told]
    assert 1.5 < ratio.min() < ratio.max() < 1.0 / FRAME_CORRELATION


def test_errors_of_steps_add_up_as_they_are() -> None:
    """Successive pairs show the same ground and err alike: so many steps are off by so many times one."""
    grid, step = OccupancyMap(), (0.001, 0.0002)
    for number in range(6):
        links = (Link(str(number - 1), (0.0, 0.0, 0.0)),) if number else ()
        assert grid.fuse(str(number), Sighting(driven()[1][0].mask, CAMERA, links, step))
    assert grid.drift == pytest.approx((0.005, 0.001))


def test_a_robot_that_stands_stays_on_the_map() -> None:
    """The motion was lost with the parallax that obstacles are judged by, and with it every frame after."""
    grid, sequence, image = OccupancyMap(), ffseg.Sequence(CAMERA), driven()[0].views[0].image
    frames = [sequence.feed(image) for _ in range(3)]
    assert [grid.add(frame) for frame in frames] == [True] * 3
    assert ([frame.tested for frame in frames], frames[-1].motion) == ([False] * 3, None)
    assert grid.drift[0] < 0.005
    assert grid.stations[-1] is not None
    assert abs(grid.stations[-1].x) < 3 * grid.drift[0]


def test_stated_poses_are_weighed_by_their_variances() -> None:
    """A coarse pose was believed as if the ground had told it: an exact one after it was missed by 21 of its deviations."""
    grid, mask = OccupancyMap(), driven()[1][0].mask
    off = [*np.random.default_rng(1).normal(0.0, 0.3, 9).tolist(), 0.0]
    for number, x in enumerate(off):
        links = (Link(str(number - 1), (0.0, 0.0, 0.0)),) if number else ()
        pose = planar_pose(CAMERA, x, 0.0, 0.0, sigmas=(0.3 if number < 9 else 0.01, 0.1))
        assert grid.fuse(str(number), Sighting(mask, CAMERA, links, (0.0003, 0.0001)), pose)
    *_, mean, last = (one for one in grid.stations if one is not None)
    assert (mean.x, mean.sigma_m) == (pytest.approx(np.mean(off[:9]), abs=0.01), pytest.approx(0.1, rel=0.02))
    assert abs(last.x) < 3 * last.sigma_m < 0.031


def nodding() -> OccupancyMap:
    """The map of a robot that stands in a square room and nods."""
    random, grid = np.random.default_rng(6), OccupancyMap()
    leans = random.normal(0.0, np.deg2rad(1.5), (12, 2))
    for number, (x, y) in enumerate(leans.tolist()):
        stood = replace(CAMERA, up=np.array([x, y, -np.sqrt(1.0 - x * x - y * y)]) @ CAMERA.level())
        nod_x, nod_y = (leans[number - 1] - leans[number]).tolist()
        noise = random.normal(0.0, np.deg2rad(0.3), 2).tolist()
        links = (Link(str(number - 1), (0.0, 0.0, 0.0), (nod_x, nod_y)),) if number else ()
        lean = Lean(x + noise[0], y + noise[1], np.deg2rad(0.1), np.deg2rad(0.007)) if number else None
        mask = np.abs(stood.ground()).max(axis=-1) < 1.5
        assert grid.fuse(str(number), Sighting(mask, CAMERA, links, (1e-4, 1e-5), lean))
    return grid


def test_a_camera_that_nods_is_followed() -> None:
    """Walls stay where they are: as if it were level they lay up to a decimetre off."""
    grid = nodding()
    away, chance = np.abs(centres(grid)).max(axis=-1), grid.probability
    assert not (chance[away > 1.55] < 0.25).any()
    inside = (away < 1.45) & (np.hypot(*np.moveaxis(centres(grid), -1, 0)) < 1.5)
    assert (chance[inside] < 0.25).mean() > 0.99


def test_a_frame_whose_lean_nobody_knows_tells_nothing_when_the_others_nod() -> None:
    grid = nodding()
    before = (grid.probability != 0.5).sum()
    assert grid.fuse("elsewhere", Sighting(driven()[1][0].mask, CAMERA), planar_pose(CAMERA, 8.0, 0.0, 0.0))
    assert (grid.probability != 0.5).sum() == before
    level = OccupancyMap()
    assert level.fuse("elsewhere", Sighting(driven()[1][0].mask, CAMERA), planar_pose(CAMERA, 8.0, 0.0, 0.0))
    assert (level.probability != 0.5).sum() > 1000


def read_map(folder: Path) -> tuple[dict[str, object], np.ndarray]:
    """As ROS documents it: pixel (row 0, column 0) is the upper left; the origin is the lower left pixel's corner; a
    pixel's occupancy is (255 - level) / 255 with negate 0; above occupied_thresh occupied, below free_thresh free."""
    document = yaml.safe_load((folder / "map.yaml").read_text())
    data = (folder / str(document["image"])).read_bytes()
    match = re.match(rb"P5\s(?:#[^\n]*\n)*(\d+)\s(\d+)\s(\d+)\s", data)
    assert match
    width, height, most = map(int, match.groups())
    assert most == 255
    return document, np.frombuffer(data[match.end() :], np.uint8).reshape(height, width)


def test_a_reader_of_the_format_puts_points_where_they_are(tmp_path: Path) -> None:
    drive, frames = driven()
    grid = mapped(frames, [planar_pose(CAMERA, *pose) for pose in drive.poses])
    grid.save(tmp_path)
    document, levels = read_map(tmp_path)
    assert document["negate"] == 0
    assert (document["occupied_thresh"], document["free_thresh"]) == (0.65, 0.25)
    origin_x, origin_y, yaw = document["origin"]
    assert yaw == 0.0

    def state(x: float, y: float) -> str:
        up, column = int((y - origin_y) // document["resolution"]), int((x - origin_x) // document["resolution"])
        if not (0 <= up < levels.shape[0] and 0 <= column < levels.shape[1]):
            return "unknown"
        chance = (255 - levels[levels.shape[0] - 1 - up, column]) / 255
        return "occupied" if chance > 0.65 else "free" if chance < 0.25 else "unknown"

    for x, y, _ in drive.poses:
        assert state(x, y) == "free"
    eye = np.array(drive.poses[1][:2])
    for box in drive.scene.boxes:  # the nearest point of a box, a cell to either side of its front
        front = shapely.LineString([eye, box.center]).intersection(footprint(box).exterior)
        near = np.array(min(shapely.get_parts(front), key=shapely.Point(eye).distance).coords[0])
        way = (near - eye) / np.hypot(*(near - eye))
        assert state(*(near - 0.1 * way)) == "free"
        assert "occupied" in {state(*(near + step * way)) for step in (0.0, 0.025, 0.05)}
        assert state(*(near + 0.25 * way)) == "unknown"
    lines = (tmp_path / "trajectory.csv").read_text().splitlines()
    assert (lines[0], len(lines)) == ("frame,x,y,theta,sigma_m,sigma_rad,origin", 1 + len(frames))


@pytest.mark.parametrize("mirrored", [True, False])
def test_a_station_is_where_the_map_has_its_frame(tmp_path: Path, mirrored: bool) -> None:
    """Free ground only along the image's x axis: its cells lie round the way from the station in the direction theta."""
    camera, grid = replace(CAMERA, mirrored=mirrored), OccupancyMap(cell=0.02)
    x, y = np.moveaxis(CAMERA.ground(), -1, 0)
    mask = (x > 0.5) & (x < 1.5) & (np.abs(y) < 0.3)
    assert grid.fuse("0", Sighting(mask, camera), planar_pose(camera, 2.0, 1.0, 0.7))
    station, side = grid.stations[0], 1.0 if mirrored else -1.0
    assert (station.x, station.y, station.theta) == pytest.approx((2.0, side, 0.7 * side))
    middle = centres(grid)[grid.probability < 0.25].mean(axis=0)
    ahead = [station.x + np.cos(station.theta), station.y + np.sin(station.theta)]
    np.testing.assert_allclose(middle, ahead, atol=0.01)
    grid.save(tmp_path)
    row = (tmp_path / "trajectory.csv").read_text().splitlines()[1]
    assert row.startswith(f"0,2.0,{side},{0.7 * side},")


@pytest.mark.parametrize("mirrored", [True, False])
def test_a_world_whose_z_points_up_makes_the_same_map(mirrored: bool) -> None:
    """The same places told in a world that is turned about its x axis, with a camera that is mounted askew and nods: y of the map
    is that of the poses without a mirror, and theirs turned over under one."""
    leaning = np.array([0.1, -0.2, -np.sqrt(0.95)])
    camera = replace(CAMERA, mirrored=mirrored, up=leaning)
    mask = (np.hypot(*np.moveaxis(camera.ground() - [0.4, 0.2], -1, 0)) < 1.2) & camera.domain()
    maps = []
    for world in (np.eye(3), np.diag([1.0, -1.0, -1.0])):
        grid = OccupancyMap()
        for number, theta in enumerate((0.0, 0.4, 2.9, -2.0)):
            pose = planar_pose(camera, 0.3 * number, 0.2 * number, theta)
            nod = rotation_matrices(np.array([[0.02 * number, -0.01, 0.0]]))[0]
            told = ffseg.Pose(world @ nod @ pose.rotation, world @ pose.position)
            assert grid.fuse(str(number), Sighting(mask, camera), told)
            side = 1.0 if mirrored == (world[2, 2] > 0) else -1.0
            station = (told.position[0], told.position[1] * side)
            assert (grid.stations[-1].x, grid.stations[-1].y) == pytest.approx(station)
        maps.append(grid)
    np.testing.assert_allclose(*([one.theta for one in grid.stations] for grid in maps), atol=1e-12)
    assert np.array_equal(maps[0].levels(), maps[1].levels())
    assert maps[0].origin == maps[1].origin


def test_poses_of_a_world_that_does_not_stand_upright_are_refused() -> None:
    """Such as that of a camera that looked ahead, whose y axis points down; or one that turns over on the way."""
    sight, pose = Sighting(CAMERA.domain(), CAMERA), planar_pose(CAMERA, 0.0, 0.0, 0.0)
    grid = OccupancyMap()
    assert grid.fuse("0", sight, pose)
    for turn in ([0.5 * np.pi, 0.0, 0.0], [0.0, 0.3, 0.0], [np.pi, 0.0, 0.0]):
        other = rotation_matrices(np.array([turn]))[0]
        with pytest.raises(CalibrationError, match="z axis is vertical"):
            grid.fuse(f"{turn}", sight, ffseg.Pose(other @ pose.rotation, other @ pose.position))
    assert grid.stations[1:] == (None, None, None)
    nod = rotation_matrices(np.array([[0.2, 0.0, 0.0]]))[0]
    assert grid.fuse("4", sight, ffseg.Pose(nod @ pose.rotation, pose.position))


def test_a_map_ends_where_no_memory_would_hold_it() -> None:
    """Of cells of 1 m it is 5792 x 5792 of them; what is refused leaves it as it was, and the drive goes on."""
    sight, grid = Sighting(CAMERA.domain(), CAMERA), OccupancyMap(cell=1.0)
    assert grid.fuse("0", sight, planar_pose(CAMERA, 0.0, 0.0, 0.0))
    assert grid.fuse("1", sight, planar_pose(CAMERA, 5700.0, 5700.0, 0.0))
    size = grid.probability.shape
    for place in ((0.0, -200.0), (1e300, 1.0)):
        with pytest.raises(CalibrationError, match="more than 33554432 cells of 1 m"):
            grid.fuse(str(place), sight, planar_pose(CAMERA, *place, 0.0))
    assert grid.probability.shape == size
    assert grid.fuse("4", sight, planar_pose(CAMERA, 20.0, 1.0, 0.0))
    assert [one is not None for one in grid.stations] == [True, True, False, False, True]


RIGHT = planar_pose(CAMERA, 0.0, 0.0, 0.3)
PLACES = (np.array([np.nan, 0.0, 0.0]), np.zeros(2), [0.0, 0.0, 0.0])
TURNS = (2.0 * RIGHT.rotation, np.zeros((3, 3)), np.diag([1.0, 1.0, -1.0]))
NO_POSES = (
    ("is of type tuple", (0.0, 0.0, 0.0)),
    *(("position is no array", replace(RIGHT, position=one)) for one in PLACES),
    ("rotation is no array", replace(RIGHT, rotation=np.eye(2))),
    *(("rotation is none; ", replace(RIGHT, rotation=one)) for one in TURNS),
    *(("sigmas are", replace(RIGHT, sigmas=one)) for one in ((-1.0, -1.0), (np.nan, 0.0), (1.0, 1.0, 1.0))),
)


@pytest.mark.parametrize(("said", "pose"), NO_POSES)
def test_what_is_no_pose_is_refused(said: str, pose: ffseg.Pose) -> None:
    grid, sequence = OccupancyMap(), ffseg.Sequence(CAMERA)
    image = np.full((CAMERA.height, CAMERA.width), 128, np.uint8)
    for take in (partial(grid.fuse, "0", Sighting(CAMERA.domain(), CAMERA)), partial(sequence.feed, image)):
        with pytest.raises(CalibrationError, match=said):
            take(pose)
    assert grid.stations == ()
    assert "first image" in sequence.feed(image, RIGHT).note, "the sequence stays as it was"


@pytest.mark.parametrize("sigmas", [(-1.0, 0.1), (np.nan, 0.1), (np.inf, 0.1), (1.0, 1.0, 1.0)])
def test_deviations_that_are_none_make_no_pose(sigmas: tuple[float, ...]) -> None:
    with pytest.raises(CalibrationError, match="sigmas are"):
        planar_pose(CAMERA, 0.0, 0.0, 0.0, sigmas)
    assert planar_pose(CAMERA, 0.0, 0.0, 0.0, (0.0, 0.0)).sigmas == (0.0, 0.0)


def test_an_empty_map_is_not_written(tmp_path: Path) -> None:
    grid = OccupancyMap()
    grid.miss("0")
    with pytest.raises(OutputError, match="the map is empty: no frame has a place on it"):
        grid.save(tmp_path / "map")
    assert not (tmp_path / "map").exists()


def test_the_grid_does_not_grow_on_ground_it_has() -> None:
    drive, frames = driven()
    grid, pose = OccupancyMap(), planar_pose(CAMERA, *drive.poses[0])
    grid.add(frames[0], pose)
    shape = grid.probability.shape
    for _ in range(3):
        grid.add(frames[0], pose)
    assert grid.probability.shape == shape
    assert abs(grid.probability - 0.5).max() < 0.5, "nothing becomes certain for ever"


def test_a_frame_that_cannot_be_placed_is_left_out() -> None:
    _, frames = driven()
    grid = OccupancyMap()
    assert grid.add(frames[0])
    before = grid.probability
    assert not grid.add(replace(frames[1], links=()))
    assert np.array_equal(grid.probability, before)
    assert grid.stations[1] is None
    with pytest.raises(CalibrationError, match="metres above 0"):
        OccupancyMap(cell=0.0)
    with pytest.raises(CalibrationError, match="make them larger"):
        OccupancyMap(cell=1e-4)
    for footprint_m in (-0.1, np.nan):
        with pytest.raises(CalibrationError, match="footprint is"):
            grid.skeleton(footprint_m)
    with pytest.raises(CalibrationError, match="of no camera"):
        grid.add(replace(frames[1], lens=None))
    with pytest.raises(CalibrationError, match="of type NoneType"):
        grid.add(None)
