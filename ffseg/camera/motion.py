"""Motion between two images: values, conversion from poses, derivatives of points, and the robot's frame.

The robot's frame on the ground is that of REP-103: x forward, y left, metres, the origin below the camera.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ffseg.arrays import Array
from ffseg.camera.model import Camera
from ffseg.errors import CalibrationError

ROTATION_SLACK = 1e-2
"""Largest entry of R Rᵀ - I of a rotation in a file: four decimals cause 1e-4."""
Origin = Literal["poses", "poses, refined on the ground", "ground points"]


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Where the camera is: ``world = rotation @ camera + position``, from the camera's frame to the world's.

    The camera's frame is x right and y down in the image, z along the optical axis toward the ground side. The world's is
    any fixed frame in metres, the same for all poses of a sequence; only differences between poses count, but for a map,
    which needs one whose z axis is vertical, up or down. `planar_pose` makes a pose of x, y and a heading.

    Attributes
    ----------
    rotation : ndarray of float64, shape (3, 3)
        Takes directions of the camera's frame to the world's; without a unit.
    position : ndarray of float64, shape (3,)
        The camera's centre in the world, metres.
    sigmas : tuple of float or None
        Standard deviations of the position per axis on the ground, metres, and of the turn, radians, where they are
        stated.
    theta : float or None
        The turn as it was given, whole turns included; None where it was given as a matrix or quaternion.

    Examples
    --------
    >>> camera = ffseg.load_camera("pictures/pair/camera.yaml")
    >>> pose = ffseg.planar_pose(camera, 1.0, 2.0, np.pi / 2)
    >>> (pose.rotation @ [1, 0, 0] + pose.position).round(6)
    array([1., 3., 0.])
    """

    rotation: Array
    position: Array
    sigmas: tuple[float, float] | None = None
    theta: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Motion of the camera between two images: ``previous = rotation @ current + translation``.

    Attributes
    ----------
    rotation : ndarray of float64, shape (3, 3)
    translation : ndarray of float64, shape (3,)
        Metres.
    origin : str
        ``poses``, ``poses, refined on the ground`` or ``ground points``.
    inliers : int
        Ground points that agree; 0 where only poses speak.
    translation_sigma : float
        Standard deviation of the translation per axis on the ground, metres.
    rotation_sigma : float
        Standard deviation of the rotation about ``up``, radians.
    spread : ndarray of float64, shape (k, 8), or None
        Independent errors of one standard deviation each, as `perturbed` takes them: their squares add up to the
        covariance. None: the planar ones that the two numbers above say.

    Examples
    --------
    >>> sequence = ffseg.Sequence(ffseg.load_camera("pictures/pair/camera.yaml"))
    >>> first, second = (sequence.feed(ffseg.read_image(f"pictures/pair/{name}.png")) for name in ("0001", "0002"))
    >>> second.motion.origin, float(np.hypot(*second.motion.translation[:2]).round(2))
    ('ground points', 0.22)
    """

    rotation: Array
    translation: Array
    origin: Origin
    inliers: int
    translation_sigma: float
    rotation_sigma: float
    spread: Array | None = None

    def errors(self) -> Array:
        """Independent errors of one standard deviation each, shape (k, 8)."""
        if self.spread is not None:
            return self.spread
        sigmas = np.array([self.translation_sigma, self.translation_sigma, self.rotation_sigma])
        return np.diag(sigmas) @ np.eye(3, PARAMETERS)

    @property
    def baseline(self) -> float:
        """Distance between the two camera centres, metres."""
        return float(np.sqrt(np.sum(self.translation**2)))

    def apply(self, points: Array) -> Array:
        """Points, shape (..., 3), of the current camera frame in the previous one."""
        moved: Array = points @ self.rotation.T + self.translation
        return moved


PARAMETERS = 8
"""Parameters of a motion with its ground plane: x, y (metres), yaw, lift (metres), roll and pitch between the views, and
the tilt of the current camera about level x and y (radians)."""


def perturbed(camera: Camera, motion: Motion, parameters: Array) -> tuple[Array, Array, Array]:
    """Rotations (v, 3, 3), translations (v, 3) and ups (v, 3) after corrections, shape (v, 8).

    The correction moves points of the current camera's levelled frame before the motion does; the ups are those of the
    current camera. Angles are small: a degree of nod is right to the fourth digit.
    """
    level = camera.level()
    x, y, turn, lift, nod_x, nod_y, lean_x, lean_y = parameters.T
    zero = np.zeros_like(x)
    rotations = motion.rotation @ rotation_matrices(np.stack([nod_x, nod_y, turn], axis=1) @ level)
    moves = np.stack([x, y, lift], axis=1) @ level
    ups = camera.up + np.stack([lean_x, lean_y, zero], axis=1) @ level
    ups /= np.sqrt(np.sum(ups**2, axis=1))[:, None]
    return rotations, motion.translation + moves @ motion.rotation.T, ups


def point_slopes(camera: Camera, motion: Motion, points: Array, *, on_ground: bool) -> Array:
    """d(point in the previous frame)/d(parameters), shape (n, 3, 8), of points, shape (n, 3), of the current one.

    With ``on_ground`` the points are where rays meet the ground, which a leaning camera moves along the rays; else they
    stay where they are.
    """
    level = camera.level()
    axes = level @ motion.rotation.T  # level x, y and down as the previous frame has them
    turned = points @ motion.rotation.T
    slopes = np.zeros((len(points), 3, PARAMETERS))
    slopes[:, :, [0, 1, 3]] = axes.T
    for place, axis in ((4, axes[0]), (5, axes[1]), (2, axes[2])):
        slopes[:, 0, place] = axis[1] * turned[:, 2] - axis[2] * turned[:, 1]
        slopes[:, 1, place] = axis[2] * turned[:, 0] - axis[0] * turned[:, 2]
        slopes[:, 2, place] = axis[0] * turned[:, 1] - axis[1] * turned[:, 0]
    if on_ground:
        along = -(points @ level[:2].T) / (points @ camera.up)[:, None]
        slopes[:, :, 6:] = turned[:, :, None] * along[:, None]
    return slopes


def projection_slopes(camera: Camera, points: Array) -> tuple[Array, Array]:
    """Pixels of points, shape (n, 3), and d(pixel)/d(point), shape (n, 2, 3), by differences."""
    steps = POINT_PROBE * np.eye(4, 3, -1)
    base, *moved = camera.project(points + steps[:, None])
    return base, np.stack([(one - base) / POINT_PROBE for one in moved], axis=2)


POINT_PROBE = 1e-6
"""Metres; far above rounding, far below the curvature of any lens."""


def rotation_matrices(vectors: Array) -> Array:
    """Rodrigues: rotation matrices, shape (v, 3, 3), of rotation vectors, shape (v, 3)."""
    angle = np.sqrt(np.sum(vectors**2, axis=1))
    safe = np.maximum(angle, 1e-12)
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    bend = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    turned: Array = np.eye(3) + (np.sin(safe) / safe)[:, None, None] * cross + bend[:, None, None] * (cross @ cross)
    return turned


def require_camera(camera: object) -> None:
    """Refuse what is no camera, such as the name of its file.

    Raises
    ------
    CalibrationError
        Saying what it is.
    """
    if not isinstance(camera, Camera):
        raise CalibrationError(f"the camera is of type {type(camera).__name__}; give what ffseg.load_camera returns")


def require_pose(pose: object) -> None:
    """Refuse what is no pose.

    Raises
    ------
    CalibrationError
        Saying what is wrong with it.
    """
    if not isinstance(pose, Pose):
        raise CalibrationError(f"the pose is of type {type(pose).__name__}; give what ffseg.planar_pose returns")
    for name, value, shape in (("rotation", pose.rotation, (3, 3)), ("position", pose.position, (3,))):
        if not _is_finite(value, shape):
            raise CalibrationError(f"the pose's {name} is no array of shape {shape} of finite numbers")
    off = np.abs(pose.rotation @ pose.rotation.T - np.eye(3)).max()
    if off > ROTATION_SLACK or np.linalg.det(pose.rotation) < 0.0:
        raise CalibrationError(
            "the pose's rotation is none; its rows must be of length 1 and at right angles, its determinant 1"
        )
    _check_sigmas(pose.sigmas)


def _check_sigmas(sigmas: tuple[float, float] | None) -> None:
    if sigmas is not None and not (_is_finite(np.array(sigmas), (2,)) and min(sigmas) >= 0.0):
        raise CalibrationError(f"the pose's sigmas are {sigmas!r}; give metres and radians from 0, or None if unknown")


def _is_finite(value: object, shape: tuple[int, ...]) -> bool:
    if not isinstance(value, np.ndarray) or value.shape != shape or value.dtype.kind not in "fiu":
        return False
    return bool(np.isfinite(value).all())


def planar_pose(camera: Camera, x: float, y: float, theta: float, sigmas: tuple[float, float] | None = None) -> Pose:
    """Pose of a camera that moves over level ground, as in a row of a poses file.

    Parameters
    ----------
    camera : Camera
        Its ``up`` says how it is mounted.
    x, y : float
        The camera's place on the ground, metres.
    theta : float
        Its heading, radians: a direction (dx, dy) of the levelled camera frame is (cos(theta) dx - sin(theta) dy,
        sin(theta) dx + cos(theta) dy) on the ground. Since y points down in the image, positive turns clockwise as
        the image shows it.
    sigmas : tuple of float, optional
        Standard deviations of x and y (metres) and of theta (radians), where they are known.

    Returns
    -------
    Pose
        Levelled camera frame turned by `theta` and moved to (x, y, 0).

    Raises
    ------
    CalibrationError
        When the camera is none, a number is not finite, or a deviation is below 0.

    Examples
    --------
    >>> camera = ffseg.load_camera("pictures/pair/camera.yaml")
    >>> ffseg.planar_pose(camera, 1.0, 2.0, np.pi / 2).position
    array([1., 2., 0.])
    """
    require_camera(camera)
    for name, value in (("x", x), ("y", y), ("theta", theta)):
        if not isinstance(value, float | int | np.floating | np.integer) or not np.isfinite(value):
            raise CalibrationError(f"{name} is {value!r}; give a finite number, in metres or radians")
    _check_sigmas(sigmas)
    return Pose(_turn(theta) @ camera.level(), np.array([x, y, 0.0]), sigmas, theta)


def planar_place(camera: Camera, pose: Pose) -> tuple[float, float, float]:
    """(x, y, theta) of a pose as `planar_pose` takes them; of a world whose z axis points up with y and z turned over."""
    turn = pose.rotation @ camera.level().T
    side = -1.0 if turn[2, 2] < 0.0 else 1.0
    theta = np.arctan2(side * turn[1, 0] - turn[0, 1], turn[0, 0] + side * turn[1, 1])
    return float(pose.position[0]), float(side * pose.position[1]), float(theta)


def relative_motion(previous: Pose, current: Pose) -> Motion:
    """Motion between two poses."""
    rotation = previous.rotation.T @ current.rotation
    translation = previous.rotation.T @ (current.position - previous.position)
    return Motion(rotation, translation, "poses", 0, 0.0, 0.0)


def planar_motion(camera: Camera, planar: Array, origin: Origin, inliers: int, sigma: tuple[float, float]) -> Motion:
    """Motion from its planar parameters (x, y, theta) in the levelled camera frame."""
    level = camera.level()
    rotation = level.T @ _turn(planar[2]) @ level
    translation = level.T @ np.array([planar[0], planar[1], 0.0])
    return Motion(rotation, translation, origin, inliers, *sigma)


def planar_parameters(camera: Camera, motion: Motion) -> Array:
    """(x, y, theta) of a motion in the levelled camera frame: what is left of it on the ground plane."""
    level = camera.level()
    rotation = level @ motion.rotation @ level.T
    x, y, _ = level @ motion.translation
    theta = np.arctan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])
    return np.array([x, y, theta])


def ground_points(camera: Camera, pixels: Array) -> Array:
    """Where rays of pixels, shape (..., 2), meet the ground: levelled (x, y), metres; NaN above the horizon."""
    points: Array = (camera.meet_plane(camera.lift(pixels)) @ camera.level().T)[..., :2]
    return points


def _turn(theta: float) -> Array:
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


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
    return ground_points(camera, pixels) @ robot_axes(camera).T


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
