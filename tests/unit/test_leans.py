"""How a camera leaned along a drive: a level robot is left level, a nodding one is followed."""

from __future__ import annotations

import numpy as np

from ffseg.freespace.leans import Lean, Leans
from ffseg.freespace.window import Link

SIGMA, NOD_SIGMA = np.deg2rad(0.12), np.deg2rad(0.007)
"""What pairs of rendered drives state."""


def followed(true: np.ndarray, turns: np.ndarray, random: np.random.Generator, lost: int = -1) -> Leans:
    """The leans of a drive whose pairs are off by what they state times the slack that they are given."""
    leans = Leans()
    leans.follow("0", (), None)
    for number in range(1, len(true)):
        c, s = np.cos(turns[number]), np.sin(turns[number])
        nod = true[number - 1] - np.array([[c, -s], [s, c]]) @ true[number] + random.normal(0.0, NOD_SIGMA, 2)
        seen = true[number] + random.normal(0.0, 3.0 * SIGMA, 2)
        link = Link(str(number - 1), (0.12, 0.0, float(turns[number])), (float(nod[0]), float(nod[1])))
        told = Lean(float(seen[0]), float(seen[1]), SIGMA, NOD_SIGMA)
        leans.follow(str(number), (link,), None if number == lost else told)
    return leans


def errors(leans: Leans, true: np.ndarray) -> np.ndarray:
    return np.array([leans.of(str(number))[0] for number in range(len(true))]) - true


def test_a_level_robot_is_left_level() -> None:
    """Whatever single pairs say: they err by a third of a degree."""
    random = np.random.default_rng(1)
    level = np.zeros((20, 2))
    leans = followed(level, random.uniform(-0.3, 0.3, 20), random)
    assert np.abs(errors(leans, level)).max() < np.deg2rad(0.02)
    assert leans.of("19")[1] < np.deg2rad(0.02)


def test_a_camera_that_is_mounted_askew_is_found_out() -> None:
    random = np.random.default_rng(4)
    askew, turns = np.tile(np.deg2rad([1.0, -0.5]), (20, 1)), random.uniform(-0.3, 0.3, 20)
    off = errors(followed(askew, turns, random), askew)
    assert np.abs(off[14:]).max() < np.deg2rad(0.35)


def test_a_nodding_robot_is_followed_from_its_first_frame() -> None:
    random = np.random.default_rng(2)
    true, turns = random.normal(0.0, np.deg2rad(1.4), (20, 2)), random.uniform(-0.3, 0.3, 20)
    leans = followed(true, turns, random)
    off = errors(leans, true)
    assert np.abs(off[0]).max() < np.deg2rad(1.0) < np.abs(true).max()
    assert np.abs(off[10:]).max() < np.deg2rad(0.3)
    stated = np.array([leans.of(str(number))[1] for number in range(20)])
    assert np.sqrt(np.mean(off**2)) < 1.5 * np.sqrt(np.mean(stated**2)), "and it is known how well"


def test_a_frame_without_ground_may_lean_as_the_others_do() -> None:
    random = np.random.default_rng(3)
    true = random.normal(0.0, np.deg2rad(1.4), (14, 2))
    lost = followed(true[:13], np.zeros(13), random, lost=12)
    lean, sigma = lost.of("12")
    assert not lean.any()
    assert np.deg2rad(0.9) < sigma < np.deg2rad(2.0)
    found = followed(true, np.zeros(14), random, lost=12)
    assert found.of("12")[1] < 0.5 * sigma, "the next frame tells"
