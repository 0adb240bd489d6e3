"""Possible errors in poses that the ground contradicts: units, signs, order, mount height."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion, Pose, planar_place, planar_pose, relative_motion
from ffseg.freespace.motion.ground import GroundFit

MAX_HEIGHT, MAX_STEP = 8.0, 25.0
"""Metres: larger mount heights, or steps between two compared images, point to a wrong unit."""
MIN_AGREEMENT_RATIO = 1.5
"""Another interpretation of the poses must have this many times the inliers of the given one."""
EQUAL_AGREEMENT = 0.9
"""Interpretations with this fraction of the most inliers count as equally good; the one that the ground corrects least
is chosen."""
MIN_CHANGE = 0.03, np.deg2rad(2.0)
"""Metres and radians by which an interpretation must differ from the given one to count as another."""

Confirmed = Callable[[Motion, Camera], tuple[GroundFit, float] | None]


@dataclass(frozen=True, slots=True, eq=False)
class Contradiction:
    """A likely error.

    Attributes
    ----------
    sentence : str
        One sentence with the size of the contradiction and the remedy.
    fit : GroundFit
        How well the ground agrees with the poses read in the other way.
    """

    sentence: str
    fit: GroundFit


def unlikely_units(camera: Camera, poses: tuple[Pose, Pose]) -> str:
    """Values that no camera, and no poses in metres, have; empty if there are none."""
    height, baseline = camera.mounting(), relative_motion(*poses).baseline
    if height > MAX_HEIGHT:
        unit, factor = ("millimetres", 1000.0) if height > 20.0 * MAX_HEIGHT else ("centimetres", 100.0)
        return f"mount_height {height:g} m looks like {unit}; write {height / factor:g} in the camera file"
    if baseline > MAX_STEP:
        unit, factor = ("millimetres", 1000.0) if baseline > 60.0 else ("centimetres", 100.0)
        return f"x and y of the poses look like {unit}: the images lie {baseline:g} m apart; divide them by {factor:g}"
    return ""


def likely_cause(camera: Camera, poses: tuple[Pose, Pose], confirmed: Confirmed, agree: int) -> Contradiction | None:
    """The interpretation of the poses that the ground supports, if it differs from the given one.

    Parameters
    ----------
    poses : tuple of Pose
        Of the previous and the current image, as given.
    confirmed : callable
        Tries a motion with a camera on the ground: what agrees, and by how many standard deviations the ground corrects
        it; None where the ground does not agree.
    agree : int
        Points that agree with the poses as they are given.
    """
    stated = relative_motion(*poses)
    found: list[tuple[GroundFit, float, str]] = []
    for sentence, motion, other in _readings(camera, poses):
        if _differs(stated, motion, camera, other):
            tried = confirmed(motion, other)
            if tried is not None and tried[0].count >= MIN_AGREEMENT_RATIO * agree:
                found.append((*tried, sentence))
    if not found:
        return None
    most = max(fit.count for fit, _, _ in found)
    fit, _, sentence = min((one for one in found if one[0].count >= EQUAL_AGREEMENT * most), key=lambda one: one[1])
    return Contradiction(f"{sentence}; read like this {fit.count} points of the ground agree", fit)


def _differs(stated: Motion, other: Motion, camera: Camera, other_camera: Camera) -> bool:
    turn = np.arccos(np.clip(0.5 * (np.trace(stated.rotation.T @ other.rotation) - 1.0), -1.0, 1.0))
    shift = np.linalg.norm(stated.translation - other.translation)
    return bool(shift > MIN_CHANGE[0] or turn > MIN_CHANGE[1]) or camera.mounting() != other_camera.mounting()


def _readings(camera: Camera, poses: tuple[Pose, Pose]) -> Iterator[tuple[str, Motion, Camera]]:
    """Other interpretations of the poses: description, motion and camera of each."""
    flat = [planar_place(camera, pose) for pose in poses]
    degrees = [(x, y, np.deg2rad(theta)) for x, y, theta in _unwrapped(poses, flat)]
    readings = {
        "theta looks like degrees; give radians": degrees,
        "x and y look like millimetres; divide them by 1000": [(x / 1000.0, y / 1000.0, theta) for x, y, theta in flat],
        "x and y look like centimetres; divide them by 100": [(x / 100.0, y / 100.0, theta) for x, y, theta in flat],
        "theta has the other sign; turn it": [(x, y, -theta) for x, y, theta in flat],
        "the poses of the two images are swapped; check the order of the rows": flat[::-1],
        "y has the other sign, as seen without the mirror; turn it": [(x, -y, theta) for x, y, theta in flat],
        "x and y are exchanged": [(y, x, theta) for x, y, theta in flat],
        "y and theta have the other sign, as seen without the mirror": [(x, -y, -theta) for x, y, theta in flat],
    }
    for what, planar in readings.items():
        previous, current = (planar_pose(camera, *one) for one in planar)
        yield _sentence(poses, what), relative_motion(previous, current), camera
    for unit, factor in (("feet", 0.3048), ("inches", 0.0254)):
        lower = replace(camera, mount_height=camera.mounting() * factor)
        yield _sentence(poses, f"mount_height looks like {unit}; give metres"), relative_motion(*poses), lower


def _sentence(poses: tuple[Pose, Pose], what: str) -> str:
    bare = relative_motion(*poses)
    turn = np.rad2deg(np.arccos(np.clip(0.5 * (np.trace(bare.rotation) - 1.0), -1.0, 1.0)))
    return f"the ground does not move by {bare.baseline:.3g} m and {turn:.1f} degrees as the poses say: {what}"


def _unwrapped(poses: tuple[Pose, Pose], flat: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Planar poses with theta as the file states it, if it does."""
    return [
        (x, y, pose.theta if pose.theta is not None else theta) for pose, (x, y, theta) in zip(poses, flat, strict=True)
    ]
