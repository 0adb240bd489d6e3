"""Numbers of things along a sequence, the window of earlier images, and verdicts that persist."""

from dataclasses import replace

import numpy as np
import pytest
from rendered import plain_pair, segment_view

from ffseg.batch.views import WINDOW as VIEWS_WINDOW
from ffseg.batch.views import CameraSetup
from ffseg.camera.motion import Pose, planar_parameters, planar_pose, relative_motion
from ffseg.freespace.sequence import Sequence, free_space
from ffseg.freespace.tracks import MAX_DISTANCE, ObstacleTracks, associate, in_earlier_frame, with_track_numbers
from ffseg.freespace.window import WINDOW, EarlierImage
from ffseg.parameter_files import load_params
from ffseg.rendering.pairs import sample_camera

EPSILON = 0.08


def test_places_move_as_the_motion_of_the_camera_does() -> None:
    camera = sample_camera()
    before, now = planar_pose(camera, 0.4, -0.2, 0.3), planar_pose(camera, 0.1, 0.5, -0.4)
    motion = relative_motion(before, now)
    points = np.array([[1.0, 0.3], [-0.7, 1.2]])
    level = np.column_stack([points, [0.9, 0.9]]) @ camera.level()
    expected = (motion.apply(level) @ camera.level().T)[:, :2]
    assert in_earlier_frame(points, planar_parameters(camera, motion).tolist()) == pytest.approx(expected, abs=1e-12)


def test_places_are_linked_when_each_is_the_others_nearest() -> None:
    before = np.array([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]])
    now = np.array([[0.1, 0.0], [0.15, 0.0], [3.0, MAX_DISTANCE + 0.01], [np.nan, 0.0]])
    assert (associate(now, before), associate(now, np.empty((0, 2)))) == ([0, -1, -1, -1], [-1] * 4)
    assert associate(np.empty((0, 2)), before) == []


def test_numbers_stay_with_their_things() -> None:
    tracks = ObstacleTracks(kept=2)
    assert tracks.follow("a", np.array([[1.0, 0.0], [2.0, 0.0]]), []) == [0, 1]
    step = ("a", (0.5, 0.0, 0.0))
    assert tracks.follow("b", np.array([[1.5, 0.0], [0.5, 0.0], [9.0, 0.0]]), [step]) == [1, 0, 2]
    assert tracks.follow("c", np.array([[1.5, 0.0]]), [("x", (0.0, 0.0, 0.0)), ("b", (0.0, 0.0, 0.0))]) == [1]
    assert tracks.follow("d", np.array([[1.5, 0.0]]), [("a", (0.0, 0.0, 0.0))]) == [3], "a is forgotten"


def test_lines_are_numbered_in_time_whatever_their_order() -> None:
    line = {"ground_x_m": 1.0, "ground_y_m": 0.0, "links": []}
    later = {**line, "links": [["one.png", 0.0, 0.0, 0.0]]}
    blank = {**line, "ground_x_m": "", "ground_y_m": ""}
    names = ["one.png", "two.png", "none.png"]
    found = with_track_numbers(names, {"two.png": [later], "one.png": [line, blank]})
    assert [[row["track"] for row in found[name]] for name in names] == [[0, 1], [0], []]


def test_the_chain_of_images_before_ends() -> None:
    names = [f"{number}.png" for number in range(12)]
    views = CameraSetup(sample_camera(), {}, dict(zip(names[1:], names[:-1], strict=True)))
    assert VIEWS_WINDOW == WINDOW == len(views.chain("11.png"))
    assert views.chain("11.png")[:2] == ("10.png", "9.png")
    assert CameraSetup(sample_camera(), {}, {"a": "b", "b": "a"}).chain("a") == ("b",)


def test_what_a_standing_robot_leaves_open_is_asked_of_an_earlier_image() -> None:
    rendered = plain_pair()
    camera, params = rendered.camera, load_params()
    found = segment_view(rendered.current.image, camera, params)
    poses = tuple(planar_pose(camera, *pose) for pose in rendered.poses)
    again = EarlierImage(rendered.current.image, (poses[1], poses[1]))
    alone = free_space(rendered.current.image, found, [again], camera, EPSILON)
    assert {row.verdict for row in alone.components} == {"untested"}
    assert not alone.tested
    farther = EarlierImage(rendered.previous.image, (poses[0], poses[1]), "first.png")
    frame = free_space(rendered.current.image, found, [again, farther], camera, EPSILON)
    assert {row.against for row in frame.components} == {"first.png"}
    assert {row.verdict for row in frame.components} == {"obstacle", "false_obstacle"}
    assert "degenerate" in frame.note
    assert [link.name for link in frame.links] == ["first.png"]


def test_decided_components_ask_for_no_further_image() -> None:
    rendered = plain_pair()
    found = segment_view(rendered.current.image, rendered.camera, load_params())
    asked: list[int] = []

    def views() -> object:
        for number in range(5):
            asked.append(number)
            yield EarlierImage(rendered.previous.image, None, str(number))

    free_space(rendered.current.image, found, views(), rendered.camera, EPSILON)  # type: ignore[arg-type]
    assert asked == [0]


def begun() -> tuple[Sequence, np.ndarray, Pose]:
    """A sequence that has seen the first of a pair; the second and its pose."""
    rendered = plain_pair()
    before, now = (planar_pose(rendered.camera, *pose) for pose in rendered.poses)
    sequence = Sequence(rendered.camera, load_params())
    sequence.feed(rendered.previous.image, before)
    return sequence, rendered.current.image, now


def test_paint_stays_paint_where_nothing_can_be_told() -> None:
    sequence, current, pose = begun()
    second = sequence.feed(current, pose)
    paint = {row.track for row in second.components if row.verdict == "false_obstacle"}
    assert paint
    # All the images before are as good as gone: only the numbers tell what the components are.
    sequence._earlier = type(sequence._earlier)([sequence._earlier[0]], maxlen=WINDOW)
    third = sequence.feed(current, pose)
    assert not third.tested
    assert {row.track for row in third.components if row.verdict == "false_obstacle"} == paint
    assert {row.against for row in third.components if row.verdict == "false_obstacle"} == {"0"}
    assert np.array_equal(third.mask, second.mask)


def test_what_is_seen_to_stand_up_is_paint_no_more() -> None:
    sequence, current, pose = begun()
    sequence._paint = dict.fromkeys(range(20), "9")
    second = sequence.feed(current, pose)
    standing = [row for row in second.components if row.decided and row.verdict == "obstacle"]
    assert standing
    assert not {row.track for row in standing} & set(sequence._paint)
    assert all(replace(row, verdict="obstacle") == row for row in standing)
