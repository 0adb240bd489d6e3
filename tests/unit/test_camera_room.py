"""Two real frames of a camera under a mirror: altitudes against reference points, floor against desks."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from rendered import segment_view

from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion, Pose, planar_parameters, planar_pose, relative_motion
from ffseg.camera.projections import Affine, UnifiedSphere
from ffseg.freespace.sequence import Frame, free_space
from ffseg.freespace.window import EarlierImage
from ffseg.image.keypoints import Candidates, align_patches, patch_scores, plane_candidates
from ffseg.parameter_files import load_params
from tests.triangulation import triangulate

MOUNT, FLOOR_DEPTH = 1.88, 1.85
"""Metres: the height that is taken for the camera's, and the median of the reference's floor points, its labels being
centimetres. What the ground tells of a step is in proportion to the height."""
FLOOR, DESKS = (180.0, 205.0), (110.0, 160.0)


class Room:
    """Both frames at full size, the camera, the motion from the second to the first and the reference."""

    def __init__(self, folder: Path) -> None:
        data = json.loads((folder / "motion.json").read_text())
        k, pair = data["K"], data["pairs"][0]
        lens = UnifiedSphere(Affine(k[0][0], k[1][1], k[0][2], k[1][2]), data["xi"], (0, 0, 0, 0))
        self.camera = Camera(lens, 1600, 1200, (k[0][2], k[1][2]), MOUNT, robot_radius=76.0, rim_radius=492.0)
        self.motion = Motion(np.array(pair["R"]), 0.3 * np.array(pair["t_direction"]), "poses", 0, 0.0, 0.0)
        self.images = [cv2.imread(str(folder / f"{pair[name]}.png"), cv2.IMREAD_GRAYSCALE) for name in "ab"]
        self.reference = np.loadtxt(folder / "reference_points.csv", delimiter=",", skiprows=1)

    def halved(self) -> tuple[Camera, list[NDArray[np.uint8]]]:
        k = self.camera.projection.affine  # type: ignore[attr-defined]
        center = ((k.cx + 0.5) / 2 - 0.5, (k.cy + 0.5) / 2 - 0.5)
        lens = UnifiedSphere(Affine(k.fx / 2, k.fy / 2, *center), self.camera.projection.xi, (0, 0, 0, 0))  # type: ignore[attr-defined]
        images = [cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for image in self.images]
        return Camera(lens, 800, 600, center, MOUNT, robot_radius=38.0, rim_radius=246.0), images


@pytest.fixture
def room(data_folder: Path) -> Room:
    return Room(data_folder / "omni_room")


def test_triangulation_agrees_with_the_reference(room: Room) -> None:
    found, _ = triangulate(room.camera, room.motion, room.reference[:, :2], room.reference[:, 2:4])
    error = np.abs(found[:, 2] * 100 - room.reference[:, 6])
    # Both triangulate the same pixels; what differs is the rule for rays that miss each other.
    assert np.median(error) < 0.2
    assert np.percentile(error, 95) < 1.0


def test_own_matches_separate_floor_and_desks(room: Room) -> None:
    points = room.reference[:, :2].copy()
    candidates = plane_candidates(room.camera, room.motion, points, np.linspace(-0.3, 1.6, 110))
    scores = np.nan_to_num(patch_scores(*room.images, points, candidates, 6), nan=-1.0)
    rows, best = np.arange(len(points)), scores.argmax(axis=1)
    start = Candidates(candidates.pixels[rows, best][:, None], candidates.warps[rows, best][:, None])
    aligned = align_patches(*room.images, points, start, 6)
    found, missed = triangulate(room.camera, room.motion, points, aligned.pixels)
    good = (aligned.score > 0.85) & (missed < 2.0)
    depth, reference = found[:, 2] * 100, room.reference[:, 6]
    medians = {}
    for name, (low, high), most in (("floor", FLOOR, 6.0), ("desks", DESKS, 4.0)):
        own = good & (reference > low) & (reference < high)
        assert own.sum() >= 10
        medians[name] = np.median(depth[own])
        # The reference itself spreads by 5 cm over one floor.
        assert np.median(np.abs(depth[own] - reference[own])) < most
    assert medians["floor"] - medians["desks"] > 45


def freed(room: Room, poses: tuple[Pose, Pose]) -> Frame:
    """Free space of the first frame at half its size, by what the other one shows from these poses."""
    camera, images = room.halved()
    params = load_params("omni-indoor")
    found = segment_view(images[0], camera, params)
    return free_space(images[0], found, [EarlierImage(images[1], poses)], camera, params.obstacles.altitude)


def test_the_floor_is_free_and_desks_are_not_merged(room: Room) -> None:
    back = room.motion.rotation.T
    frame = freed(room, (Pose(back, -back @ room.motion.translation), Pose(np.eye(3), np.zeros(3))))
    pixels = np.rint((room.reference[:, :2] + 0.5) / 2 - 0.5).astype(int)
    free = frame.mask[pixels[:, 1], pixels[:, 0]]
    depth = room.reference[:, 6]
    assert frame.mask.sum() > 15_000
    assert free[(depth > DESKS[0]) & (depth < DESKS[1])].mean() < 0.05
    assert not free[depth < 60].any()
    for x, y in ((760, 410), (640, 420)):  # seeds on the floor, full size
        assert frame.mask[y // 2, x // 2]


def planar_poses(room: Room) -> tuple[Pose, Pose]:
    """What a poses file can say of the motion: its part on the ground, the current image at the origin."""
    x, y, turn = planar_parameters(room.camera, room.motion).tolist()
    back = -np.exp(-1j * turn) * (x + 1j * y)
    return planar_pose(room.camera, back.real, back.imag, -turn), planar_pose(room.camera, 0.0, 0.0, 0.0)


def test_the_ground_says_how_the_robot_nodded(room: Room) -> None:
    poses = planar_poses(room)
    frame = freed(room, poses)
    assert frame.motion.inliers > 60
    missed = frame.motion.rotation.T @ room.motion.rotation
    planar = relative_motion(*poses).rotation.T @ room.motion.rotation
    angle = np.rad2deg(np.arccos(0.5 * (np.trace(missed) - 1.0)))
    # The reference turns by 0.78 degrees about level axes, which no planar pose can say; it is itself good to some 0.2.
    assert np.rad2deg(np.arccos(0.5 * (np.trace(planar) - 1.0))) > 0.7
    assert angle < 0.4
    assert frame.motion.baseline == pytest.approx(0.3 * MOUNT / FLOOR_DEPTH, abs=0.02)
    assert "false_obstacle" not in {row.verdict for row in frame.components}


def test_a_reversed_step_is_named(room: Room) -> None:
    frame = freed(room, planar_poses(room)[::-1])
    assert "the poses of the two images are swapped" in frame.note
    assert {row.verdict for row in frame.components} == {"untested"}
