"""Starts on edges or outside the domain: moved or shrunk to the nearest free place, with a message."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np

from ffseg.arrays import Mask, Plane
from ffseg.errors import SegmentationError
from ffseg.geometry.freeform import FreeForm
from ffseg.image.free import clear_distances, free_part_under, free_pixels
from ffseg.image.raster import rasterize
from ffseg.parameters import MIN_START_RADIUS
from ffseg.scene import Scene
from ffseg.starts.initial import circle_start

SPARE_MARGIN = 1.0
"""Pixels between a moved start and the nearest edge or border, so that rounding puts no sample on it."""

OUTSIDE = "outside the domain"

SIZE_WEIGHT = 1.05
"""Pixels that a start may move to keep one more pixel of its radius. Slightly above one, so that it moves off a straight
edge without shrinking."""


@dataclass(frozen=True, slots=True)
class Circle:
    """A start as messages state it: centre and radius in pixels."""

    x: float
    y: float
    radius: float

    def enlarged(self, factor: int) -> Circle:
        """The circle on an enlargement by that factor."""
        x, y = (factor * (place + 0.5) - 0.5 for place in (self.x, self.y))
        return Circle(x, y, factor * self.radius)

    def __str__(self) -> str:
        x, y = (round(place, 6) + 0.0 for place in (self.x, self.y))  # neither a rounding of nothing nor -0
        return f"({x:.4g}, {y:.4g}), radius {self.radius:.4g}"


def moved_starts(scene: Scene, remedy: str) -> tuple[Scene, str]:
    """The scene with every start in the nearest free place with room for it, and a message about it.

    Parameters
    ----------
    scene : Scene
        Its starts become circles, each with the patches a start circle would have.
    remedy : str
        What to do where there is no free place at all.

    Raises
    ------
    SegmentationError
        If there is none, or the start stands round a camera's own robot and lies in the domain: ground elsewhere is not
        what the robot stands on.

    Notes
    -----
    A place costs its distance from the start's centre and what the radius must shrink there; the cheapest one counts,
    on the same side of all edges as most of the start where there is any.
    """
    free = free_pixels(scene.edges.edges, scene.domain, scene.params.contour.clearance)
    cause = _cause(scene)
    if scene.fixed and scene.center is not None and scene.robot > 0:
        if cause != OUTSIDE:
            stays = f"cannot move from round the robot's disc, of radius {scene.robot * scene.factor:g}"
            raise SegmentationError(f"the start contour lies {cause} at every sample and {stays}; {remedy}")
        free &= ~rasterize([circle_start((*scene.center, scene.robot), scene.params)], free.shape)
    room = clear_distances(free) - SPARE_MARGIN
    if float(room.max(initial=0.0)) < MIN_START_RADIUS:
        raise SegmentationError(f"the start contour lies {cause} at every sample, and there is no free place; {remedy}")
    open_ground = free_pixels(scene.edges.edges, scene.domain)
    pairs = [
        nearest_free_circle(start, room, free_part_under(open_ground, rasterize([start], room.shape)))
        for start in scene.starts
    ]
    starts = tuple(circle_start((new.x, new.y, new.radius), scene.params) for _, new in pairs)
    others = f", and {len(pairs) - 1} more" if len(pairs) > 1 else ""
    old, new = (one.enlarged(scene.factor) for one in pairs[0])
    message = f"the start at {old} lay {cause} and was moved to {new}{others}"
    return replace(scene, starts=starts), message


def nearest_free_circle(start: FreeForm, room: Plane, own: Mask | None) -> tuple[Circle, Circle]:
    """A start as a circle of the same area, and the nearest free circle.

    Parameters
    ----------
    room : ndarray of float32, shape (H, W)
        Radius that each pixel allows.
    own : ndarray of bool, shape (H, W), or None
        Pixels it keeps to where there is room.
    """
    old = as_circle(start)
    y, x = np.ogrid[: room.shape[0], : room.shape[1]]
    kept = np.minimum(room, old.radius)
    cost = np.sqrt((x - old.x) ** 2 + (y - old.y) ** 2) + SIZE_WEIGHT * (old.radius - kept)
    possible = room >= MIN_START_RADIUS
    if own is not None and (possible & own).any():
        possible &= own
    cost[~possible] = np.inf
    row, column = np.unravel_index(int(np.argmin(cost)), cost.shape)
    return old, Circle(float(column), float(row), float(max(MIN_START_RADIUS, kept[row, column])))


def as_circle(start: FreeForm) -> Circle:
    """The circle with a start's centre and area."""
    middle = start.control_points.mean(axis=0)
    return Circle(float(middle[0]), float(middle[1]), sqrt(abs(start.signed_area) / pi))


def _cause(scene: Scene) -> str:
    """Where the samples of the starts lie, as words that follow "lies"."""
    points = np.rint(np.concatenate([start.flatten(0.5) for start in scene.starts])).astype(int)
    free = free_pixels(scene.edges.edges, scene.domain)
    height, width = free.shape
    inside = (points >= 0).all(axis=1) & (points[:, 0] < width) & (points[:, 1] < height)
    columns, rows = points[inside].T
    within = np.ones(len(rows), np.bool_) if scene.domain is None else scene.domain[rows, columns] > 0
    if not within.any():
        return OUTSIDE
    clearance = scene.params.contour.clearance
    if clearance > 0 and free[rows, columns].any():
        return f"nearer to an edge than half of contour.clearance ({clearance:g})"
    return "on an edge" if within.all() else "on an edge or outside the domain"
