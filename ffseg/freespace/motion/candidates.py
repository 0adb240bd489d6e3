"""Candidate ground points: texture of the free space, enclosed components, and the border of the free space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Array, Image, Indices, Mask
from ffseg.camera.model import Camera
from ffseg.geometry.freeform import FreeForm
from ffseg.image.components import Component
from ffseg.image.interest import NO_POINTS, InterestPoints, harris_points, outline_points, strongest

GRID_STEP = 28
"""Pixels between sample points of the free space: about 130 points in an 800x600 image."""
CLEARANCE = 10
"""Pixels between a sample point of the free space and anything else, so that its patch shows ground only."""
RIM_MARGIN = 8.0
"""Pixels from the rim of the view: outlines nearer to it are cut off there and do not stand on the ground."""
MAX_CORNERS = 10
"""Corners of a component used in the structural test; more add no information."""
CORNERS, EDGES, BORDER = 6, 12, 72
"""Largest numbers of corners and edge samples of a component, and of samples of the border of the free space."""
FREE, FOOT = -1, -2
"""Owner numbers of points outside components: texture of the free space, and its border."""


@dataclass(frozen=True, slots=True, eq=False)
class SegmentedImage:
    """An image with its segmentation.

    Attributes
    ----------
    free : ndarray of bool, shape (H, W)
        Free space without its enclosed components.
    border : ndarray of float64, shape (n, 2)
        Samples of the outer contours, pixels; empty where nobody asks.
    """

    free: Mask
    components: Sequence[Component] = ()
    border: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class GroundCandidates:
    """Points of the current image that may lie on the ground.

    Attributes
    ----------
    pixels : ndarray of float64, shape (n, 2)
    owner : ndarray of int, shape (n,)
        Place of the component, or ``FREE`` or ``FOOT``.
    corners : InterestPoints
        The ``MAX_CORNERS`` strongest corners of each component, of which `pixels` holds the first few.
    """

    pixels: Array
    owner: Indices
    corners: InterestPoints = NO_POINTS

    @property
    def grid(self) -> Array:
        """Points of the free space, shape (k, 2)."""
        points: Array = self.pixels[self.owner == FREE]
        return points


def ground_candidates(camera: Camera, grey: Image, segmented: SegmentedImage) -> GroundCandidates:
    """All points of an image that may lie on the ground.

    Notes
    -----
    Marks are the most textured things on a bare floor, feet of boxes and walls carry edges that lie on the ground. What
    stands up among them disagrees with the rest, and is left out by the fit.
    """
    grid = ground_grid(camera, segmented.free)
    found = harris_points(grey, segmented.components, MAX_CORNERS)
    corners = strongest(found, CORNERS)
    edges = outline_points(grey, segmented.components, EDGES)
    feet = _thinned(camera, segmented.border)
    owners = [np.full(len(grid), FREE), corners.owner, edges.owner, np.full(len(feet), FOOT)]
    return GroundCandidates(np.concatenate([grid, corners.pixels, edges.pixels, feet]), np.concatenate(owners), found)


def ground_grid(camera: Camera, free: Mask) -> Array:
    """A grid of pixels well inside the free space and outside the robot's disc, shape (n, 2)."""
    first, size = GRID_STEP // 2, 2 * CLEARANCE + 1
    if min(free.shape) < size:
        return np.empty((0, 2))
    starts = range(first - CLEARANCE, len(free) - size + 1, GRID_STEP)
    lines = np.array(
        [free[start : start + size].all(axis=0) for start in starts]
    )  # whole rows at once: a third of the time
    around = np.lib.stride_tricks.sliding_window_view(lines, size, axis=1)[:, first - CLEARANCE :: GRID_STEP]
    rows, columns = np.nonzero(around.all(axis=2))
    points = np.stack([columns, rows], axis=1) * float(GRID_STEP) + first
    away = np.hypot(*(points - camera.center).T) > camera.robot_radius + CLEARANCE
    kept: Array = points[away]
    return kept


def outer_joints(contours: Sequence[FreeForm]) -> Array:
    """Joints between the patches of the outer contours, pixels, shape (n, 2)."""
    joints = [contour.control_points[:: contour.degree] for contour in contours if contour.signed_area > 0]
    return np.concatenate(joints) if joints else np.empty((0, 2))


def _thinned(camera: Camera, border: Array | None) -> Array:
    """Evenly spaced samples of the border, without those at the rim of the view."""
    if border is None or not len(border):
        return np.empty((0, 2))
    distance = np.hypot(*(border - camera.center).T)
    last = np.array([camera.width, camera.height]) - 1.0
    kept = (distance > camera.robot_radius + RIM_MARGIN) & (np.minimum(border, last - border).min(axis=1) > RIM_MARGIN)
    if camera.rim_radius is not None:
        kept &= distance < camera.rim_radius - RIM_MARGIN
    points: Array = border[kept]
    return points[:: max(1, -(-len(points) // BORDER))]
