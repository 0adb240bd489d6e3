"""Free space in metres: the robot's frame, polygons, scans and the picture from above, against shapely and the worlds."""

import json
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import pytest
import shapely
from batches import table
from commands import Command
from rendered import floor_pair, render_pair, segment_view
from worlds import free_ground, in_robot_frame, range_along

import ffseg
from ffseg.camera.model import Camera
from ffseg.camera.motion import planar_pose, robot_axes, to_pixels, to_robot
from ffseg.camera.projections import Affine, UnifiedSphere
from ffseg.errors import CalibrationError, ParameterError
from ffseg.freespace.birdseye import HALF_M, SCALE, birds_eye
from ffseg.freespace.outline import MAX_RANGE, Ground, _first_exits, ground_of
from ffseg.freespace.sequence import Frame, free_space, segment_frame
from ffseg.freespace.window import EarlierImage
from ffseg.pipeline import outlines_of
from ffseg.rendering.pairs import CAMERA_YAML, RenderedPair, sample_camera
from ffseg.scene import Scene
from tests.masks import write_image

PARAMS = ffseg.load_params()


def framed(pair: RenderedPair, camera: Camera | None = None) -> Frame:
    camera = camera or pair.camera
    poses = planar_pose(camera, *pair.poses[0]), planar_pose(camera, *pair.poses[1])
    segmentation = segment_view(pair.current.image, camera, PARAMS)
    altitude = PARAMS.obstacles.altitude
    return free_space(pair.current.image, segmentation, [EarlierImage(pair.previous.image, poses)], camera, altitude)


@lru_cache(maxsize=1)
def rendered() -> tuple[RenderedPair, Frame]:
    pair = render_pair(3)
    return pair, framed(pair)


def tilted() -> Camera:
    lens = UnifiedSphere(Affine(300.0, 300.0, 319.5, 239.5), 0.0, (0.0, 0.0, 0.0, 0.0))
    up = np.array([0.0, -np.cos(0.6), -np.sin(0.6)])
    return Camera(lens, 640, 480, (319.5, 239.5), mount_height=1.2, up=up, mirrored=False, forward=-90.0)


@pytest.mark.parametrize("camera", [sample_camera(), replace(sample_camera(), mirrored=False, forward=30.0), tilted()])
def test_the_robots_frame_and_the_image_are_inverses(camera: Camera) -> None:
    points = np.random.default_rng(1).uniform([0.5, -1.0], [3.0, 1.0], (50, 2))
    pixels = to_pixels(camera, points)
    assert np.isfinite(pixels).all()
    np.testing.assert_allclose(to_robot(camera, pixels), points, atol=1e-9)


def test_ahead_is_up_in_a_perspective_image_and_left_is_left() -> None:
    """A camera that looks ahead and down, as a driver does."""
    camera = tilted()
    middle, higher, left = to_robot(camera, np.array([[319.5, 239.5], [319.5, 200.0], [200.0, 239.5]]))
    assert middle == pytest.approx([1.2 / np.tan(0.6), 0.0])  # where its axis meets the ground
    assert higher[0] > middle[0]
    assert higher[1] == pytest.approx(0.0)
    assert left[1] > 0.3


def test_a_mirror_turns_left_and_right_over() -> None:
    """What an image shows below its centre is to the left of its x axis under a mirror, to the right without one."""
    below = np.array([[399.5, 399.5]])
    camera = sample_camera()
    assert to_robot(camera, below)[0, 1] > 0.3
    assert to_robot(replace(camera, mirrored=False), below)[0, 1] < -0.3
    assert np.linalg.det(robot_axes(camera)) == pytest.approx(1.0)
    assert np.linalg.det(robot_axes(replace(camera, mirrored=False, forward=17.0))) == pytest.approx(-1.0)


def test_an_image_turned_over_is_the_same_ground_without_the_mirror() -> None:
    pair, frame = rendered()
    camera = replace(pair.camera, mirrored=False)
    views = [replace(view, image=np.ascontiguousarray(view.image[::-1])) for view in (pair.previous, pair.current)]
    poses = tuple((x, -y, -theta) for x, y, theta in pair.poses)
    turned = framed(replace(pair, previous=views[0], current=views[1], poses=poses), camera)
    ours, theirs = (shapely.union_all(polygons(one.ground())) for one in (frame, turned))
    assert ours.symmetric_difference(theirs).area < 0.01 * ours.area  # a quarter of a pixel along all outlines


def test_where_the_front_is_turns_the_scan() -> None:
    pair, frame = rendered()
    scan = frame.scan()
    turned = framed(pair, replace(pair.camera, forward=90.0)).scan()
    np.testing.assert_allclose(turned.ranges, np.roll(scan.ranges, -90), atol=2e-3)


def polygons(ground: Ground) -> list[shapely.Polygon]:
    return [shapely.Polygon(rings[0], rings[1:]) for rings in ground.polygons]


def test_polygons_below_a_low_camera_are_valid_as_they_are_written() -> None:
    """A pixel is a twentieth of a millimetre there."""
    lens = UnifiedSphere(Affine(960.0, 960.0, 79.5, 59.5), 0.0, (0.0, 0.0, 0.0, 0.0))
    low = Camera(lens, 160, 120, (79.5, 59.5), mount_height=0.05, mirrored=False)
    specks = np.random.default_rng(1).random((120, 160)) < 0.4
    ground = ground_of(specks, outlines_of(specks), low)
    regions = [shapely.geometry.shape(one["geometry"]) for one in ground.document()["features"]]
    assert len(regions) > 100
    assert all(region.is_valid for region in regions)


def test_polygons_are_valid_and_hold_the_masks_pixels() -> None:
    _, frame = rendered()
    ground = frame.ground()
    made = polygons(ground)
    assert all(one.is_valid for one in made)
    assert all(shapely.LinearRing(rings[0]).is_ccw for rings in ground.polygons)
    assert not any(shapely.LinearRing(hole).is_ccw for rings in ground.polygons for hole in rings[1:])
    x, y = np.meshgrid(np.arange(0, 800, 3), np.arange(0, 600, 3))
    places = to_robot(ground.camera, np.stack([x, y], axis=-1))
    near = np.hypot(*np.moveaxis(places, -1, 0)) < 5.0
    inside = shapely.contains_xy(shapely.union_all(made), places[near])
    assert np.array_equal(inside, frame.mask[y, x][near])
    assert len(ground.polygons[0]) == 1 + sum(row.verdict == "obstacle" for row in frame.components)


def test_free_ground_agrees_with_the_world_that_was_rendered() -> None:
    """But for what boxes hide: the shade behind a box is unknown, and no ground that was seen."""
    pair, frame = rendered()
    ours = shapely.union_all(polygons(frame.ground()))
    true = in_robot_frame(free_ground(pair.scene), pair.poses[1]).intersection(shapely.Point(0, 0).buffer(6.0, 256))
    assert ours.difference(true).area < 0.005 * true.area
    assert all(not ours.contains(shapely.Point(*one)) for one in robot_places(pair))


def robot_places(pair: RenderedPair) -> np.ndarray:
    x, y, theta = pair.poses[1]
    c, s = np.cos(theta), np.sin(theta)
    return (np.array([box.center for box in pair.scene.boxes]) - [x, y]) @ np.array([[c, -s], [s, c]])


def test_scan_ranges_are_those_of_the_world() -> None:
    """Two centimetres and a hundredth of the range, for 95 of 100; the stated deviations are of the errors' size."""
    pair, frame = rendered()
    scan = frame.scan()
    world = in_robot_frame(free_ground(pair.scene), pair.poses[1])
    true = np.array([range_along(world, bearing) for bearing in scan.bearings])
    hit = np.array([end == "obstacle" for end in scan.ends])
    error = scan.ranges - true
    assert hit.mean() > 0.95
    assert np.quantile(np.abs(error[hit]) - 0.01 * true[hit], 0.95) <= 0.02
    assert 0.4 < np.quantile(np.abs(error / scan.std)[hit], 0.68) < 1.2


def test_a_camera_that_does_not_nod_stands_as_it_is_mounted() -> None:
    """A pair tells leans to a milliradian or two, and a milliradian moves the ground 3.5 m away by more than a centimetre."""
    _, frame = rendered()
    assert frame.camera is not None
    assert np.hypot(*frame.camera.up[:2]) > 5e-4
    assert frame.standing() is frame.lens


def test_a_camera_that_nods_is_laid_out_as_it_stood() -> None:
    """1.5 degrees are 0.2 m at 3 m; a pair does not know them all, and says so."""
    pair = floor_pair(300_007, "nodding", 3.0, 1.0)
    frame = framed(pair)
    world = in_robot_frame(free_ground(pair.scene), pair.poses[1])
    errors, within = [], []
    for one in (frame, replace(frame, camera=None)):
        scan = one.scan()
        off = np.abs(scan.ranges - [range_along(world, bearing) for bearing in scan.bearings])
        errors.append(np.nanquantile(off, 0.9))
        within.append(np.nanmean(off < 2.0 * scan.std))
    assert errors[0] < 0.5 * errors[1]
    assert within[0] > 0.9 > 0.5 > within[1]


@pytest.mark.parametrize("center", [(0.0, 0.0), (2.6, 0.4), (-3.0, 1.0)])
def test_rays_leave_polygons_where_shapely_says(center: tuple[float, float]) -> None:
    random = np.random.default_rng(7)
    for _ in range(10):
        turns = np.sort(random.uniform(0, 2 * np.pi, 24))
        ring = np.stack([np.cos(turns), np.sin(turns)], axis=1) * random.uniform(0.5, 2.0, (24, 1)) + center
        polygon = shapely.Polygon(ring)
        if not polygon.is_valid or not polygon.exterior.is_ccw:
            continue
        found = _first_exits([ring], 90)
        expected = [range_along(polygon, bearing) for bearing in -np.pi + 2 * np.pi * np.arange(90) / 90]
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_what_a_perspective_camera_does_not_show_is_unknown() -> None:
    camera = tilted()
    image = np.clip(np.random.default_rng(2).normal(110.0, 1.0, (480, 640)), 0, 255).astype(np.uint8)
    scan = free_space(image, segment_view(image, camera, PARAMS), (), camera, 0.05).scan()
    degrees = np.rad2deg(scan.bearings)
    ends = np.array(scan.ends)
    assert set(ends[np.abs(degrees) > 75]) == {"unknown"}
    assert set(ends[np.abs(degrees) < 40]) == {"rim"}, "nothing stands there: the reach is the end, not an obstacle"
    assert scan.ranges[np.argmin(np.abs(degrees))] == pytest.approx(6.0, abs=0.1)
    document = scan.document()
    assert document["ranges"] == [None] * 360
    assert document["free"][180] == pytest.approx(6.0, abs=0.1)


@pytest.mark.parametrize("bearing", [-120.0, 10.0, 55.0])
def test_what_a_domain_leaves_out_is_no_obstacle(bearing: float) -> None:
    """A mast of the robot: its rays end where nothing is known to stand; those beside it end where they do without it."""
    image, camera = rendered()[0].current.image, rendered()[0].camera
    x, y = np.meshgrid(np.arange(camera.width) - camera.center[0], np.arange(camera.height) - camera.center[1])
    beside = np.abs((np.rad2deg(np.arctan2(y, x)) - bearing + 180) % 360 - 180)
    domain = np.where(beside < 6, np.uint8(0), np.uint8(255))
    plain, masked = (segment_frame(Scene(image, PARAMS, domain=one), (), camera).scan() for one in (None, domain))
    degrees = np.abs((np.rad2deg(masked.bearings) - bearing + 180) % 360 - 180)
    assert {masked.ends[at] for at in np.flatnonzero(degrees < 6)} <= {"rim", "unknown"}
    far = np.flatnonzero(degrees > 9)
    assert [masked.ends[at] for at in far] == [plain.ends[at] for at in far]
    assert np.median(np.abs(masked.ranges - plain.ranges)[far]) < 0.01


@pytest.mark.parametrize(("lean", "height", "off"), [(0.0, 0.9, 0.02), (0.07, 0.9, 0.02), (0.07, 0.3, 0.15)])
def test_the_reach_is_a_circle_however_the_camera_leans(lean: float, height: float, off: float) -> None:
    """It was that of the camera as it is mounted: 4 m on one side, 9 on the other. At the end a pixel shows .3 m, or .8."""
    up = np.array([0.0, np.sin(lean), np.copysign(np.cos(lean), sample_camera().up[2])])
    camera = replace(sample_camera(), mount_height=height, up=up)
    mask = camera.domain()
    ((outer, *_),) = ground_of(mask, outlines_of(mask), camera).polygons
    assert np.hypot(*outer.T).max() == pytest.approx(MAX_RANGE)
    assert shapely.Polygon(outer).area == pytest.approx(np.pi * MAX_RANGE**2, rel=off)


def test_a_frame_of_no_camera_says_so() -> None:
    _, frame = rendered()
    with pytest.raises(CalibrationError, match="of no camera"):
        replace(frame, lens=None).ground()
    for reach in (-1.0, 0.0, np.nan, np.inf):
        with pytest.raises(ParameterError, match="reach is .*; give metres above 0"):
            frame.ground(reach)
    assert len(frame.scan(30_000).ranges) == 30_000
    for count in (0, -1, 2.5, True, 40_000):
        with pytest.raises(ParameterError, match="count is .*; give how many bearings"):
            frame.scan(count)


def test_the_picture_from_above_has_the_front_up_and_the_left_left() -> None:
    pair, frame = rendered()
    picture = cv2.imdecode(np.frombuffer(birds_eye(pair.current.image, frame.ground()), np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (640, 640, 3)
    for (forward, left), box in zip(robot_places(pair), pair.scene.boxes, strict=True):
        row, column = (HALF_M - np.array([forward, left])) * SCALE
        grey = picture[round(row), round(column)].mean()
        assert abs(grey - np.mean(box.greys)) < 45
        assert abs(grey - pair.scene.ground_grey) > 20


def test_a_run_writes_the_map_of_every_image(ffseg_command: Command, tmp_path: Path) -> None:
    write_image(tmp_path / "views" / "a.png", rendered()[0].current.image)
    (tmp_path / "camera.yaml").write_text(CAMERA_YAML)
    camera = ("--camera", tmp_path / "camera.yaml")
    ffseg_command("run", tmp_path / "views", "--out", tmp_path / "out", "--map", *camera, code=0)
    document = json.loads((tmp_path / "out" / "ground" / "a.geojson").read_text())
    (region, *_) = (shapely.geometry.shape(feature["geometry"]) for feature in document["features"])
    assert region.is_valid
    assert region.contains(shapely.Point(0, 0))
    rows = table(tmp_path / "out" / "scans" / "a.csv")
    scan = json.loads((tmp_path / "out" / "scans" / "a.json").read_text())
    assert ([float(row["range_m"]) for row in rows], len(rows)) == (scan["free"], 360)
    assert rows[180]["bearing_deg"] == "0.0"
    assert scan["angle_min"] + 359 * scan["angle_increment"] == pytest.approx(scan["angle_max"])
    assert (tmp_path / "out" / "birdseye" / "a.png").is_file()
