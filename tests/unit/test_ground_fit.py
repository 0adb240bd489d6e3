"""The fit of a motion to points of the ground that were placed by hand: exact, with outliers, with too few."""

from dataclasses import replace

import numpy as np
import pytest

from ffseg.camera.motion import PARAMETERS, planar_motion
from ffseg.freespace.motion import candidates, ground
from ffseg.freespace.motion.candidates import FREE, GroundCandidates
from ffseg.freespace.motion.ground import GroundFit, fit_ground, predictions, prior_sigmas
from ffseg.freespace.motion.tracking import TrackedPoints
from ffseg.rendering.pairs import sample_camera

CAMERA = sample_camera()
SIGMAS = prior_sigmas(0.1, 0.05)
SIGMA = 0.15
"""Of a placement, pixels."""
SHIFT = np.array([0.02, -0.03, 0.01, 0, 0, 0, 0, 0])
"""What the prior is off by."""


PRIOR = planar_motion(CAMERA, np.array([0.25, 0.05, 0.1]), "ground points", 0, (0.1, 0.05))


def places(count: int, seed: int = 1) -> np.ndarray:
    """Pixels on the ground round the robot."""
    random = np.random.default_rng(seed)
    angles, radii = random.uniform(0, 2 * np.pi, count), random.uniform(90, 240, count)
    return np.stack([CAMERA.center[0] + radii * np.cos(angles), CAMERA.center[1] + radii * np.sin(angles)], axis=1)


def fitted(
    monkeypatch: pytest.MonkeyPatch,
    current: np.ndarray,
    previous: np.ndarray,
    information: np.ndarray | None = None,
    owner: np.ndarray | None = None,
) -> GroundFit | None:
    """The fit to these placements; one round, as they do not come any nearer by being placed again."""
    if information is None:
        information = np.tile(np.eye(2) / SIGMA**2, (len(current), 1, 1))
    owner = np.full(len(current), FREE) if owner is None else owner
    tracks = TrackedPoints(current, seen(current, np.zeros(PARAMETERS)), previous, information, owner, len(current))
    monkeypatch.setattr(ground, "track_points", lambda *_: tracks)
    grey = np.zeros((CAMERA.height, CAMERA.width), np.uint8)
    return fit_ground(CAMERA, PRIOR, SIGMAS, (grey, grey), GroundCandidates(current, owner), ("full",))


def seen(current: np.ndarray, shift: np.ndarray = SHIFT) -> np.ndarray:
    return predictions(CAMERA, PRIOR, current, shift[None])[0]


def test_points_on_edges_count_across_them_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is placed anywhere along its own edge; across it, all agree with one motion."""
    current = places(60)
    angles = np.random.default_rng(2).uniform(0, np.pi, 60)
    along, across = np.stack([np.cos(angles), np.sin(angles)], 1), np.stack([-np.sin(angles), np.cos(angles)], 1)
    off = np.random.default_rng(3).uniform(-6, 6, 60)
    information = across[:, :, None] * across[:, None] / SIGMA**2 + 1e-9 * np.eye(2)
    fit = fitted(monkeypatch, current, seen(current) + off[:, None] * along, information)
    assert fit.count == 60
    np.testing.assert_allclose(fit.offset[:3], SHIFT[:3], atol=5e-4)  # the prior holds a little, and slopes are linear


def test_a_motion_stands_out_among_points_that_each_go_their_own_way(monkeypatch: pytest.MonkeyPatch) -> None:
    current = places(100)
    previous = seen(current)
    previous[:55] += np.random.default_rng(5).uniform(10, 200, (55, 2))
    fit = fitted(monkeypatch, current, previous)
    assert fit.inliers.tolist() == [False] * 55 + [True] * 45
    np.testing.assert_allclose(fit.offset[:3], SHIFT[:3], atol=5e-4)


def test_a_point_counts_up_to_three_and_a_half_standard_deviations(monkeypatch: pytest.MonkeyPatch) -> None:
    current = places(200)
    previous = seen(current, np.zeros(PARAMETERS))
    previous[0, 0] += 3.4 * SIGMA
    previous[1, 0] -= 3.7 * SIGMA
    fit = fitted(monkeypatch, current, previous)
    assert fit.inliers.tolist() == [True, False] + [True] * 198


@pytest.mark.parametrize("count", [7, 8])
def test_eight_points_give_a_motion(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    current = places(count)
    assert (fitted(monkeypatch, current, seen(current)) is not None) == (count == 8)


def test_the_choice_between_two_motions_is_the_same_every_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of the points go one way, half another: chance decides, and the same chance each time."""
    current = places(100)
    previous = np.concatenate([seen(current[:50]), seen(current[50:], -SHIFT)])
    previous += np.random.default_rng(7).normal(0, SIGMA, (100, 2))
    fits = [fitted(monkeypatch, current, previous) for _ in range(8)]
    assert len({fit.offset.tobytes() for fit in fits if fit is not None}) == 1
    assert None not in fits


def test_the_doubt_about_a_component_is_the_fit_of_all_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its points are left out: the motion that the others give, and how sure of it they are."""
    current, count = places(90), 2
    owner = np.array([0] * 20 + [1] * 30 + [FREE] * 40)
    previous = seen(current) + np.random.default_rng(9).normal(0, SIGMA, (90, 2))
    previous[:20] += 0.15  # a thing of its own mind, but not so much as to be left out
    fit = fitted(monkeypatch, current, previous, owner=owner)
    assert fit.inliers.all()
    doubt = fit.without(count)
    assert doubt.known.tolist() == [True, True]
    for component in range(count):
        others = owner != component
        alone = fitted(monkeypatch, current[others], previous[others], owner=owner[others])
        assert alone.inliers.all()
        moved = np.sqrt(np.diag(doubt.covariances[component]))
        # To a twentieth of a standard deviation: the motion is linear only so far from where it was fitted.
        assert (np.abs(alone.offset - fit.offset - doubt.steps[component]) < 0.05 * moved).all()
        spread = alone.motion.errors()
        # The residuals of the others are those of the common fit, which they alone would make a little smaller.
        np.testing.assert_allclose(np.diag(spread.T @ spread), moved**2, rtol=0.06)


def test_a_component_is_not_judged_by_a_motion_that_only_it_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    current = places(27)
    for others, known in ((7, False), (8, True)):
        own = current[: 19 + others]
        fit = fitted(monkeypatch, own, seen(own), owner=np.array([0] * 19 + [FREE] * others))
        assert fit.without(1).known.tolist() == [known]


@pytest.mark.parametrize("shape", [(165, 193), (164, 192), (20, 200)])  # windows that end at the border, and one less
def test_the_grid_keeps_clear_of_all_that_is_not_free(shape: tuple[int, int]) -> None:
    free = np.random.default_rng(3).random(shape) > 0.002
    rig = replace(sample_camera(), center=(90.0, 60.0), robot_radius=15.0)
    expected = []
    for y in range(candidates.GRID_STEP // 2, shape[0] - candidates.CLEARANCE, candidates.GRID_STEP):
        for x in range(candidates.GRID_STEP // 2, shape[1] - candidates.CLEARANCE, candidates.GRID_STEP):
            reach = candidates.CLEARANCE
            window = free[y - reach : y + reach + 1, x - reach : x + reach + 1]
            if window.all() and np.hypot(x - 90, y - 60) > 15 + reach:
                expected.append([x, y])
    assert (candidates.ground_grid(rig, free).tolist(), bool(expected)) == (
        expected,
        shape[0] > 2 * candidates.CLEARANCE,
    )
