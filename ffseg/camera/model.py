"""The camera: a projection, the size of its image and how it is mounted above the ground."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ffseg.arrays import Array, Mask
from ffseg.camera.projections import Projection
from ffseg.errors import CalibrationError


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A calibrated omnidirectional camera.

    Frame: x right in the image, y down in the image, z along the optical axis toward the scene on the ground side.

    Attributes
    ----------
    projection : Projection
        The pixel-ray mapping.
    width, height : int
        Image size, pixels.
    center : tuple of float
        (x, y) of the principal point, pixels: centre of the robot's disc and of the rim.
    mount_height : float or None
        Metres above the ground; None when the file does not say.
    up : ndarray of float64, shape (3,)
        Unit vector to the sky in the camera frame.
    robot_radius : float
        Pixels; the disc in which the camera sees its own robot. 0: none.
    rim_radius : float or None
        Pixels; nothing outside is part of the scene. None: the whole image.
    footprint : float
        Radius of the robot on the ground, metres: passages that a disc of it cannot take count as closed. 0: not asked.
    mirrored : bool
        Whether the image shows the ground as a mirror does, turned over against the view from above: y of the image is
        then a turn to the left of x on the ground, without a mirror one to the right.
    forward : float
        Degrees from the image's x axis toward its y axis to where the robot's front is seen.

    Examples
    --------
    >>> camera = ffseg.load_camera("pictures/pair/camera.yaml")
    >>> rays = camera.lift(np.array([[500.0, 300.0]]))
    >>> camera.project(rays).round(6)
    array([[500., 300.]])
    """

    projection: Projection
    width: int
    height: int
    center: tuple[float, float]
    mount_height: float | None = None
    up: Array = field(default_factory=lambda: np.array([0.0, 0.0, -1.0]))
    robot_radius: float = 0.0
    rim_radius: float | None = None
    footprint: float = 0.0
    mirrored: bool = True
    forward: float = 0.0

    def lift(self, pixels: Array) -> Array:
        """Unit rays of pixels.

        Parameters
        ----------
        pixels : ndarray of float64, shape (..., 2)
            (x, y), pixels; integer values are pixel centres.

        Returns
        -------
        ndarray of float64, shape (..., 3)
            NaN for a pixel that shows no direction. ``project`` is its exact inverse.
        """
        points = np.asarray(pixels, dtype=np.float64)
        return self.projection.lift(points.reshape(-1, 2)).reshape(*points.shape[:-1], 3)

    def project(self, points: Array) -> Array:
        """Pixels of points.

        Parameters
        ----------
        points : ndarray of float64, shape (..., 3)
            Camera frame, any length above zero.

        Returns
        -------
        ndarray of float64, shape (..., 2)
            NaN for a direction the camera does not show; a pixel may lie outside the image.
        """
        points = np.asarray(points, dtype=np.float64)
        return self.projection.project(points.reshape(-1, 3)).reshape(*points.shape[:-1], 2)

    def altitude(self, points: Array) -> Array:
        """Metres above the ground of points, shape (..., 3), in the camera frame: ``mount_height + up . X``."""
        altitude: Array = self.mounting() + np.asarray(points) @ self.up
        return altitude

    def meet_plane(self, rays: Array, altitude: Array | float = 0.0) -> Array:
        """Points where rays, shape (..., 3), meet the plane at ``altitude`` metres; NaN where they do not."""
        fall = -(rays @ self.up)
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(fall > 0, (self.mounting() - altitude) / fall, np.nan)
        points: Array = rays * reach[..., None]
        return points

    def mounting(self) -> float:
        """Mount height in metres.

        Raises
        ------
        CalibrationError
            When the camera file does not say it.
        """
        if self.mount_height is None:
            raise CalibrationError(
                "the camera file has no mount_height, which altitudes need: add 'mount_height: METRES' to it"
            )
        return self.mount_height

    def level(self) -> Array:
        """Smallest rotation, shape (3, 3), from the camera frame to one whose z axis points straight down."""
        return _level(*self.up.tolist())

    def ground(self) -> Array:
        """Where each pixel's ray meets the ground: levelled (x, y), metres, shape (height, width, 2), read-only.

        NaN above the horizon, and where a pixel shows no direction.

        Raises
        ------
        CalibrationError
            When the camera file has no mount_height.
        """
        self.mounting()
        return _ground(self)

    def domain(self) -> Mask:
        """True where ground may be: inside ``rim_radius`` and the image and below the horizon, shape (height, width), read-only.

        The robot's own disc counts as inside: a contour starts round it and the robot stands on free ground.
        """
        return _domain(self)

    def check_size(self, width: int, height: int, image: str) -> None:
        """Refuse an image of another size than the calibration's.

        Raises
        ------
        CalibrationError
            Naming the image and both sizes.
        """
        if (width, height) != (self.width, self.height):
            raise CalibrationError(
                f"{image} is {width}x{height}, the camera file says {self.width}x{self.height}: "
                "use the calibration of this image size, or resize the image"
            )


ROWS = 64
"""Image rows whose rays are computed at once: those of a large image take more memory than its pixels."""


def _rays(camera: Camera) -> Iterator[tuple[slice, Array]]:
    """Rows of the image with their unit rays in the levelled frame, shape (rows, width, 3)."""
    for first in range(0, camera.height, ROWS):
        rows = slice(first, min(first + ROWS, camera.height))
        x, y = np.meshgrid(
            np.arange(camera.width, dtype=np.float64), np.arange(rows.start, rows.stop, dtype=np.float64)
        )
        yield rows, camera.lift(np.stack([x, y], axis=-1)) @ camera.level().T


@lru_cache(maxsize=4)
def _domain(camera: Camera) -> Mask:
    domain = np.empty((camera.height, camera.width), np.bool_)
    for rows, rays in _rays(camera):
        domain[rows] = rays[..., 2] > 0.0
    if camera.rim_radius is not None:
        x, y = np.arange(camera.width) - camera.center[0], np.arange(camera.height) - camera.center[1]
        domain &= x**2 <= (camera.rim_radius**2 - y**2)[:, None]
    domain.setflags(write=False)
    return domain


@lru_cache(maxsize=2)
def _ground(camera: Camera) -> Array:
    points = np.full((camera.height, camera.width, 2), np.nan)
    for rows, rays in _rays(camera):
        down = np.where(rays[..., 2:] > 0.0, rays[..., 2:], np.nan)
        points[rows] = rays[..., :2] * (camera.mounting() / down)
    points.setflags(write=False)
    return points


@lru_cache(maxsize=16)
def _level(x: float, y: float, z: float) -> Array:
    """Smallest rotation that takes minus (x, y, z) to (0, 0, 1), read-only."""
    if z >= 1.0 - 1e-12:
        rotation = np.diag([1.0, -1.0, -1.0])
    else:
        # The axis is down x (0, 0, 1) = (-y, x, 0).
        k = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
        rotation = np.eye(3) + k + k @ k / (1.0 - z)
    rotation.setflags(write=False)
    return rotation
