"""Patches, corners, rendering and the structural test on rendered pairs."""

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import naive_camera
import numpy as np
import pytest
from rendered import render_pair as pair
from rendered import segment_view

from ffseg.camera.motion import Pose, planar_parameters, planar_pose, relative_motion
from ffseg.camera.poses import load_poses
from ffseg.errors import CalibrationError, ParameterError, SegmentationError
from ffseg.freespace.motion.candidates import SegmentedImage, ground_candidates
from ffseg.freespace.motion.egomotion import PairMotion, pair_motion
from ffseg.freespace.motion.ground import fit_ground, prior_sigmas
from ffseg.freespace.pairs import ImagePair
from ffseg.freespace.sequence import Sequence, free_space
from ffseg.freespace.structural import structural_test
from ffseg.freespace.window import EarlierImage
from ffseg.image.keypoints import (
    Candidates,
    align_patches,
    limited_information,
    patch_scores,
    plane_candidates,
    plane_pixels,
)
from ffseg.image.planes import search_ground_motions
from ffseg.io.masks import encode_mask
from ffseg.native import _core
from ffseg.parameter_files import load_params
from ffseg.rendering import pairs
from ffseg.rendering.raycast import FIRST_BOX, FIRST_WALL
from tests.campaigns.freespace import true_poses
from tests.components import component_of

EPSILON = 0.08


def smooth_image(seed: int, shape: tuple[int, int] = (120, 140)) -> np.ndarray:
    noise = np.random.default_rng(seed).uniform(0, 255, shape)
    return cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 2.5), None, 10, 245, cv2.NORM_MINMAX).astype(np.uint8)


def unit_warps(points: np.ndarray) -> Candidates:
    return Candidates(points[:, None].copy(), np.tile([1.0, 0.0, 0.0, 1.0], (len(points), 1, 1)))


def test_patch_scores_agree_with_their_twin() -> None:
    random = np.random.default_rng(1)
    current, previous = smooth_image(1), smooth_image(2)
    points = random.uniform(20, 100, (12, 2))
    places = random.uniform(20, 100, (12, 5, 2))
    warps = np.array([1.0, 0, 0, 1]) + random.uniform(-0.3, 0.3, (12, 5, 4))
    scores = patch_scores(current, previous, points, Candidates(places, warps), 4)
    for i in range(12):
        reference = naive_camera.patch(current, points[i], [1, 0, 0, 1], 4)
        for j in range(5):
            twin = naive_camera.correlation(reference, naive_camera.patch(previous, places[i, j], warps[i, j], 4))
            assert scores[i, j] == pytest.approx(twin, abs=1e-9)


def test_patches_that_leave_an_image_have_no_score() -> None:
    image = smooth_image(3)
    points = np.array([[2.0, 60.0], [60.0, 60.0], [60.0, 60.0]])
    places = np.array([[60.0, 60.0], [137.0, 60.0], [np.nan, np.inf]])[:, None]
    scores = patch_scores(image, image, points, Candidates(places, unit_warps(points).warps), 4)
    assert np.isnan(scores).all()
    assert np.isnan(align_patches(image, image, points, Candidates(places, unit_warps(points).warps), 4).score).all()


def test_alignment_finds_a_known_warp_to_a_twentieth_of_a_pixel() -> None:
    current = smooth_image(4)
    warp = np.array([[1.08, -0.1, 3.3], [0.06, 0.95, -2.6]])
    previous = cv2.warpAffine(current, warp, (140, 120), flags=cv2.INTER_CUBIC)
    points = np.random.default_rng(5).uniform(30, 90, (40, 2))
    truth = points @ warp[:, :2].T + warp[:, 2]
    start = Candidates((truth + np.array([1.2, -0.9]))[:, None], np.tile(warp[:, :2].ravel(), (40, 1, 1)))
    brighter = cv2.convertScaleAbs(previous, alpha=0.8, beta=20)
    found = align_patches(current, brighter, points, start, 5)
    error = np.hypot(*(found.pixels - truth).T)
    # The warped image is itself placed in steps of 1/32 px and rounded to 8 bits; on the flattest patch that is 0.2 px.
    assert np.median(error) < 0.05
    assert error.max() < 0.25
    assert found.score.min() > 0.99


def test_alignment_does_not_slide_along_an_edge() -> None:
    image = np.full((80, 80), 60, np.uint8)
    image[:, 40:] = 180
    image = cv2.GaussianBlur(image, (0, 0), 1.0)
    noisy = cv2.add(image, np.random.default_rng(6).integers(0, 4, (80, 80)).astype(np.uint8))
    points = np.array([[39.5, 40.0]])
    start = unit_warps(points)
    start.pixels[0, 0] = [40.7, 44.0]
    found = align_patches(noisy, image, points, start, 4)
    assert found.pixels[0] == pytest.approx([39.5, 44.0], abs=0.1)
    values = np.linalg.eigvalsh(found.information[0])
    assert values[0] < 1e-9 * values[1]


def test_native_borders_refuse_arrays_that_differ() -> None:
    image, two = np.zeros((20, 20), np.uint8), np.zeros((3, 2))
    with pytest.raises(ValueError, match="differ in size"):
        _core.patch_scores(image, image, two, np.zeros((3, 3)), np.zeros((3, 4)), 3, -1.0, np.zeros((3, 1)))
    with pytest.raises(ValueError, match="radius"):
        _core.align_patches(image, image, two, two, np.zeros((3, 4)), 0, 3, np.zeros((3, 7)))
    with pytest.raises(ValueError, match="pixels a side"):
        _core.align_patches(np.zeros((1, 9), np.uint8), image, two, two, np.zeros((3, 4)), 3, 3, np.zeros((3, 7)))


def test_hopeless_candidates_keep_the_score_of_every_second_sample() -> None:
    random = np.random.default_rng(7)
    current, previous = smooth_image(8), smooth_image(9)
    points = random.uniform(20, 100, (30, 2))
    candidates = Candidates(random.uniform(20, 100, (30, 6, 2)), np.tile([1.0, 0, 0, 1], (30, 6, 1)))
    every, some = (patch_scores(current, previous, points, candidates, 4, floor) for floor in (-1.0, 0.2))
    for i, j in np.ndindex(30, 6):
        a = naive_camera.patch(current, points[i], [1, 0, 0, 1], 4).reshape(9, 9)[::2, ::2].ravel()
        b = naive_camera.patch(previous, candidates.pixels[i, j], [1, 0, 0, 1], 4).reshape(9, 9)[::2, ::2].ravel()
        sparse = naive_camera.correlation(a, b)
        assert some[i, j] == pytest.approx(sparse if sparse < 0.2 else every[i, j], abs=1e-9)
    assert 0.2 < np.mean(some == every) < 0.8  # both kinds occur


def test_information_is_limited_as_if_noise_were_added() -> None:
    root = np.random.default_rng(10).normal(0, 3, (50, 2, 2))
    information = root @ np.swapaxes(root, 1, 2)
    expected = np.linalg.inv(np.linalg.inv(information) + 0.2**2 * np.eye(2))
    assert limited_information(information, 0.2) == pytest.approx(expected, rel=1e-6, abs=1e-9)
    edge = np.array([[[4.0, 0.0], [0.0, 0.0]], [[np.nan] * 2] * 2])  # known across an edge only; not known
    assert limited_information(edge, 0.5) == pytest.approx(
        np.array([[[2.0, 0.0], [0.0, 0.0]], np.zeros((2, 2))]), abs=1e-15
    )


def test_plane_candidates_follow_points_of_that_altitude() -> None:
    rendered = pair(1)
    motion = relative_motion(*true_poses(rendered))
    pixels = np.array([[500.0, 330.0], [300.0, 200.0]])
    altitudes = np.array([0.0, 0.3])
    found = plane_candidates(rendered.camera, motion, pixels, altitudes)
    np.testing.assert_array_equal(plane_pixels(rendered.camera, motion, pixels, altitudes), found.pixels)
    for j, altitude in enumerate(altitudes):
        points = rendered.camera.meet_plane(rendered.camera.lift(pixels), altitude)
        assert found.pixels[:, j] == pytest.approx(rendered.camera.project(motion.apply(points)), abs=1e-9)
        if j:
            continue  # neighbouring altitudes share the warp of the lowest
        step = rendered.camera.meet_plane(rendered.camera.lift(pixels + np.array([1.0, 0.0])), altitude)
        moved = rendered.camera.project(motion.apply(step))
        assert found.warps[:, j, [0, 2]] == pytest.approx(moved - found.pixels[:, j], abs=1e-9)


def test_rendering_is_the_same_every_time_and_its_truth_is_connected() -> None:
    first, second = pair(3), pairs.render_pair(3)
    assert np.array_equal(first.current.image, second.current.image)
    assert np.array_equal(first.previous.image, second.previous.image)
    twin = naive_camera.free_ground(first.current.labels, first.camera.center, first.camera.robot_radius)
    assert np.array_equal(first.current.truth, twin)
    assert not np.array_equal(first.current.image, pair(1).current.image)


def test_labels_agree_with_the_scenes_geometry() -> None:
    rendered = pair(1)
    camera, labels = rendered.camera, rendered.current.labels
    _, current = true_poses(rendered)
    assert (labels[~camera.domain()] == -1).all()
    for index, mark in enumerate(rendered.scene.marks):
        middle = np.append(mark.outline.mean(axis=0), 0.0) - current.position
        x, y = camera.project((current.rotation.T @ middle + [0, 0, camera.mounting()])[None])[0]
        assert labels[round(y), round(x)] == 1 + index
    for index, box in enumerate(rendered.scene.boxes):
        middle = np.append(box.center, 0.0) - current.position
        top = current.rotation.T @ middle + [0, 0, camera.mounting() - box.height]
        x, y = camera.project(top[None])[0]
        assert labels[round(y), round(x)] == FIRST_BOX + index


@pytest.mark.parametrize("seed", [3, 4])
def test_marks_are_paint_and_boxes_are_not(seed: int) -> None:
    rendered = pair(seed)
    labels = [int(label) for label in np.unique(rendered.current.labels) if 1 <= label < FIRST_WALL]
    components = [component_of(i, rendered.current.labels == label) for i, label in enumerate(labels)]
    motion = relative_motion(*true_poses(rendered))
    rows = structural_test(
        ImagePair(rendered.current.image, rendered.previous.image, rendered.camera, motion), components, EPSILON
    )
    for label, row in zip(labels, rows, strict=True):
        assert row.verdict == ("obstacle" if label >= FIRST_BOX else "false_obstacle"), (label, row)
        if label >= FIRST_BOX and row.max_altitude_m > EPSILON:
            # Corners lie below the top, or on it; 0.03 m is three standard deviations of the worst of them.
            assert row.max_altitude_m < rendered.scene.boxes[label - FIRST_BOX].height + 0.03


def test_ground_motion_from_nothing_is_the_true_one() -> None:
    rendered = pair(3)
    free = rendered.current.truth & (rendered.current.labels <= 0)
    images = rendered.current.image, rendered.previous.image
    rough = next(search_ground_motions(rendered.camera, *images, free))
    evidence = ground_candidates(rendered.camera, images[0], SegmentedImage(free))
    looks = ("half", "full", "full")
    found = fit_ground(rendered.camera, rough, prior_sigmas(0.1, 0.04), images, evidence, looks).motion
    true = planar_parameters(rendered.camera, relative_motion(*true_poses(rendered)))
    error = planar_parameters(rendered.camera, found) - true
    # Five of its own standard deviations: it says what it does not know.
    assert np.abs(error[:2]).max() < 5 * found.translation_sigma
    assert abs(error[2]) < 5 * found.rotation_sigma
    assert found.inliers > 60


def motion_of(previous: np.ndarray, current: np.ndarray, poses: tuple[Pose, Pose] | None) -> PairMotion:
    """What is found on the free ground of the third pair, given other images or other poses."""
    rendered = pair(3)
    free = rendered.current.truth & (rendered.current.labels <= 0)
    return pair_motion(rendered.camera, (previous, current), poses, SegmentedImage(free), EPSILON)


@pytest.mark.parametrize("scale", [1.5, 10.0])
def test_poses_that_the_ground_contradicts_are_not_believed(scale: float) -> None:
    previous, current = true_poses(pair(3))
    wrong = Pose(previous.rotation, scale * previous.position)
    found = motion_of(pair(3).previous.image, pair(3).current.image, (wrong, current))
    assert found.motion is None
    assert "poses" in found.note


def test_bare_ground_leaves_the_poses_as_they_are() -> None:
    flat = np.full_like(pair(3).current.image, 120)
    found = motion_of(flat, flat, true_poses(pair(3)))
    assert found.motion.origin == "poses"
    assert motion_of(flat, flat, None).motion is None


@pytest.mark.parametrize("posed", [True, False])
def test_a_pair_without_baseline_is_degenerate(posed: bool) -> None:
    still = true_poses(pair(3))[1]
    found = motion_of(*[pair(3).current.image] * 2, (still, still) if posed else None)
    assert found.motion is None
    assert "degenerate" in found.note


def test_sequence_gives_what_the_pure_steps_give() -> None:
    rendered = pair(1)
    params = load_params()
    sequence = Sequence(rendered.camera, params)
    poses = true_poses(rendered)
    buffer, place = rendered.previous.image.copy(), poses[0].position.copy()
    first = sequence.feed(buffer, replace(poses[0], position=place))
    buffer[:], place[:] = rendered.current.image, 0.0  # as a camera that writes the next image to the same place
    assert {row.verdict for row in first.components} == {"untested"}
    assert "first image" in first.note
    second = sequence.feed(rendered.current.image, poses[1])
    found = segment_view(rendered.current.image, rendered.camera, params)
    before = [EarlierImage(rendered.previous.image, poses)]
    pure = free_space(rendered.current.image, found, before, rendered.camera, EPSILON)
    assert np.array_equal(second.mask, pure.mask)
    assert all(row.track >= 0 and row.against == "0" for row in second.components)
    assert tuple(replace(row, track=-1, against="") for row in second.components) == pure.components
    assert len(second.contours) + len(second.merged_contours) == len(found.contours)
    assert (second.mask >= found.mask).all()


def test_an_image_of_another_size_is_refused_by_both_sizes() -> None:
    sequence = Sequence(pair(1).camera, load_params())
    with pytest.raises(CalibrationError, match="640x480, the camera file says 800x600"):
        sequence.feed(np.zeros((480, 640), np.uint8))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"up": np.array([0.0, 0.0, 1.0])}, "no pixel of the image shows ground: correct 'up'"),
        ({"center": (4200.0, 288.7)}, r"centre at \(4200, 288.7\), outside the image of 800 x 600 pixels"),
        ({"robot_radius": 1000.0, "rim_radius": None}, "radius 1000, covers the whole image: correct 'robot_radius'"),
    ],
)
def test_a_camera_that_shows_no_ground_is_told_by_its_file(wrong: dict[str, Any], told: str) -> None:
    with pytest.raises(CalibrationError, match=told):
        Sequence(replace(pair(1).camera, **wrong)).feed(pair(1).current.image)


def test_unrelated_grounds_have_no_motion() -> None:
    first, second = pair(1), pair(3)
    images = (second.previous.image, first.current.image)
    found = pair_motion(first.camera, images, None, SegmentedImage(first.current.truth), EPSILON)
    assert found.motion is None
    assert "no motion" in found.note


def test_a_sequence_keeps_to_the_masks_that_parameters_name(tmp_path: Path) -> None:
    """They were passed over without a word."""
    camera, image = pair(1).camera, pair(1).previous.image
    right = np.zeros(image.shape[:2], np.bool_)
    right[:, image.shape[1] // 2 :] = True
    (tmp_path / "right.png").write_bytes(encode_mask(right))
    found = Sequence(camera, {"domain.mask": str(tmp_path / "right.png")}).feed(image).mask
    reach = image.shape[1] // 2 - 60  # the start round the robot stays what it is
    assert Sequence(camera).feed(image).mask[:, :reach].any()
    assert found.any()
    assert not found[:, :reach].any()
    with pytest.raises(ParameterError, match=r"domain\.masks finds masks by the names of files"):
        Sequence(camera, {"domain.masks": str(tmp_path)})


def test_a_sequence_takes_what_segment_takes_and_says_what_it_cannot(tmp_path: Path) -> None:
    """A preset's name was kept for a parameter set, and failed at the first image."""
    rendered = pair(1)
    camera, image = rendered.camera, rendered.previous.image
    plain = Sequence(camera, load_params("omni-indoor")).feed(image)
    assert np.array_equal(Sequence(camera, "omni-indoor").feed(image).mask, plain.mask)
    colour = np.dstack([image, image // 2, 255 - image]) if image.ndim == 2 else image
    blue = Sequence(camera, "omni-indoor").feed(colour)
    assert np.array_equal(Sequence(camera, "omni-indoor", rgb=True).feed(colour[..., ::-1] / 255).mask, blue.mask)
    assert Sequence(camera, {"contour.max_iterations": 3}).feed(image).segmentation.stats.iterations == 3
    sequence = Sequence(camera)
    for wrong, said in (("0001.png", "the image is a file name"), (image / 2, "must be uint8"), (None, "is None")):
        with pytest.raises(SegmentationError, match=said):
            sequence.feed(wrong)  # type: ignore[arg-type]
    with pytest.raises(CalibrationError, match=r"the pose is of type tuple; give what ffseg\.planar_pose returns"):
        sequence.feed(image, (0.0, 0.0, 0.0))  # type: ignore[arg-type]
    assert sequence.feed(image).note.startswith("first image")  # none of these counted
    for call in (Sequence, partial(planar_pose, x=0, y=0, theta=0), partial(load_poses, tmp_path, [])):
        with pytest.raises(CalibrationError, match=r"the camera is of type str; give what ffseg\.load_camera returns"):
            call(camera="camera.yaml")
    with pytest.raises(CalibrationError, match="theta is nan; give a finite number"):
        planar_pose(camera, 0, 0, np.nan)
    with pytest.raises(ParameterError, match="did you mean 'omni-indoor'"):
        Sequence(camera, "omni-indor")


def test_a_frame_is_told_in_a_line() -> None:
    rendered = pair(1)
    frame = Sequence(rendered.camera).feed(rendered.previous.image)
    assert re.fullmatch(r"<Frame: \d+ px free; components: \d untested; first image: .*>", repr(frame))
