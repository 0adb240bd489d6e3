"""Free space that has climbed a wall is cut where the pair contradicts the ground, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

import ffseg
from ffseg.camera.motion import planar_pose, relative_motion
from ffseg.freespace import sequence
from ffseg.freespace.sequence import Frame
from ffseg.image.leaks import leaking_pixels
from ffseg.rendering.raycast import FIRST_WALL, Rendering, render
from ffseg.rendering.scene import Floor, Room, World
from ffseg.samples.drive import drive_camera, drive_scene
from tests.discs import overlap

POSES = ((0.25, 0.95, 0.3), (0.0, 1.05, 0.3))
CUT = "moved as nothing on the ground does"


def seen(scene: World, footprint: float, posed: bool = True) -> tuple[Frame, Rendering]:
    """The second frame of a pair, and what is true of it."""
    camera = replace(drive_camera(), footprint=footprint)
    drive = ffseg.Sequence(camera)
    for number, pose in enumerate(POSES):
        view = render(scene, camera, pose, number, subsamples=2)
        frame = drive.feed(view.image, planar_pose(camera, *pose) if posed else None)
    return frame, view


def walls_of_the_floors_grey() -> World:
    scene = drive_scene()
    return replace(scene, boxes=scene.boxes[:1], room=Room((2.4, 2.2), 0.2, scene.ground_grey, shading=(45.0, 2.0)))


@pytest.mark.parametrize("posed", [True, False])
def test_what_climbed_a_wall_is_cut_and_said(posed: bool) -> None:
    scene = walls_of_the_floors_grey()
    plain, view = seen(scene, 0.0, posed)
    climbed = plain.mask & (view.labels >= FIRST_WALL)
    assert climbed.sum() > 0.05 * view.truth.sum(), "the scene is one in which the contour climbs"
    frame, _ = seen(scene, 0.15, posed)
    assert (frame.mask & climbed).sum() < 0.03 * climbed.sum()
    assert overlap(frame.mask, view.truth) > overlap(plain.mask, view.truth) + 0.4 > 0.8
    assert CUT in frame.note
    assert CUT not in plain.note


@pytest.mark.parametrize(("share", "wave"), [(0.4, 18.0), (1.0, 5.0)])
def test_light_that_moves_with_the_camera_is_no_wall(share: float, wave: float) -> None:
    """Broad reflections on a part of the floor, which nothing that stands up explains; narrow ones on all of it, which
    something might, but then not even the ground round the robot is what it was."""
    camera = drive_camera()
    row, column = np.mgrid[:240, :320]
    shine = 40.0 * np.sin(column / wave) * np.sin(row / wave) * (column < 320 * share)
    views = [render(drive_scene(), camera, pose, number, subsamples=2) for number, pose in enumerate(POSES)]
    previous, current = (np.clip(view.image + shine, 0, 255).astype(np.uint8) for view in views)
    motion = relative_motion(*(planar_pose(camera, *pose) for pose in POSES))
    assert not leaking_pixels(camera, motion, current, previous, views[1].truth).any()


def test_poses_that_the_ground_does_not_confirm_cut_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    silent = sequence.free_space
    monkeypatch.setattr(sequence, "free_space", lambda *given, **more: replace(silent(*given, **more), fit=None))
    frame, _ = seen(walls_of_the_floors_grey(), 0.15)
    assert frame.motion is not None
    assert CUT not in frame.note


@pytest.mark.parametrize(
    "floor", [Floor(3.0, 2.0), Floor(1.0, 1.0, light=(0.5, 1.2)), Floor(1.0, 1.0, streak=(0.4, 0.5, 1.0, 0.1, 70.0))]
)
def test_ground_that_a_box_a_shadow_or_a_reflection_hid_before_is_not_cut(floor: Floor) -> None:
    frame, view = seen(replace(drive_scene(), floor=floor), 0.05)
    assert overlap(frame.mask, view.truth) > 0.9
    assert frame.motion is not None
    assert CUT not in frame.note
