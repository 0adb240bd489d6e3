"""Which motion a pair is judged with: poses, the ground, or both; or why there is none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion, Origin, Pose, relative_motion
from ffseg.freespace.ground import ground_grid, refine_on_ground, textured_points
from ffseg.image.keypoints import Array, Grey, Mask, plane_candidates
from ffseg.image.planes import search_ground_motion

POSE_TRANSLATION_SIGMA, POSE_ROTATION_SIGMA = 0.02, np.deg2rad(0.5)
"""Of a pose, relative to the baseline and in radians: wheel odometry over one step."""
SLACK_TRANSLATION, SLACK_ROTATION = 5.0, 5.0
"""Standard deviations by which poses and ground may differ before neither is believed."""
SLACK_METRES = 0.02
"""What the poses of a standing robot may differ by: their own rounding and time stamps."""
LEAST_PARALLAX = 0.5
"""Pixels between the ground and the threshold's altitude; with less a pair cannot tell paint from a box."""
MOST_TEXTURELESS = 20
"""Ground points with texture below which a ground that does not answer proves nothing against the poses."""


@dataclass(frozen=True, slots=True, eq=False)
class PairMotion:
    """The motion of a pair, or why it has none.

    Attributes
    ----------
    motion : Motion or None
    note : str
        One sentence for the log: where the motion comes from, with its figures, or why there is none.
    """

    motion: Motion | None
    note: str


def pair_motion(
    camera: Camera, images: tuple[Grey, Grey], poses: tuple[Pose, Pose] | None, free: Mask, epsilon: float
) -> PairMotion:
    """Motion between two images.

    Parameters
    ----------
    camera : Camera
    images : tuple of ndarray
        Previous and current image, grey.
    poses : tuple of Pose or None
        Of the previous and the current image.
    free : ndarray of bool, shape (H, W)
        Free space of the current image without its enclosed components.
    epsilon : float
        Altitude threshold, metres: what the pair's parallax must resolve.
    """
    points = ground_grid(camera, free)
    found = _with_poses(camera, images, poses, points) if poses else _without_poses(camera, images, free, points)
    if found.motion is None:
        return found
    parallax = threshold_parallax(camera, found.motion, points, epsilon)
    if parallax < LEAST_PARALLAX:
        return PairMotion(
            None,
            f"degenerate pair: a baseline of {found.motion.baseline:.3f} m moves the altitude threshold by "
            f"{parallax:.2f} px only; pair images that lie further apart",
        )
    return found


def threshold_parallax(camera: Camera, motion: Motion, points: Array, epsilon: float) -> float:
    """Median distance in the previous image between ground points and a plane at `epsilon`, pixels."""
    if not len(points):
        return 0.0
    pixels = plane_candidates(camera, motion, points, np.array([0.0, epsilon])).pixels
    distance = np.hypot(*(pixels[:, 1] - pixels[:, 0]).T)
    distance = distance[np.isfinite(distance)]
    return float(np.median(distance)) if len(distance) else 0.0


def _without_poses(camera: Camera, images: tuple[Grey, Grey], free: Mask, points: Array) -> PairMotion:
    previous, current = images
    rough = search_ground_motion(camera, current, previous, free)
    motion = refine_on_ground(camera, rough, (current, previous), points, True, "ground points") if rough else None
    if motion is None:
        return PairMotion(None, "no motion: the ground of the two images does not match; give poses with --poses")
    return PairMotion(motion, _said(motion))


def _with_poses(camera: Camera, images: tuple[Grey, Grey], poses: tuple[Pose, Pose], points: Array) -> PairMotion:
    """The poses corrected on the ground; as they are where the ground is bare; nothing where the ground contradicts."""
    pair = images[1], images[0]
    given = relative_motion(*poses)
    sigma = POSE_TRANSLATION_SIGMA * given.baseline
    given = Motion(given.rotation, given.translation, "poses", 0, sigma, POSE_ROTATION_SIGMA)
    origin: Origin = "poses, refined on the ground"
    refined = refine_on_ground(camera, given, pair, points, False, origin)
    if refined is None:
        refined = refine_on_ground(camera, given, pair, points, True, origin)
    if refined is None:
        if textured_points(pair[0], points) < MOST_TEXTURELESS:
            return PairMotion(given, _said(given))
        return PairMotion(None, "no motion: the ground does not move as the poses say; check order, units and theta")
    shift = float(np.linalg.norm(refined.translation - given.translation))
    turn = _angle(refined.rotation.T @ given.rotation)
    if shift > SLACK_METRES + SLACK_TRANSLATION * sigma or turn > SLACK_ROTATION * POSE_ROTATION_SIGMA:
        return PairMotion(
            None,
            f"no motion: poses and ground differ by {shift:.3f} m and {np.rad2deg(turn):.1f} degrees; "
            "check the order, units and theta of the poses, and mount_height",
        )
    return PairMotion(refined, _said(refined))


def _angle(rotation: Array) -> float:
    """Angle of a rotation matrix, radians; the sine keeps small angles exact."""
    skew = rotation - rotation.T  # holds each of the three sines twice, doubled
    return float(np.arctan2(np.linalg.norm(skew) / np.sqrt(8.0), 0.5 * (np.trace(rotation) - 1.0)))


def _said(motion: Motion) -> str:
    seen = f" from {motion.inliers} ground points" if motion.inliers else ""
    return (
        f"motion by {motion.origin}{seen}: {motion.baseline:.3f} m (+- {motion.translation_sigma:.4f} m, "
        f"+- {np.rad2deg(motion.rotation_sigma):.2f} degrees)"
    )
