"""The motion of a pair: from poses, the ground, or both; or the reason why there is none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from ffseg.arrays import Array, Image
from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion, Origin, Pose, relative_motion
from ffseg.freespace.motion.candidates import GroundCandidates, SegmentedImage, ground_candidates
from ffseg.freespace.motion.contradictions import likely_cause, unlikely_units
from ffseg.freespace.motion.ground import GroundFit, fit_ground, prior_sigmas
from ffseg.freespace.motion.tracking import Look
from ffseg.image.keypoints import plane_pixels
from ffseg.image.planes import CELL, search_ground_motions

POSE_TRANSLATION_SIGMA, POSE_ROTATION_SIGMA = 0.02, np.deg2rad(0.5)
"""Standard deviations of poses that state none, relative to the baseline and in radians: wheel odometry over one step."""
MIN_POSE_SIGMA = 0.001, 1e-4
"""Metres and radians: smallest standard deviations of poses (rounding, time stamps)."""
MAX_SIGMAS = 5.0
"""Standard deviations by which poses and ground may differ before neither is trusted."""
SLACK_METRES = 0.02
"""Metres by which the poses of a standing robot may differ (rounding, time stamps)."""
MIN_PARALLAX = 0.5
"""Pixels of parallax between the ground and the altitude threshold; with less a pair cannot tell paint from a box."""
GOOD_FRACTION = 0.6
"""Fraction of inliers from which no wider search is made."""
SURE_FRACTION, SURE_INLIERS, SURE_ANSWER = 0.6, 20, 0.4
"""Inliers, as a fraction of the well-placed points, in number, and as a fraction of all candidates, from which the
ground overrules poses or replaces them. Rendered pairs of unrelated grounds reach 0.28 of all candidates, matching
ones 0.78 and more."""
SEARCH_SIGMAS = 1.5 * CELL, np.deg2rad(2.0)
"""Metres and radians: standard deviations of a motion found without poses."""
PRESENT: tuple[tuple[Look, ...], ...] = (("full", "full"), ("half", "full", "full"), ("far", "half", "full", "full"))
"""Ways to place the ground points near a prior, in order of cost."""


@dataclass(frozen=True, slots=True, eq=False)
class PairMotion:
    """Motion of a pair, or the reason why there is none.

    Attributes
    ----------
    note : str
        One sentence for the log: where the motion comes from, with its figures, or why there is none.
    camera : Camera or None
        The current camera with its true ``up``, where the ground says that it leans; None without a motion.
    fit : GroundFit or None
        The points the motion was read off; None where only poses speak.
    contradicted : bool
        Whether the poses are wrong: other images with poses of the same file tell no more.
    still : PairMotion or None
        What the pair tells where the camera moved too little to judge by: a map goes on with that.
    """

    motion: Motion | None
    note: str
    camera: Camera | None = None
    fit: GroundFit | None = None
    contradicted: bool = False
    still: PairMotion | None = None


def pair_motion(
    camera: Camera,
    images: tuple[Image, Image],
    poses: tuple[Pose, Pose] | None,
    segmented: SegmentedImage,
    epsilon: float,
    candidates: GroundCandidates | None = None,
) -> PairMotion:
    """Motion between two images.

    Parameters
    ----------
    images : tuple of ndarray
        Previous and current image, grey.
    poses : tuple of Pose or None
        Of the previous and the current image.
    segmented : SegmentedImage
        What was segmented in the current image.
    epsilon : float
        Altitude threshold, metres: what the pair's parallax must resolve.
    candidates : GroundCandidates, optional
        Of the current image, where it was gathered for another pair already.
    """
    pair = images[1], images[0]
    candidates = ground_candidates(camera, pair[0], segmented) if candidates is None else candidates
    found = (
        _with_poses(camera, pair, poses, candidates, segmented)
        if poses
        else _without(camera, pair, candidates, segmented)
    )
    if found.motion is None:
        return found
    if not len(candidates.grid):
        return PairMotion(None, "the free space shows no point of the ground at which altitudes could be told")
    parallax = threshold_parallax(camera, found.motion, candidates.grid, epsilon)
    if parallax < MIN_PARALLAX:
        return PairMotion(
            None,
            f"degenerate pair: a baseline of {found.motion.baseline:.3f} m moves the altitude threshold by "
            f"{parallax:.2f} px only; pair images that lie further apart",
            still=found,
        )
    return found


def threshold_parallax(camera: Camera, motion: Motion, points: Array, epsilon: float) -> float:
    """Median distance in the previous image between ground points and a plane at `epsilon`, pixels."""
    pixels = plane_pixels(camera, motion, points, np.array([0.0, epsilon]))
    distance = np.hypot(*(pixels[:, 1] - pixels[:, 0]).T)
    distance = distance[np.isfinite(distance)]
    return float(np.median(distance)) if len(distance) else 0.0


def stated_motion(poses: tuple[Pose, Pose]) -> Motion:
    """Motion between poses, with the standard deviations that they state, or those of wheel odometry."""
    bare = relative_motion(*poses)
    stated = [pose.sigmas for pose in poses if pose.sigmas is not None]
    if len(stated) < len(poses):
        return _with_odometry(bare, "poses")
    sigma = np.maximum(np.sqrt(np.sum(np.square(stated), axis=0)), MIN_POSE_SIGMA).tolist()
    return Motion(bare.rotation, bare.translation, "poses", 0, *sigma)


def _without(
    camera: Camera, pair: tuple[Image, Image], candidates: GroundCandidates, segmented: SegmentedImage
) -> PairMotion:
    fit = _searched(camera, pair, candidates, segmented)
    if fit is None:
        return PairMotion(None, "no motion: the ground of the two images does not match; give poses with --poses")
    return PairMotion(fit.motion, _sentence(fit.motion), fit.camera, fit)


def _searched(
    camera: Camera, pair: tuple[Image, Image], candidates: GroundCandidates, segmented: SegmentedImage
) -> GroundFit | None:
    """Motion from the ground without poses: the best of the search's candidates, if it is good."""
    best = None
    sigmas = prior_sigmas(*SEARCH_SIGMAS)
    for rough in search_ground_motions(camera, *pair, segmented.free, segmented.components):
        for fit in _fits(camera, rough, sigmas, pair, candidates, PRESENT[1:]):
            if best is None or fit.count > best.count:
                best = fit
        if best is not None and best.share > GOOD_FRACTION:
            break
    return best if best is not None and _sure(best) else None


def _fits(
    camera: Camera, prior: Motion, sigmas: Array, pair: tuple[Image, Image], candidates: GroundCandidates,
    ways: tuple[tuple[Look, ...], ...],
) -> Iterator[GroundFit]:  # fmt: skip
    """Fits near a prior, until one is good."""
    for looks in ways:
        fit = fit_ground(camera, prior, sigmas, pair, candidates, looks)
        if fit is not None:
            yield fit
            if fit.share > GOOD_FRACTION:
                return


def _sure(fit: GroundFit) -> bool:
    return fit.share >= SURE_FRACTION and fit.count >= SURE_INLIERS and fit.answer >= SURE_ANSWER


def _with_poses(
    camera: Camera,
    pair: tuple[Image, Image],
    poses: tuple[Pose, Pose],
    candidates: GroundCandidates,
    segmented: SegmentedImage,
) -> PairMotion:
    """Poses and ground together; poses alone if no ground is seen; nothing if they contradict each other."""
    stated = stated_motion(poses)
    refused = unlikely_units(camera, poses)
    if refused:
        return PairMotion(None, f"no motion: {refused}", contradicted=True)
    sigmas = prior_sigmas(stated.translation_sigma, stated.rotation_sigma)
    prior = Motion(stated.rotation, stated.translation, "poses, refined on the ground", 0, *_planar(stated))
    fits = list(_fits(camera, prior, sigmas, pair, candidates, PRESENT))
    fit = max(fits, key=lambda one: one.count, default=None)
    if fit is not None and _sure(fit) and not _far(fit.offset, sigmas):
        return PairMotion(fit.motion, _sentence(fit.motion), fit.camera, fit)
    agree = fit.count if fit is not None and not _far(fit.offset, sigmas) else 0
    cause = likely_cause(camera, poses, partial(_confirmed, pair, candidates), agree)
    if cause is not None:
        return PairMotion(None, f"no motion: {cause.sentence}", contradicted=True)
    if fit is not None and _sure(fit):
        return PairMotion(None, _differ(fit.motion, stated), contradicted=True)
    found = _searched(camera, pair, candidates, segmented)
    if found is not None and found.count > agree:
        return PairMotion(None, _differ(found.motion, stated), contradicted=True)
    if fit is None or _far(fit.offset, sigmas):
        return PairMotion(stated, f"{_sentence(stated)}; the ground does not answer", camera)
    return PairMotion(fit.motion, _sentence(fit.motion), fit.camera, fit)


def _confirmed(
    pair: tuple[Image, Image], candidates: GroundCandidates, motion: Motion, camera: Camera
) -> tuple[GroundFit, float] | None:
    """The fit that supports another interpretation of the poses, and its correction in standard deviations."""
    tried = _with_odometry(motion, "ground points")
    sigmas = prior_sigmas(*_planar(tried))
    for fit in _fits(camera, tried, sigmas, pair, candidates, PRESENT[1:2]):
        if _sure(fit) and not _far(fit.offset, sigmas):
            return fit, float(np.sqrt(np.sum((fit.offset[:3] / sigmas[:3]) ** 2)))
    return None


def _with_odometry(bare: Motion, origin: Origin) -> Motion:
    """A motion with the standard deviations that wheel odometry has."""
    sigma = max(MIN_POSE_SIGMA[0], POSE_TRANSLATION_SIGMA * bare.baseline), float(POSE_ROTATION_SIGMA)
    return Motion(bare.rotation, bare.translation, origin, 0, *sigma)


def _planar(motion: Motion) -> tuple[float, float]:
    return motion.translation_sigma, motion.rotation_sigma


def _far(offset: Array, sigmas: Array) -> bool:
    """Whether the ground corrects poses by more than their possible error."""
    shift = float(np.hypot(*offset[:2]))
    return shift > SLACK_METRES + MAX_SIGMAS * float(sigmas[0]) or abs(float(offset[2])) > MAX_SIGMAS * float(sigmas[2])


def _differ(found: Motion, stated: Motion) -> str:
    shift = float(np.linalg.norm(found.translation - stated.translation))
    turn = np.rad2deg(_angle(found.rotation.T @ stated.rotation))
    return (
        f"no motion: poses and ground differ by {shift:.3f} m and {turn:.1f} degrees; the ground says a baseline of "
        f"{found.baseline:.3f} m, the poses {stated.baseline:.3f} m; check the order, units and theta of the poses, "
        "and mount_height"
    )


def _angle(rotation: Array) -> float:
    """Angle of a rotation matrix, radians; the sine keeps small angles exact."""
    skew = rotation - rotation.T  # holds each of the three sines twice, doubled
    return float(np.arctan2(np.linalg.norm(skew) / np.sqrt(8.0), 0.5 * (np.trace(rotation) - 1.0)))


def _sentence(motion: Motion) -> str:
    seen = f" from {motion.inliers} ground points" if motion.inliers else ""
    return (
        f"motion by {motion.origin}{seen}: {motion.baseline:.3f} m (+- {motion.translation_sigma:.4f} m, "
        f"+- {np.rad2deg(motion.rotation_sigma):.2f} degrees)"
    )
