"""Parts of the motion between two images against closed forms."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest

from ffseg.camera.model import Camera
from ffseg.camera.motion import (
    Motion,
    ground_points,
    perturbed,
    planar_motion,
    rotation_matrices,
)  # fmt: skip
from ffseg.freespace.motion import evidence
from ffseg.rendering.pairs import render_pair, sample_camera


@pytest.fixture(scope="module")
def camera() -> Camera:
    return render_pair(3).camera


def test_rotation_matrices_turn_by_any_angle() -> None:
    for angle in (0.0, 1e-9, 0.3, 1.0, pi / 2, 3.0):
        c, s = cos(angle), sin(angle)
        about_z, about_x = rotation_matrices(np.array([[0.0, 0.0, angle], [angle, 0.0, 0.0]]))
        np.testing.assert_allclose(about_z, [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-12)
        np.testing.assert_allclose(about_x, [[1, 0, 0], [0, c, -s], [0, s, c]], atol=1e-12)


def test_a_correction_moves_points_before_the_motion_does(camera: Camera) -> None:
    rng = np.random.default_rng(4)
    rotation = rotation_matrices(rng.normal(0, 0.5, (1, 3)))[0]
    motion = Motion(rotation, rng.normal(0, 1, 3), "poses", 0, 0.0, 0.0)
    x, y, turn, lift = 0.3, -0.2, 0.1, 0.05
    rotations, translations, ups = perturbed(camera, motion, np.array([[x, y, turn, lift, 0.0, 0.0, 0.0, 0.0]]))
    points = rng.normal(0, 2, (5, 3))
    level = camera.level()
    c, s = cos(turn), sin(turn)
    moved = (points @ level.T) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + [x, y, lift]
    expected = motion.apply(moved @ level)
    np.testing.assert_allclose(points @ rotations[0].T + translations[0], expected, atol=1e-12)
    np.testing.assert_allclose(ups[0], camera.up, atol=1e-12)


def test_a_lean_tilts_up_toward_level_x(camera: Camera) -> None:
    motion = Motion(np.eye(3), np.zeros(3), "poses", 0, 0.0, 0.0)
    _, _, ups = perturbed(camera, motion, np.array([[0, 0, 0, 0, 0, 0, 0.02, 0.0]], float))
    level = camera.level()
    assert (level @ ups[0])[0] - (level @ camera.up)[0] == pytest.approx(0.02, rel=1e-3)
    assert np.linalg.norm(ups[0]) == pytest.approx(1.0)


def test_ground_points_are_levelled(camera: Camera) -> None:
    """What a camera mounted upside down or turned sees of the ground is given in the levelled frame."""
    from dataclasses import replace

    turned = replace(camera, up=np.array([0.3, -0.1, -0.9]) / np.linalg.norm([0.3, -0.1, -0.9]))
    pixels = np.array([[520.0, 340.0]])
    (point,) = ground_points(turned, pixels)
    ray = turned.level() @ turned.lift(pixels)[0]
    assert point == pytest.approx(ray[:2] * (point[0] / ray[0]), rel=1e-9)
    assert planar_motion(turned, np.array([0.1, 0.2, 0.3]), "poses", 0, (0.0, 0.0)).baseline == pytest.approx(
        np.hypot(0.1, 0.2)
    )


@pytest.mark.parametrize("shape", [(165, 193), (164, 192), (20, 200)])  # windows that end at the border, and one less
def test_the_grid_keeps_clear_of_all_that_is_not_free(shape: tuple[int, int]) -> None:
    random = np.random.default_rng(3)
    free = random.random(shape) > 0.002
    rig = replace(sample_camera(), center=(90.0, 60.0), robot_radius=15.0)
    expected = []
    for y in range(evidence.GRID_STEP // 2, shape[0] - evidence.CLEAR, evidence.GRID_STEP):
        for x in range(evidence.GRID_STEP // 2, shape[1] - evidence.CLEAR, evidence.GRID_STEP):
            reach = evidence.CLEAR
            window = free[y - reach : y + reach + 1, x - reach : x + reach + 1]
            if window.all() and np.hypot(x - 90, y - 60) > 15 + reach:
                expected.append([x, y])
    found = evidence.ground_grid(rig, free)
    assert found.tolist() == expected
    assert bool(expected) == (shape[0] > 2 * evidence.CLEAR)
