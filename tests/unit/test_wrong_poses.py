"""Poses in wrong units, signs or order, and poses that say how good they are."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rendered import floor_pair, segment_view

from ffseg.camera.model import Camera
from ffseg.camera.motion import Pose, planar_pose
from ffseg.camera.poses import load_poses
from ffseg.errors import CalibrationError
from ffseg.freespace.motion.candidates import SegmentedImage
from ffseg.freespace.motion.contradictions import MAX_HEIGHT, MAX_STEP, unlikely_units
from ffseg.freespace.motion.egomotion import pair_motion, stated_motion
from ffseg.freespace.sequence import free_space
from ffseg.freespace.window import EarlierImage, window_motion
from ffseg.parameter_files import load_params
from ffseg.rendering.pairs import RenderedPair, sample_camera
from tests.campaigns.freespace import true_poses

Planar = tuple[float, float, float]
KINDS: dict[str, tuple[Callable[[Planar], Planar], str]] = {
    "theta in degrees": (lambda p: (p[0], p[1], float(np.rad2deg(p[2]))), "theta looks like degrees"),
    "x and y in millimetres": (lambda p: (p[0] * 1e3, p[1] * 1e3, p[2]), "look like millimetres"),
    "x and y in centimetres": (lambda p: (p[0] * 1e2, p[1] * 1e2, p[2]), "look like centimetres"),
    "sign of theta": (lambda p: (p[0], p[1], -p[2]), "theta has the other sign"),
    "sign of y": (lambda p: (p[0], -p[1], p[2]), "y has the other sign"),
    "x and y exchanged": (lambda p: (p[1], p[0], p[2]), "x and y are exchanged"),
    "seen without the mirror": (lambda p: (p[0], -p[1], -p[2]), "y and theta have the other sign"),
    "poses swapped": (lambda p: p, "are swapped"),
    "mount height in millimetres": (lambda p: p, "mount_height 900 m looks like millimetres"),
    "mount height in centimetres": (lambda p: p, "mount_height 90 m looks like centimetres"),
}
"""What is done to each pose, and what is to be said."""
HEIGHTS = {"mount height in millimetres": 1e3, "mount height in centimetres": 1e2}


def wrong(pair: RenderedPair, kind: str) -> tuple[Camera, tuple[Pose, Pose]]:
    """Camera and poses of a pair with one thing wrong."""
    change, _ = KINDS[kind]
    previous, current = (planar_pose(pair.camera, *change(pose)) for pose in pair.poses)
    camera = replace(pair.camera, mount_height=pair.camera.mounting() * HEIGHTS.get(kind, 1.0))
    return camera, (current, previous) if kind == "poses swapped" else (previous, current)


def pair(texture: float) -> RenderedPair:
    return floor_pair(700_003, "plain", texture, 1.0)


@pytest.mark.parametrize("texture", [0.0, 3.0])
@pytest.mark.parametrize("kind", KINDS)
def test_wrong_poses_are_named_and_nothing_is_judged(kind: str, texture: float) -> None:
    rendered, params = pair(texture), load_params()
    camera, poses = wrong(rendered, kind)
    found = segment_view(rendered.current.image, camera, params)
    before = EarlierImage(rendered.previous.image, poses)
    frame = free_space(rendered.current.image, found, [before], camera, params.obstacles.altitude)
    assert frame.note.startswith("no motion: ")
    assert KINDS[kind][1] in frame.note
    assert {row.verdict for row in frame.components} == {"untested"}
    assert frame.contradicted
    assert not frame.tested


def test_a_wrong_pose_of_an_image_that_encloses_nothing_is_known_to_be() -> None:
    rendered, params = pair(3.0), load_params()
    camera, poses = wrong(rendered, "theta in degrees")
    free = SegmentedImage(segment_view(rendered.current.image, camera, params).mask)
    before = EarlierImage(rendered.previous.image, poses)
    found = window_motion(rendered.current.image, free, [before], camera, params.obstacles.altitude)
    assert (found.pair.contradicted, found.pair.motion, found.links) == (True, None, ())


def test_right_poses_are_not_accused() -> None:
    rendered = pair(0.0)
    free = rendered.current.truth & (rendered.current.labels <= 0)
    images = rendered.previous.image, rendered.current.image
    found = pair_motion(rendered.camera, images, true_poses(rendered), SegmentedImage(free), 0.08)
    assert found.motion is not None
    assert not found.contradicted


def test_units_are_doubted_beyond_what_robots_do() -> None:
    rendered = pair(0.0)
    for kind in HEIGHTS:
        assert "mount_height" in unlikely_units(*wrong(rendered, kind))
    assert unlikely_units(rendered.camera, true_poses(rendered)) == ""
    assert "millimetres" in unlikely_units(*wrong(rendered, "x and y in millimetres"))
    assert rendered.camera.mounting() < MAX_HEIGHT < 90.0 < 100.0 * MAX_STEP


def test_stated_deviations_are_taken_and_others_assumed(tmp_path: Path) -> None:
    camera = sample_camera()
    path = tmp_path / "poses.csv"
    path.write_text("image,x,y,theta,sigma_xy,sigma_theta\na,0,0,0,0.003,0.01\nb,0.3,0,0.1,0.004,0.0\n")
    with pytest.raises(CalibrationError, match="poses.csv:3: sigma_xy and sigma_theta must be above 0"):
        load_poses(path, ["a", "b"], camera)
    stated = "image,x,y,theta,sigma_xy,sigma_theta\na,0,0,0,0.003,0.03\nb,0.3,0,0.1,0.004,0.04\n"
    assumed = "image,x,y,theta\na,0,0,0\nb,0.3,0,0.1\n"
    for text, sigmas in ((stated, (0.005, 0.05)), (assumed, (0.006, np.deg2rad(0.5)))):
        path.write_text(text)
        poses = load_poses(path, ["a", "b"], camera)
        motion = stated_motion((poses["a"], poses["b"]))
        assert (motion.translation_sigma, motion.rotation_sigma) == pytest.approx(sigmas)
