"""The rules of the structural test at their edges: votes, two standard deviations, shares, the window's pose."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rendered import plain_pair, segment_view

from ffseg.camera.motion import Motion, planar_parameters, planar_pose, relative_motion
from ffseg.freespace import corners, outlines, structural
from ffseg.freespace.corners import Matches
from ffseg.freespace.motion.candidates import SegmentedImage, ground_candidates, outer_joints
from ffseg.freespace.motion.ground import fit_ground, prior_sigmas
from ffseg.freespace.motion.tracking import NOISE_SLOPES, placement_information
from ffseg.freespace.pairs import ImagePair
from ffseg.freespace.sequence import Sequence
from ffseg.freespace.structural import structural_test
from ffseg.image.components import Component, contour_components
from ffseg.image.keypoints import Alignments, Candidates, limited_information
from ffseg.parameter_files import load_params
from ffseg.rendering.pairs import sample_camera

EPSILON = 0.08


def matches(altitudes: list[float], sigmas: list[float]) -> Matches:
    owner, places = np.zeros_like(altitudes, np.intp), np.zeros((len(altitudes), 2))
    return Matches(owner, places, places, np.array(altitudes), np.array(sigmas), np.ones_like(owner, np.bool_))


def verdict(
    monkeypatch: pytest.MonkeyPatch, low: int, high: int, flat: int, raised: int, area: int = 400
) -> tuple[str, bool]:
    """Verdict on one component with so many corners and samples, and whether that decides it."""
    found = matches([0.0] * low + [0.3] * high, [0.005] * (low + high))
    monkeypatch.setattr(structural, "match_corners", lambda *_: found)
    monkeypatch.setattr(structural, "outline_votes", lambda *_: (np.array([flat]), np.array([raised])))
    blank = np.zeros((600, 800), np.uint8)
    pair = ImagePair(blank, blank, sample_camera(), Motion(np.eye(3), np.array([0.2, 0.0, 0.0]), "poses", 0, 0.0, 0.0))
    side = round(area**0.5)
    (row,) = structural_test(pair, [Component(0, (500, 300), np.ones((side, side), np.bool_))], EPSILON)
    return row.verdict, row.decided


@pytest.mark.parametrize(
    ("low", "high", "flat", "raised", "expected", "decided"),
    [
        (1, 0, 4, 0, "false_obstacle", True),
        (1, 0, 3, 0, "obstacle", False),  # three samples are too few
        (4, 0, 2, 0, "false_obstacle", True),  # unless corners make up for them
        (3, 0, 2, 0, "obstacle", False),
        (5, 0, 1, 0, "obstacle", False),  # but one sample is too few in any case
        (4, 0, 3, 1, "obstacle", False),  # or where one contradicts
        (4, 0, 2, 1, "obstacle", False),
        (1, 0, 8, 2, "false_obstacle", True),  # a fifth may contradict
        (6, 0, 10, 2, "false_obstacle", True),
        (6, 0, 10, 3, "obstacle", False),
        (1, 0, 7, 2, "obstacle", False),
        (1, 0, 7, 5, "obstacle", True),  # many contradict: something stands there
        (5, 1, 9, 0, "false_obstacle", True),  # one corner in six may be a wrong match
        (4, 1, 9, 0, "obstacle", False),
        (9, 2, 9, 0, "obstacle", True),  # two are none
        (0, 1, 9, 0, "obstacle", False),
        (0, 0, 9, 0, "untested", False),
    ],
)
def test_votes_and_verdicts(
    monkeypatch: pytest.MonkeyPatch, low: int, high: int, flat: int, raised: int, expected: str, decided: bool
) -> None:
    assert verdict(monkeypatch, low, high, flat, raised) == (expected, decided)


def test_small_components_are_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    assert verdict(monkeypatch, 4, 0, 9, 0, area=25) == ("untested", True)
    assert verdict(monkeypatch, 4, 0, 9, 0, area=36) == ("false_obstacle", True)


def test_without_a_motion_nothing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(structural, "shared_doubt", lambda *_: SimpleNamespace(known=np.array([False])))
    monkeypatch.setattr(structural, "motion_uncertainty", lambda *_: SimpleNamespace(of=lambda asked: asked))
    assert verdict(monkeypatch, 6, 0, 10, 0) == ("untested", False)


@pytest.mark.parametrize(
    ("altitude", "sigma", "low", "high"),
    [
        (0.04, 0.0199, 1, 0),
        (0.04, 0.0201, 0, 0),  # two standard deviations reach the threshold
        (0.0799, 0.001, 0, 0),  # below it, and not surely
        (0.08, 0.001, 0, 1),  # at it, as in Eq. 9
        (0.09, 0.05, 0, 1),
    ],
)
def test_corners_speak_beyond_two_standard_deviations(altitude: float, sigma: float, low: int, high: int) -> None:
    votes = structural._corner_votes(matches([altitude], [sigma]), 1, EPSILON)
    assert (votes.low[0], votes.high[0], votes.matched[0]) == (low, high, 1)
    assert votes.highest[0] == altitude


@pytest.mark.parametrize(
    ("altitude", "across", "score", "expected"),
    [
        # A sample is placed to 0.2 px and the threshold moves it by 2 px: one standard deviation is a tenth of it.
        (0.79, 0.0, 0.9, "flat"),
        (0.81, 0.0, 0.9, "silent"),
        (1.19, 0.0, 0.9, "silent"),
        (1.21, 0.0, 0.9, "raised"),
        (-0.79, 0.0, 0.9, "flat"),
        (-1.21, 0.0, 0.9, "raised"),  # a hole is no paint
        (0.0, 0.79, 0.9, "flat"),
        (0.0, 0.81, 0.9, "raised"),  # four standard deviations across the epipolar curve
        (0.0, 0.0, 0.84, "raised"),  # does not look alike
        (0.0, 0.0, np.nan, "silent"),
    ],
)
def test_samples_speak_beyond_two_sigmas(altitude: float, across: float, score: float, expected: str) -> None:
    ground = Candidates(np.array([[[100.0, 50.0], [102.0, 50.0]]]), np.zeros((1, 2, 4)))
    place = np.array([[100.0 + 2.0 * altitude, 50.0 + across]])
    aligned = Alignments(place, np.array([score]), 1e12 * np.eye(2)[None], np.ones(1))
    flat, raised = outlines._judge(aligned, ground, np.zeros((1, 2)), np.zeros((1, 2, 2)))
    said = {(True, False): "flat", (False, True): "raised", (False, False): "silent"}
    assert said[bool(flat[0]), bool(raised[0])] == expected


def test_doubt_about_the_motion_silences_samples_and_what_the_others_say_moves_them() -> None:
    ground = Candidates(np.array([[[100.0, 50.0], [102.0, 50.0]]]), np.zeros((1, 2, 4)))
    aligned = Alignments(np.array([[101.0, 50.0]]), np.ones(1), 1e12 * np.eye(2)[None], np.ones(1))
    nothing, half = np.zeros((1, 2)), np.array([[0.5**2, 0.0], [0.0, 0.0]])[None]
    # Halfway up: 0.2 px and 0.45 px make 0.49 px, so that two standard deviations reach to 0.99 of the threshold.
    for doubt, expected in ((0.45, True), (0.47, False)):
        covariance = half * (doubt / 0.5) ** 2
        assert outlines._judge(aligned, ground, nothing, covariance)[0][0] == expected
    moved = np.array([[-1.5, 0.0]])
    assert outlines._judge(aligned, ground, moved, 0.0 * half)[1][0], "2.5 px above where the others put the ground"


def corner(
    patch: pytest.MonkeyPatch, step: tuple[float, float], *, score: float = 0.95, unique: bool = True, near: float = 1.0
) -> tuple[bool, float]:
    """Whether a corner's match counts, and its altitude; nearness grows by one in 10 px along x, the mount is at 1 m."""
    at = np.array([[100.0, 50.0]])
    start = Candidates(at[:, None], np.array([[[1.0, 0.0, 0.0, 1.0]]]))
    found = SimpleNamespace(pixels=at, owner=np.zeros(1, np.intp))
    swept = start, np.array([[10.0, 0.0]]), np.array([near]), np.array([unique])
    aligned = Alignments(at + [step], np.array([score]), np.array([1e6 * np.eye(2)]), np.ones(1))
    patch.setattr(corners, "harris_points", lambda *_: found)
    patch.setattr(corners, "_sweep", lambda *_: swept)
    patch.setattr(corners, "align_patches", lambda *_: aligned)
    patch.setattr(corners, "propagated", lambda *_: (np.zeros((1, 2)), np.zeros((1, 2, 2))))
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
    monkeypatch.setattr(outlines, "propagated", lambda *_: (None, None))
    monkeypatch.setattr(outlines, "_judge", lambda *_: votes)
    monkeypatch.setattr(outlines, "_contrast", lambda *_: np.array([1000.0, 40.0, 1000.0]))
    pair: Any = SimpleNamespace(current=None, previous=None, camera=None, motion=None, noise=2.0)  # 4 is a tenth of 40
    flat, raised = outlines.outline_votes(pair, [None], EPSILON, None)  # type: ignore[list-item, arg-type]
    assert (flat.tolist(), raised.tolist()) == ([1], [1])


def test_a_sequence_takes_the_pose_of_the_image_before() -> None:
    rendered = plain_pair()
    camera = rendered.camera
    there, here = (planar_pose(camera, *pose) for pose in rendered.poses)
    sequence = Sequence(camera, load_params())
    views = [(rendered.previous, there), (rendered.current, here), (rendered.previous, there)]
    frames = [sequence.feed(view.image, pose) for view, pose in views]
    for frame, (before, now) in zip(frames[1:], ((there, here), (here, there)), strict=True):
        assert frame.motion is not None
        assert frame.motion.origin == "poses, refined on the ground"
        true = planar_parameters(camera, relative_motion(before, now))
        # A millimetre and a tenth of a degree: ten of the deviations that the ground leaves.
        assert planar_parameters(camera, frame.motion) == pytest.approx(true, abs=2e-3)


def test_components_are_judged_without_their_own_points() -> None:
    rendered = plain_pair()
    camera, image = rendered.camera, rendered.current.image
    found = segment_view(image, camera, load_params())
    _, components = contour_components(found.contours, found.mask.shape)
    evidence = ground_candidates(camera, image, SegmentedImage(found.mask, components, outer_joints(found.contours)))
    motion = relative_motion(*(planar_pose(camera, *pose) for pose in rendered.poses))
    images = image, rendered.previous.image
    fit = fit_ground(camera, motion, prior_sigmas(0.01, 0.01), images, evidence, ("full", "full"))
    assert fit is not None
    doubt = fit.without(len(components))
    for place in range(len(components)):
        others = fit.inliers & (fit.tracks.owner != place)
        levers, white = fit.levers[others].reshape(-1, 8), fit.white[others].ravel()
        # All others at once: the least squares that the components' own points never entered.
        normal = levers.T @ levers + fit.hold
        step = np.linalg.solve(normal, levers.T @ white - fit.hold @ fit.offset)
        assert doubt.steps[place] == pytest.approx(step, abs=1e-6)
        scatter = max(1.0, float(white @ white) / (2 * others.sum() - 5))
        assert doubt.covariances[place] == pytest.approx(np.linalg.inv(normal) * scatter, rel=1e-6, abs=1e-15)


def test_placements_keep_what_stands_above_noise() -> None:
    random = np.random.default_rng(3)
    root = random.normal(0, 8, (40, 2, 2))
    information = np.concatenate([root @ np.swapaxes(root, 1, 2), np.zeros((1, 2, 2)), 90.0 * np.eye(2)[None]])
    noise = np.concatenate([random.uniform(0.1, 1.0, 41), [1.0]])
    found = placement_information(Alignments(np.zeros((42, 2)), np.ones(42), information, noise), 6, 0.15)
    values, vectors = np.linalg.eigh(information)
    values = np.maximum(values - (NOISE_SLOPES * 169 * noise)[:, None], 0.0)
    expected = limited_information((vectors * values[:, None]) @ np.swapaxes(vectors, 1, 2), 0.15)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert (found[values[:, 1] == 0.0] == 0.0).all()
    assert (values[:, 1] == 0.0).any()
