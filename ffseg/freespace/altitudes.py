"""The altitude term of the snake (Eq. 11): at which interest points of a pair it may pass an edge."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Array, Mask
from ffseg.camera.model import Camera
from ffseg.freespace.corners import match_corners
from ffseg.freespace.pairs import MIN_SIGMAS, ImagePair
from ffseg.image.components import Component

TILE = 60
"""Pixels: the strongest corners of each tile are matched, so that they are spread over the image."""
ROBOT_MARGIN = 8.0
"""Pixels round the robot's disc without interest points, as its border moves with the camera."""
ZONE_REACH = 60.0
"""Pixels: length of a point's radial zone, outward: the depth of a mark, or the part of a box seen above its base."""
MIN_CORNER_DISTANCE = 4.0
"""Pixels: corners nearer to each other count as one."""
ZONE_COSINE, BEHIND_COSINE = np.cos(np.deg2rad(30.0)), np.cos(np.deg2rad(60.0))
"""Cosines of the half-angles of the radial zone: where ground must be seen again, and where nothing may rise."""
CLEAR_RADIUS = 28.0
"""Pixels within which nothing may rise in any direction: a little more than two mask radii."""
MASK_RADIUS = 12.0
"""Pixels round a point within which edges are removed, or strengthened."""


@dataclass(frozen=True, slots=True, eq=False)
class AltitudePoints:
    """Interest points in the form that the snake uses.

    Attributes
    ----------
    rows : ndarray of float64, shape (K, 4)
        x and y in pixels, altitude in metres, radius of the zone in pixels.
    low : int
        Rows that switch edges off.
    """

    rows: Array
    low: int


def altitude_points(pair: ImagePair, epsilon: float) -> AltitudePoints:
    """Matched interest points of the current image: those that remove edges, and those above the ground.

    Parameters
    ----------
    epsilon : float
        ``obstacles.altitude``, metres.

    Notes
    -----
    Eq. 11 and the radial zone of Section 5.1: an edge is passed when ground is found again beyond it. A point counts as
    low when its altitude lies surely below epsilon, another low point lies beyond it as seen from the camera, and no
    point that may stand up lies behind or beside it. Upright edges run outward in the image, so the top of a box lies
    behind its base, and keeps its base an edge. Low points that fail this say nothing. The altitude handed on is the
    upper bound of each point, so that an uncertain point counts as high.
    """
    matches = match_corners(pair, list(_tiles(pair.camera)), epsilon)
    points = matches.current[matches.good]
    highest = (matches.altitude + MIN_SIGMAS * matches.altitude_sigma)[matches.good]
    high = highest >= epsilon
    low = ~high & _passable(points, high, pair.camera.center)
    used = low | high
    rows = np.column_stack([points, highest, np.full(len(points), MASK_RADIUS)])[used]
    return AltitudePoints(np.ascontiguousarray(rows), int(low.sum()))


def _passable(points: Array, high: Mask, center: tuple[float, float]) -> Mask:
    """Points beyond which ground is seen again, with nothing raised behind or beside them."""
    outward = points - center
    outward /= np.maximum(np.hypot(*outward.T), 1.0)[:, None]
    way = points[None] - points[:, None]
    distance = np.hypot(way[..., 0], way[..., 1])
    along = np.einsum("nkj,nj->nk", way, outward)
    near = distance < ZONE_REACH
    again = near & (distance > MIN_CORNER_DISTANCE) & (along > ZONE_COSINE * distance) & ~high
    upright = ((near & (along > BEHIND_COSINE * distance)) | (distance < CLEAR_RADIUS)) & high
    passable: Mask = again.any(axis=1) & ~upright.any(axis=1)
    return passable


def _tiles(camera: Camera) -> Iterator[Component]:
    """The image of the scene, divided into squares."""
    across, down = np.arange(camera.width) - camera.center[0], np.arange(camera.height) - camera.center[1]
    seen = camera.domain() & (np.hypot(across[None, :], down[:, None]) > camera.robot_radius + ROBOT_MARGIN)
    places = [(x, y) for y in range(0, camera.height, TILE) for x in range(0, camera.width, TILE)]
    for index, (left, top) in enumerate(places):
        part = seen[top : top + TILE, left : left + TILE]
        if part.any():
            yield Component(index, (left, top), part)
