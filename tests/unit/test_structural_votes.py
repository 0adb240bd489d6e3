"""How the structural test weighs what corners and outline samples say: every rule on numbers made for it (Eq. 9)."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ffseg.freespace import corners, outlines, structural
from ffseg.image.keypoints import Alignments, Candidates

EPSILON = 0.08
LOW, HIGH = 0.0, 0.09


def matches(altitudes: list[float], sigma: float = 0.01) -> corners.Matches:
    count = len(altitudes)
    return corners.Matches(
        np.zeros(count, np.intp), np.zeros((count, 2)), np.zeros((count, 2)), np.array(altitudes, float),
        np.full(count, sigma), np.ones(count, np.bool_),
    )  # fmt: skip


def verdict(
    monkeypatch: pytest.MonkeyPatch,
    altitudes: list[float],
    flat: int,
    raised: int,
    *,
    known: bool = True,
    area: int = 99,
) -> str:
    """Of one component with these corners and votes of its outline."""
    votes = np.array([flat], np.intp), np.array([raised], np.intp)
    monkeypatch.setattr(structural, "shared_doubt", lambda *_: SimpleNamespace(known=np.array([known])))
    monkeypatch.setattr(structural, "sway_of", lambda *_: SimpleNamespace(of=lambda asked: asked))
    monkeypatch.setattr(structural, "match_corners", lambda *_: matches(altitudes))
    monkeypatch.setattr(structural, "outline_votes", lambda pair, asked, *_: tuple(v[: len(asked)] for v in votes))
    component: Any = SimpleNamespace(index=0, area=area, centroid=(5.0, 6.0))
    pair: Any = SimpleNamespace(motion=None)
    (found,) = structural.structural_test(pair, [component], EPSILON)
    return found.verdict


@pytest.mark.parametrize(
    ("altitudes", "flat", "raised", "expected"),
    [
        ([LOW] * 6, 10, 0, "false_obstacle"),
        ([LOW] * 6, 10, 2, "false_obstacle"),  # a sixth of the samples contradicts
        ([LOW] * 6, 10, 3, "obstacle"),  # more than a fifth
        ([LOW], 4, 0, "false_obstacle"),
        ([LOW], 3, 0, "obstacle"),  # too few samples, and corners to stand in for them
        ([LOW] * 4, 2, 0, "false_obstacle"),  # six together
        ([LOW] * 3, 2, 0, "obstacle"),
        ([LOW] * 4, 2, 1, "obstacle"),
        ([LOW] * 5 + [HIGH], 10, 0, "false_obstacle"),  # five corners outweigh one
        ([LOW] * 4 + [HIGH], 10, 0, "obstacle"),
        ([0.07] * 6, 10, 0, "obstacle"),  # none is surely below the threshold
        ([], 10, 0, "untested"),
    ],
)
def test_verdicts(
    monkeypatch: pytest.MonkeyPatch, altitudes: list[float], flat: int, raised: int, expected: str
) -> None:
    assert verdict(monkeypatch, altitudes, flat, raised) == expected


def test_without_a_motion_or_enough_pixels_nothing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert verdict(monkeypatch, [LOW] * 6, 10, 0, known=False) == "untested"
    assert verdict(monkeypatch, [LOW] * 6, 10, 0, area=29) == "untested"
    assert verdict(monkeypatch, [LOW] * 6, 10, 0, area=30) == "false_obstacle"


def judged(
    shift: tuple[float, float], score: float = 0.95, moved: tuple[float, float] = (0.0, 0.0)
) -> tuple[bool, bool]:
    """Flat and raised of one sample whose parallax at the threshold is 4 px along x; a match is good to 0.2 px."""
    at = np.array([[100.0, 50.0]])
    ground = Candidates(np.stack([at, at + [4.0, 0.0]], axis=1), np.tile([1.0, 0.0, 0.0, 1.0], (1, 2, 1)))
    aligned = Alignments(at + [shift], np.array([score]), np.array([1e6 * np.eye(2)]), np.ones(1))
    flat, raised = outlines._judge(aligned, ground, np.array([moved]), np.zeros((1, 2, 2)))
    return bool(flat[0]), bool(raised[0])


def test_a_sample_speaks_when_two_standard_deviations_keep_it_from_the_threshold() -> None:
    """The altitude of a shift of 4 px is the threshold; its standard deviation is a twentieth of that."""
    assert judged((0.0, 0.0)) == (True, False)
    assert judged((4 * 0.85, 0.0)) == (True, False)
    assert judged((4 * 0.95, 0.0)) == (False, False)
    assert judged((4 * 1.05, 0.0)) == (False, False)
    assert judged((4 * 1.15, 0.0)) == (False, True)
    assert judged((-4 * 1.15, 0.0)) == (False, True)


def test_a_sample_that_leaves_its_curve_or_looks_otherwise_contradicts() -> None:
    assert judged((0.0, 0.7)) == (True, False)
    assert judged((0.0, 0.9)) == (False, True)  # four standard deviations are 0.8 px
    assert judged((0.0, 0.0), score=0.8) == (False, True)
    assert judged((0.0, 0.0), score=np.nan) == (False, False)


def test_what_the_motion_owes_is_taken_off() -> None:
    assert judged((4.0, 0.0), moved=(4.0, 0.0)) == (True, False)
    assert judged((0.0, 0.0), moved=(8.0, 0.0)) == (False, True)


def corner(
    monkeypatch: pytest.MonkeyPatch,
    step: tuple[float, float],
    score: float = 0.95,
    *,
    unique: bool = True,
    near: float = 1.0,
) -> tuple[bool, float]:
    """Whether a corner's match counts, and its altitude; nearness grows by one in 10 px along x, the mount is at 1 m."""
    at = np.array([[100.0, 50.0]])
    start = Candidates(at[:, None], np.array([[[1.0, 0.0, 0.0, 1.0]]]))
    found = SimpleNamespace(pixels=at, owner=np.zeros(1, np.intp))
    rate = np.array([[10.0, 0.0]])
    nothing = np.zeros((1, 2)), np.zeros((1, 2, 2))
    monkeypatch.setattr(corners, "harris_points", lambda *_: found)
    monkeypatch.setattr(corners, "_sweep", lambda *_: (start, rate, np.array([near]), np.array([unique])))
    aligned = Alignments(at + [step], np.array([score]), np.array([1e6 * np.eye(2)]), np.ones(1))
    monkeypatch.setattr(corners, "align_patches", lambda *_: aligned)
    monkeypatch.setattr(corners, "swayed", lambda *_: nothing)
    pair: Any = SimpleNamespace(current=None, previous=None, camera=SimpleNamespace(mounting=lambda: 1.0))
    result = corners.match_corners(pair, [], EPSILON)
    return bool(result.good[0]), float(result.altitude[0])


def test_a_corner_counts_when_it_is_unique_similar_and_on_its_curve(monkeypatch: pytest.MonkeyPatch) -> None:
    assert corner(monkeypatch, (0.0, 0.0)) == (True, 0.0)
    good, altitude = corner(monkeypatch, (2.0, 0.0))
    assert good
    assert altitude == pytest.approx(1 - 1 / 1.2)
    assert not corner(monkeypatch, (0.0, 0.0), unique=False)[0]
    assert not corner(monkeypatch, (0.0, 0.0), score=0.84)[0]
    assert not corner(monkeypatch, (2.6, 0.0))[0]  # another place
    assert not corner(monkeypatch, (0.0, 2.2))[0]  # off its curve
    assert corner(monkeypatch, (0.0, 1.8))[0]
    assert not corner(monkeypatch, (0.0, 0.0), near=-0.1)[0]


def test_samples_in_noise_say_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    found = SimpleNamespace(pixels=np.zeros((3, 2)), owner=np.zeros(3, np.intp))
    ground = SimpleNamespace(pixels=np.zeros((3, 2, 2)), warps=np.zeros((3, 2, 2, 2)))
    votes = np.array([True, True, False]), np.array([False, False, True])
    monkeypatch.setattr(outlines, "outline_points", lambda *_: found)
    monkeypatch.setattr(outlines, "plane_candidates", lambda *_: ground)
    monkeypatch.setattr(outlines, "align_patches", lambda *_: None)
    monkeypatch.setattr(outlines, "swayed", lambda *_: (None, None))
    monkeypatch.setattr(outlines, "_judge", lambda *_: votes)
    monkeypatch.setattr(outlines, "_contrast", lambda *_: np.array([1000.0, 40.0, 1000.0]))
    pair: Any = SimpleNamespace(current=None, previous=None, camera=None, motion=None, noise=2.0)  # 4 is a tenth of 40
    flat, raised = outlines.outline_votes(pair, [None], EPSILON, None)  # type: ignore[list-item, arg-type]
    assert (flat.tolist(), raised.tolist()) == ([1], [1])
