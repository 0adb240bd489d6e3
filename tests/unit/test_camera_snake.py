"""The snake's altitude term on pairs: marks are passed, boxes and walls are not, and what its radial zone asks for."""

from functools import lru_cache

import numpy as np
import pytest
from rendered import render_pair, segment_view

from ffseg.camera.motion import planar_pose
from ffseg.freespace.altitudes import BEHIND_COSINE, CLEAR_RADIUS, ZONE_COSINE, ZONE_REACH, _passable
from ffseg.freespace.sequence import Frame, Sequence
from ffseg.parameter_files import load_params
from ffseg.rendering.pairs import RenderedPair
from ffseg.rendering.raycast import FIRST_BOX, FIRST_WALL

SNAKE = load_params(None, {"method": "snake"})
SEED = 7
"""Four marks and three boxes, all well inside the view."""
CENTER = (100.0, 100.0)


def pair() -> RenderedPair:
    return render_pair(SEED)


@lru_cache(maxsize=2)
def frame(*, with_poses: bool) -> Frame:
    sequence = Sequence(pair().camera, load_params(), method="snake")
    poses = [planar_pose(pair().camera, *pose) if with_poses else None for pose in pair().poses]
    sequence.feed(pair().previous.image, poses[0])
    return sequence.feed(pair().current.image, poses[1])


def shares(mask: np.ndarray) -> tuple[list[float], list[float]]:
    labels = pair().current.labels
    marks = range(1, len(pair().scene.marks) + 1)
    boxes = range(FIRST_BOX, FIRST_WALL)
    return tuple([float(mask[labels == one].mean()) for one in of if (labels == one).any()] for of in (marks, boxes))  # type: ignore[return-value]


@pytest.mark.parametrize("with_poses", [True, False])
def test_the_snake_passes_marks_with_the_term_and_stops_without(with_poses: bool) -> None:
    without = segment_view(pair().current.image, pair().camera, SNAKE)
    marks, boxes = shares(without.mask)
    assert (len(marks), len(boxes)) == (4, 3)
    assert max(marks) < 0.3  # what is free of a mark is its mixed border, most of it where the mark is small
    found = frame(with_poses=with_poses)
    marks, boxes = shares(found.mask)
    assert min(marks) > 0.95
    assert max(boxes) < 0.05
    assert found.mask[pair().current.labels >= FIRST_WALL].mean() < 0.01
    assert "points let the snake pass" in found.note
    assert found.motion is not None
    assert found.segmentation.timings.evolve_ms > 0
    assert found.obstacles_ms > 0


def test_the_first_image_has_no_term() -> None:
    sequence = Sequence(pair().camera, load_params(), method="snake")
    first = sequence.feed(pair().current.image)
    assert "first image" in first.note
    assert np.array_equal(first.mask, segment_view(pair().current.image, pair().camera, SNAKE).mask)


def test_without_a_motion_the_snake_runs_without_its_term() -> None:
    sequence = Sequence(pair().camera, SNAKE)
    sequence.feed(np.full((600, 800), 90, np.uint8))
    found = sequence.feed(pair().current.image)
    assert found.motion is None
    assert found.note.endswith("the snake ran without its altitude term")
    assert np.array_equal(found.mask, segment_view(pair().current.image, pair().camera, SNAKE).mask)


def passable(*points: tuple[float, float, bool]) -> list[bool]:
    """Which of these points, given relative to the centre and as high or not, let the snake pass."""
    places = np.array([point[:2] for point in points]) + CENTER
    return _passable(places, np.array([point[2] for point in points]), CENTER).tolist()


def at(degrees: float, distance: float) -> tuple[float, float]:
    """A place `distance` away from (50, 0), `degrees` off outward."""
    return 50 + distance * np.cos(np.deg2rad(degrees)), distance * np.sin(np.deg2rad(degrees))


def test_a_point_needs_ground_beyond_it() -> None:
    assert passable((50, 0, False)) == [False]
    assert passable((50, 0, False), (*at(0, ZONE_REACH - 1), False))[0]
    assert not passable((50, 0, False), (*at(0, ZONE_REACH + 1), False))[0]
    assert not passable((50, 0, False), (*at(180, 20), False))[0]
    inside, outside = np.rad2deg(np.arccos(ZONE_COSINE)) + np.array([-1.0, 1.0])
    assert passable((50, 0, False), (*at(inside, 40), False))[0]
    assert not passable((50, 0, False), (*at(outside, 40), False))[0]


def test_nothing_may_stand_behind_or_beside_it() -> None:
    ground = (*at(0, 20), False)
    assert not passable((50, 0, False), ground, (*at(0, ZONE_REACH - 1), True))[0]
    assert passable((50, 0, False), ground, (*at(0, ZONE_REACH + 1), True))[0]
    inside, outside = np.rad2deg(np.arccos(BEHIND_COSINE)) + np.array([-1.0, 1.0])
    assert not passable((50, 0, False), ground, (*at(-inside, 50), True))[0]
    assert passable((50, 0, False), ground, (*at(-outside, 50), True))[0]
    assert not passable((50, 0, False), ground, (*at(180, CLEAR_RADIUS - 1), True))[0]
    assert passable((50, 0, False), ground, (*at(180, CLEAR_RADIUS + 1), True))[0]
