"""The robot's frame on the ground, as REP-103 has it: x forward, y left, metres, the origin below the camera."""

from __future__ import annotations

import numpy as np

from ffseg.camera.model import Camera
from ffseg.camera.motion import Pose, planar_pose
from ffseg.camera.projections import Array


def robot_axes(camera: Camera) -> Array:
    """Rows that take (x, y) of the levelled camera frame to (forward, left), shape (2, 2).

    Forward is ``camera.forward`` degrees from the image's x axis toward its y axis. Left is a quarter turn on from there
    toward y where the image is mirrored, as under a mirror, and back from there where it is not, as from above.
    """
    turn = np.deg2rad(camera.forward)
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, s], [-s, c]] if camera.mirrored else [[c, s], [s, -c]])


def to_robot(camera: Camera, pixels: Array) -> Array:
    """Where pixels, shape (..., 2), show the ground in the robot's frame, metres; NaN above the horizon."""
    points: Array = (camera.meet_plane(camera.lift(pixels)) @ camera.level().T)[..., :2] @ robot_axes(camera).T
    return points


def to_pixels(camera: Camera, points: Array) -> Array:
    """Pixels that show points of the ground, shape (..., 2), in the robot's frame; NaN where the camera shows none."""
    flat = np.asarray(points, np.float64) @ robot_axes(camera)
    down = np.full((*flat.shape[:-1], 1), camera.mounting())
    return camera.project(np.concatenate([flat, down], axis=-1) @ camera.level())


def robot_pose(camera: Camera, x: float, y: float, heading: float) -> Pose:
    """Pose of the camera of a robot at (x, y), metres, with a heading counterclockwise as seen from above, radians.

    Without a mirror y and turns change their signs, as the image's do.
    """
    turn = heading if camera.mirrored else -heading
    return planar_pose(camera, x, y if camera.mirrored else -y, turn - np.deg2rad(camera.forward))
