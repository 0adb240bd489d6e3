"""Motion against twins and synthetic truth; real boards."""

import json
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import naive_camera
import numpy as np
import pytest

from ffseg.camera.model import Camera
from ffseg.camera.motion import (
    Motion,
    Pose,
    ground_points,
    perturbed,
    planar_motion,
    planar_parameters,
    planar_pose,
    point_slopes,
    projection_slopes,
    relative_motion,
    rotation_matrices,
)
from ffseg.camera.projections import Affine, UnifiedSphere
from ffseg.rendering.pairs import sample_camera
from tests.triangulation import triangulate

LENS = UnifiedSphere(Affine(280.0, 280.0, 399.5, 299.5), 0.95, (0.0, 0.0, 0.0, 0.0))


def tilted() -> Camera:
    up = np.array([0.08, -0.05, -1.0])
    return Camera(LENS, 800, 600, (399.5, 299.5), 0.9, up / np.linalg.norm(up))


def test_relative_motion_agrees_with_matrices() -> None:
    random = np.random.default_rng(1)
    camera = tilted()
    first, second = planar_pose(camera, 1.0, 2.0, 0.3), planar_pose(camera, -0.5, 2.2, -2.0)
    motion = relative_motion(first, second)
    one, two = (naive_camera.homogeneous(pose.rotation, pose.position) for pose in (first, second))
    between = np.linalg.inv(one) @ two
    points = random.normal(size=(10, 3))
    expected = (np.column_stack([points, np.ones(10)]) @ between.T)[:, :3]
    assert motion.apply(points) == pytest.approx(expected, abs=1e-12)
    assert motion.baseline == pytest.approx(np.hypot(1.5, 0.2))


def test_planar_parameters_undo_planar_motion() -> None:
    camera = tilted()
    motion = planar_motion(camera, np.array([0.2, -0.1, 0.4]), "ground points", 9, (0.0, 0.0))
    assert planar_parameters(camera, motion) == pytest.approx([0.2, -0.1, 0.4], abs=1e-12)


def test_contracts_pose_convention() -> None:
    pose = planar_pose(sample_camera(), 0.0, 0.0, 0.7)
    c, s = np.cos(0.7), np.sin(0.7)
    assert pose.rotation[:2, :2] == pytest.approx(np.array([[c, -s], [s, c]]))


def matrix_exponential(vector: np.ndarray) -> np.ndarray:
    """By its series: the twin of Rodrigues' formula."""
    x, y, z = vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    term, total = np.eye(3), np.eye(3)
    for order in range(1, 40):
        term = term @ cross / order
        total = total + term
    return total


def test_rotations_are_the_exponentials_of_their_vectors() -> None:
    random = np.random.default_rng(11)
    vectors = np.concatenate([random.normal(size=(20, 3)), 1e-7 * random.normal(size=(5, 3)), np.zeros((1, 3))])
    for vector, turned in zip(vectors, rotation_matrices(vectors), strict=True):
        assert turned == pytest.approx(matrix_exponential(vector), abs=1e-13)


def test_corrections_come_before_the_motion_and_ups_lean() -> None:
    camera = tilted()
    motion = planar_motion(camera, np.array([0.3, 0.1, 0.4]), "poses", 0, (0.0, 0.0))
    one = np.array([0.02, -0.03, 0.05, 0.01, 0.004, -0.006, 0.01, -0.02])
    (rotation,), (translation,), (up,) = perturbed(camera, motion, one[None])
    level = camera.level()
    turn = level.T @ matrix_exponential(np.array([0.004, -0.006, 0.05])) @ level
    point = np.array([0.4, -0.8, 0.7])
    expected = motion.apply(turn @ point + level.T @ [0.02, -0.03, 0.01])
    assert rotation @ point + translation == pytest.approx(expected, abs=1e-12)
    leaning = camera.up + level.T @ [0.01, -0.02, 0.0]
    assert up == pytest.approx(leaning / np.linalg.norm(leaning), abs=1e-12)


@pytest.mark.parametrize("on_ground", [False, True])
def test_slopes_of_points_are_those_of_the_corrections(on_ground: bool) -> None:
    camera = tilted()
    motion = planar_motion(camera, np.array([0.3, 0.1, 0.4]), "poses", 0, (0.0, 0.0))
    points = camera.meet_plane(camera.lift(np.array([[300.0, 250.0], [520.0, 420.0], [410.0, 90.0]])))
    slopes = point_slopes(camera, motion, points, on_ground=on_ground)
    step = 1e-6
    rotations, translations, ups = perturbed(camera, motion, step * np.eye(8))
    for place in range(8):
        met = replace(camera, up=ups[place]).meet_plane(points) if on_ground else points  # points as their own rays
        moved = met @ rotations[place].T + translations[place]
        assert (moved - motion.apply(points)) / step == pytest.approx(slopes[:, :, place], abs=1e-4)


def test_slopes_of_pixels_are_differences() -> None:
    camera = tilted()
    points = np.array([[0.5, 0.6, 0.7], [-0.8, 0.3, 0.9]])
    pixels, slopes = projection_slopes(camera, points)
    assert pixels == pytest.approx(camera.project(points), abs=1e-12)
    aside = np.array([1e-4, -2e-4, 3e-4])
    assert camera.project(points + aside) - pixels == pytest.approx(slopes @ aside, abs=1e-4)


def test_a_motion_without_a_spread_has_its_planar_errors() -> None:
    motion = Motion(np.eye(3), np.zeros(3), "poses", 0, 0.01, 0.02)
    assert motion.errors().T @ motion.errors() == pytest.approx(np.diag([1e-4, 1e-4, 4e-4, 0, 0, 0, 0, 0]))


def test_ground_points_of_a_tilted_camera_lie_on_the_ground() -> None:
    camera = tilted()
    pixels = np.array([[300.0, 250.0], [520.0, 420.0]])
    back = camera.project(np.column_stack([ground_points(camera, pixels), [0.9, 0.9]]) @ camera.level())
    assert back == pytest.approx(pixels, abs=1e-9)


BOARDS = {
    # file: (grid spacing in mm, images used)
    "VMR_calib.json": (30.0, None),
    # Only the images whose own pose fits below 1 px; two of the others are fitted to 1.8 and 2.4 px RMS.
    "imgMei_calib.json": (42.0, ("imgMei_001.jpg", "imgMei_005.jpg", "imgMei_009.jpg", "imgMei_010.jpg")),
}


@pytest.mark.parametrize("name", BOARDS)
def test_real_boards(name: str, data_folder: Path) -> None:
    data = json.loads((data_folder / "omni_boards" / name).read_text())
    k, (width, height) = data["K"], data["size"]
    lens = UnifiedSphere(Affine(k[0][0], k[1][1], k[0][2], k[1][2], k[0][1]), data["xi"], tuple(data["D"]))
    camera = Camera(lens, width, height, (k[0][2], k[1][2]), 1.0)
    spacing, wanted = BOARDS[name]
    for image in data["images"]:
        points = np.array(image["board_mm"]) @ np.array(image["R"]).T + image["t"]
        error = np.hypot(*(camera.project(points) - image["corner_px"]).T)
        # The file says its residuals with four and three decimals.
        assert np.sqrt(np.mean(error**2)) == pytest.approx(image["rms_px"], abs=6e-5)
        assert error.max() == pytest.approx(image["max_px"], abs=6e-4)
    used = [image for image in data["images"] if wanted is None or image["image"] in wanted]
    for first, second in permutations(used, 2):
        assert _grid_error(camera, first, second, spacing) < 0.03


def _grid_error(camera: Camera, first: dict[str, list[float]], second: dict[str, list[float]], spacing: float) -> float:
    """Median error of the triangulated distances between grid neighbours, relative."""
    one, two = (naive_camera.homogeneous(np.array(i["R"]), np.array(i["t"])) for i in (first, second))
    between = two @ np.linalg.inv(one)
    motion = relative_motion(Pose(between[:3, :3].T, -between[:3, :3].T @ between[:3, 3]), Pose(np.eye(3), np.zeros(3)))
    found, _ = triangulate(camera, motion, np.array(first["corner_px"]), np.array(second["corner_px"]))
    board = np.array(first["board_mm"])
    apart = np.linalg.norm(board[:, None] - board, axis=2)
    measured = np.linalg.norm(found[:, None] - found, axis=2)
    near = np.abs(apart - spacing) < 1e-6
    return float(np.median(np.abs(measured[near] / spacing - 1.0)))
