"""The sample images: a PNG writer others can read, shapes that other libraries agree with, scenes as described."""

import io
import json
import struct
import zlib
from dataclasses import asdict
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image
from worlds import free_ground

import ffseg
from ffseg.batch.plan.discover import discover
from ffseg.camera.motion import planar_pose
from ffseg.errors import OutputError
from ffseg.metrics import iou
from ffseg.parameters import Parameters
from ffseg.rendering.pairs import CAMERA_YAML, sample_camera
from ffseg.samples import png, texture
from ffseg.samples.drive import DRIVE_CAMERA, drive, drive_camera, drive_poses, drive_scene
from ffseg.samples.paint import CURVE_STEPS, GRID, SampleGrid, centers, coverage, spline
from ffseg.samples.scenes import SCENES, SampleImage
from ffseg.samples.write import sample_files, write_samples
from tests.discs import overlap

MOST_BYTES = 3_000_000
"""All sample files together; they are part of every clone."""
HOLES = {"toy": 4, "simple": 1, "complex": 9}
PAIRS = ("pair", "pair-2")


@pytest.fixture(scope="module", params=list(SCENES))
def named(request: pytest.FixtureRequest) -> tuple[str, SampleImage]:
    return request.param, SCENES[request.param]()


SHAPES = st.tuples(st.integers(1, 40), st.integers(1, 40))


@given(arrays.arrays(np.uint8, SHAPES | SHAPES.map(lambda shape: (*shape, 3))))
def test_png_is_read_back_by_other_libraries(image: np.ndarray) -> None:
    data = png.encode(image)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(data))), image)
    colors = image if image.ndim == 2 else image[:, :, ::-1]
    np.testing.assert_array_equal(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED), colors)


def test_png_of_one_value_and_of_a_skewed_distribution() -> None:
    """Row differences that occur 1, 2, 4, ... times: unlimited Huffman codes would take more than 15 bits."""
    steps = np.repeat(np.arange(1, 20), 2 ** np.arange(19))
    assert max(dict(png._depths(np.bincount(steps - 1))).values()) > png.MAX_CODE_LENGTH
    for image in (np.zeros((7, 5), np.uint8), np.cumsum(steps).astype(np.uint8)[:, None]):
        np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(png.encode(image)))), image)


def test_png_stream_is_what_zlib_inflates() -> None:
    image = texture.to_bytes(texture.grain((30, 20), 20, 1) + 128)
    data = png.encode(image)
    length = struct.unpack(">I", data[33:37])[0]
    rows = np.frombuffer(zlib.decompress(data[41 : 41 + length]), np.uint8).reshape(30, 21)
    assert set(rows[:, 0]) == {png.FILTER_UP}


CORNERS = st.lists(st.tuples(st.integers(-5, 25), st.integers(-5, 25)), min_size=3, max_size=8)


@given(CORNERS)
def test_polygon_is_the_even_odd_inside_at_the_samples(corners: list[tuple[int, int]]) -> None:
    stencil = SampleGrid(20, 20).polygon(corners)
    points, ring = np.argwhere(np.ones_like(stencil))[:, ::-1] - GRID // 2, np.array(corners) * GRID  # whole: exact
    inside, clear = np.zeros(len(points), np.bool_), np.ones(len(points), np.bool_)
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        (x, y), (across, down) = (points - a).T, b - a
        side = across * y - down * x
        on_edge = (side == 0) & ((points >= np.minimum(a, b)) & (points <= np.maximum(a, b))).all(axis=1)
        clear &= ~on_edge  # where inside is a matter of convention
        inside ^= ((y >= 0) != (y >= down)) & ((side > 0) == (down > 0))
    np.testing.assert_array_equal(stencil.ravel()[clear], inside[clear])


@pytest.mark.parametrize("radius", [3.0, 20.5, 70.0])
def test_disc_covers_its_area(radius: float) -> None:
    share = coverage(SampleGrid(160, 160).disc((79.3, 80.6), radius))
    # The count of lattice points of spacing h in a disc is off by a few times sqrt(perimeter / h) of them.
    spread = 4 * np.sqrt(2 * np.pi * radius * GRID) / GRID**2
    assert share.sum() == pytest.approx(np.pi * radius**2, abs=spread)


def test_pixel_centre_decides_the_truth() -> None:
    paper = SampleGrid(9, 9)
    assert centers(paper.polygon([(2, 2), (6, 2), (6, 6), (2, 6)])).sum() == 255 * 16  # right and lower sides are out
    assert centers(paper.disc((4, 4), 2.0001)).sum() == 255 * 13


def test_spline_passes_the_middles_of_its_legs() -> None:
    points = [(0.0, 0.0), (8.0, 0.0), (8.0, 6.0)]
    assert spline(points)[::CURVE_STEPS] == [(4.0, 3.0), (4.0, 0.0), (8.0, 3.0)]


def test_hash_is_splitmix64() -> None:
    state, mask = 1, 2**64 - 1
    z = (state * 0x9E3779B97F4A7C15) & mask
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
    assert texture.uniform((2, 3), 0)[0, 0] == ((z ^ (z >> 31)) >> 11) / 2**53


def test_grain_has_the_deviation_asked_for() -> None:
    values = texture.grain((300, 400), 5.0, 3)
    # 120,000 values: mean and deviation are off by 5 / sqrt(120,000) = 0.014 and 0.01; five times that.
    assert abs(values.mean()) < 0.075
    assert values.std() == pytest.approx(5.0, abs=0.05)


def test_scene_is_one_free_region_with_its_holes(named: tuple[str, SampleImage]) -> None:
    name, scene = named
    assert scene.image.shape[:2] == scene.truth.shape == (600, 800)
    assert set(np.unique(scene.truth)) == {0, 255}
    free = cv2.connectedComponents(scene.truth, connectivity=4)[0] - 1
    taken = cv2.connectedComponents(np.pad(255 - scene.truth, 1, constant_values=255), connectivity=8)[0] - 1
    assert (free, taken - 1) == (1, HOLES[name])


def test_default_parameters_find_its_region_and_every_hole(named: tuple[str, SampleImage]) -> None:
    """What a new user sees first; the overlap is what the stress campaign asks of scenes without narrow passages."""
    name, scene = named
    result = ffseg.segment(scene.image if scene.image.ndim == 2 else np.ascontiguousarray(scene.image[:, :, ::-1]))
    assert result.stats.stop_reason == "converged"
    assert iou(result.mask, scene.truth) >= 0.99
    assert sum(contour.signed_area < 0 for contour in result.contours) == HOLES[name]


def test_default_start_circle_lies_well_inside(named: tuple[str, SampleImage]) -> None:
    distance = cv2.distanceTransform(named[1].truth, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    assert distance[299:301, 399:401].min() > Parameters().init.radius_in((600, 800)) + 20


@cache
def files() -> dict[str, bytes]:
    return sample_files(2)


def test_files_are_small_and_pairs_are_scenes_of_their_own() -> None:
    first, second = ({name: data for name, data in files().items() if name.startswith(f"{pair}/")} for pair in PAIRS)
    scenes = files().keys() - first.keys() - second.keys()
    assert sum(map(len, files().values())) - sum(map(len, second.values())) <= MOST_BYTES
    pictures = {name for name in scenes if name.endswith(".png")}
    assert {f"truth/{name}" for name in pictures if "/" not in name} == {name for name in pictures if "/" in name}
    assert [name.partition("/")[2] for name in first] == [name.partition("/")[2] for name in second]
    assert first["pair/0002.png"] != second["pair-2/0002.png"]
    assert first["pair/camera.yaml"] == second["pair-2/camera.yaml"]


def test_labels_of_the_pair_are_its_scene() -> None:
    stored = (np.frombuffer(files()[f"pair/{folder}/0002.png"], np.uint8) for folder in ("labels", "truth"))
    labels, truth = (cv2.imdecode(data, cv2.IMREAD_UNCHANGED) for data in stored)
    assert set(np.unique(labels)) == {0, 1, 2, 3, 100, 101, 200, 201, 202, 203, 255}  # marks, boxes, walls, no scene
    assert (truth[(labels > 0) & (labels < 100)] == 255).all()
    assert not truth[(labels >= 100) & (labels < 255)].any()  # the disc of the robot has no label and is free


def test_the_drive_is_what_its_files_say() -> None:
    """Its map, made of the first views by the files, is the world's floor: camera, poses and truth belong together."""
    camera = drive_camera()
    sequence, grid = ffseg.Sequence(camera), ffseg.OccupancyMap(reach=3.0)
    for view, values in zip(drive(4).views, drive_poses(), strict=False):
        pose = planar_pose(camera, *values)
        frame = sequence.feed(view.image, pose)
        assert grid.add(frame, pose)
    assert overlap(frame.mask, view.truth) > 0.95
    chance, world = grid.probability, free_ground(drive_scene())
    rows, columns = np.nonzero(chance < 0.25)
    places = (np.stack([columns, rows], axis=1) + 0.5) * grid.cell + grid.origin
    assert len(places) > 6000
    assert shapely.contains_xy(world, places[:, 0], places[:, 1]).mean() > 0.99
    assert len(drive_poses()) == 40


def test_the_cameras_of_the_samples_are_their_files(tmp_path: Path) -> None:
    for text, camera in ((CAMERA_YAML, sample_camera()), (DRIVE_CAMERA, drive_camera())):
        (tmp_path / "camera.yaml").write_text(text)
        read = ffseg.load_camera(tmp_path / "camera.yaml")
        told = [json.dumps(asdict(one), default=np.ndarray.tolist) for one in (read, camera)]
        assert told[0] == told[1]


def test_the_drive_lies_in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ffseg.samples.write.drive", lambda: drive(2))
    written = {path.relative_to(tmp_path).as_posix() for path in write_samples(tmp_path, 0, driven=True)}
    below = {name.removeprefix("drive/") for name in written if name.startswith("drive/")}
    images = {f"{folder}{number}.png" for folder in ("", "truth/") for number in ("0001", "0002")}
    assert below == images | {"camera.yaml", "poses.csv", ".ffseg-skip", "truth/.ffseg-skip"}
    assert len((tmp_path / "drive" / "poses.csv").read_text().splitlines()) == 3
    assert [source.name for source in discover([str(tmp_path)])] == sorted(f"{name}.png" for name in SCENES)


@pytest.mark.parametrize("pairs", [0, 2])
def test_a_walk_over_the_samples_finds_the_scenes_alone(pairs: int, tmp_path: Path) -> None:
    write_samples(tmp_path, pairs)
    assert [source.name for source in discover([str(tmp_path)])] == sorted(f"{name}.png" for name in SCENES)
    assert len(discover([str(tmp_path / "truth")])) == len(SCENES)  # named itself, it is an input like any other


def test_other_files_of_these_names_are_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "toy.png").write_bytes(b"mine")
    said = r"toy\.png is there and is no such sample; choose another folder or remove it"
    with pytest.raises(OutputError, match=said):
        write_samples(tmp_path, 0)
    assert [path.name for path in tmp_path.iterdir()] == ["toy.png"]
    assert (tmp_path / "toy.png").read_bytes() == b"mine"
