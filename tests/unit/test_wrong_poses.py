"""Poses in wrong units, signs or order, and poses that say how good they are."""

from pathlib import Path

import numpy as np
import pytest
from rendered import floor_pair

from ffseg.camera import load_poses
from ffseg.errors import CalibrationError
from ffseg.freespace.motion.contradictions import LONGEST, TALLEST, unlikely_units
from ffseg.freespace.motion.egomotion import given_motion, pair_motion
from ffseg.freespace.motion.evidence import Scenery
from ffseg.rendering import RenderedPair, sample_camera
from tests.campaigns.freespace import true_poses
from tests.campaigns.wrong_poses import HEIGHTS, KINDS, judged, matters, wrong


def pair(texture: float) -> RenderedPair:
    return floor_pair(700_003, "plain", texture, 1.0)


@pytest.mark.parametrize("texture", [0.0, 3.0])
@pytest.mark.parametrize("kind", KINDS)
def test_wrong_poses_are_named_and_nothing_is_judged(kind: str, texture: float) -> None:
    rendered = pair(texture)
    assert matters(rendered, kind)
    frame = judged(rendered, kind)
    assert frame.note.startswith("no motion: ")
    assert KINDS[kind][1] in frame.note
    assert {row.verdict for row in frame.components} == {"untested"}
    assert frame.contradicted
    assert not frame.tested


def test_right_poses_are_not_accused() -> None:
    rendered = pair(0.0)
    free = rendered.current.truth & (rendered.current.labels <= 0)
    images = rendered.previous.image, rendered.current.image
    found = pair_motion(rendered.camera, images, true_poses(rendered), Scenery(free), 0.08)
    assert found.motion is not None
    assert not found.contradicted


def test_units_are_doubted_beyond_what_robots_do() -> None:
    rendered = pair(0.0)
    for kind in HEIGHTS:
        assert "mount_height" in unlikely_units(*wrong(rendered, kind))
    assert unlikely_units(rendered.camera, true_poses(rendered)) == ""
    assert "millimetres" in unlikely_units(*wrong(rendered, "x and y in millimetres"))
    assert rendered.camera.mounting() < TALLEST < 90.0 < 100.0 * LONGEST


def test_stated_deviations_are_taken_and_others_assumed(tmp_path: Path) -> None:
    camera = sample_camera()
    path = tmp_path / "poses.csv"
    path.write_text("image,x,y,theta,sigma_xy,sigma_theta\na,0,0,0,0.003,0.01\nb,0.3,0,0.1,0.004,0.0\n")
    with pytest.raises(CalibrationError, match="poses.csv:3: sigma_xy and sigma_theta must be above 0"):
        load_poses(path, ["a", "b"], camera)
    path.write_text("image,x,y,theta,sigma_xy,sigma_theta\na,0,0,0,0.003,0.03\nb,0.3,0,0.1,0.004,0.04\n")
    poses = load_poses(path, ["a", "b"], camera)
    motion = given_motion((poses["a"], poses["b"]))
    assert (motion.translation_sigma, motion.rotation_sigma) == pytest.approx((0.005, 0.05))
    path.write_text("image,x,y,theta\na,0,0,0\nb,0.3,0,0.1\n")
    poses = load_poses(path, ["a", "b"], camera)
    motion = given_motion((poses["a"], poses["b"]))
    assert (motion.translation_sigma, motion.rotation_sigma) == pytest.approx((0.006, np.deg2rad(0.5)))
