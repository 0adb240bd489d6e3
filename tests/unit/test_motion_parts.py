"""Parts of the motion between two images against closed forms."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

from ffseg.camera.model import Camera
from ffseg.camera.motion import (
    Motion,
    fit_planar,
    ground_points,
    perturbed,
    planar_motion,
    rotation_matrices,
)  # fmt: skip
from ffseg.rendering.pairs import render_pair


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


def test_a_fit_weighs_by_the_inverse_variance() -> None:
    """Pairs at the same places say two things: the mean of both, each by its 1 / sigma^2, and no turn."""
    angles = np.arange(8) * pi / 4
    places = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    current = np.concatenate([places, places])
    shift, sure, vague = 0.02, 0.01, 0.02
    previous = current + np.repeat([[0.0, 0.0], [shift, 0.0]], 8, axis=0)
    fit = fit_planar(current, previous, np.repeat([sure, vague], 8))
    assert fit is not None
    assert fit.inliers.all()
    assert fit.parameters == pytest.approx([shift * vague**-2 / (sure**-2 + vague**-2), 0.0, 0.0], abs=1e-12)


def test_a_pair_agrees_within_three_standard_deviations() -> None:
    angles = np.arange(40) * pi / 20
    current = 2 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for off, inside in ((2.8, True), (3.3, False)):
        previous = current.copy()
        previous[0] += [off * 0.01 * 40 / 39, 0.0]  # the fit follows it by about a fortieth
        fit = fit_planar(current, previous, np.full(40, 0.01))
        assert fit is not None
        assert bool(fit.inliers[0]) == inside
        assert fit.inliers[1:].all()


@pytest.mark.parametrize("count", [7, 8, 9])
def test_a_fit_needs_eight_pairs_that_agree(count: int) -> None:
    angles = np.arange(count) * 2 * pi / count
    current = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rng = np.random.default_rng(2)
    wrong = rng.uniform(-1, 1, (6, 2))
    everyone = np.concatenate([current, wrong])
    fit = fit_planar(
        everyone, np.concatenate([current + 0.5, wrong + rng.uniform(1, 2, (6, 2))]), np.full(count + 6, 0.01)
    )
    assert (fit is not None) == (count >= 8)


def test_the_same_pairs_give_the_same_fit() -> None:
    rng = np.random.default_rng(9)
    current = rng.uniform(-2, 2, (60, 2))
    previous = current + [0.1, 0.2] + rng.normal(0, 0.02, (60, 2))
    previous[::3] += rng.uniform(-1, 1, (20, 2))
    fits = [fit_planar(current, previous, np.full(60, 0.01)) for _ in range(5)]
    assert len({None if fit is None else fit.parameters.tobytes() for fit in fits}) == 1


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
