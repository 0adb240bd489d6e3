"""Start circles that an edge or the limit of the domain crosses: moved to the side that holds most of them."""

from __future__ import annotations

from dataclasses import replace
from math import ceil, hypot

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image, Mask
from ffseg.geometry.freeform import FreeForm
from ffseg.image.components import filled
from ffseg.image.free import clear_distances, free_pixels, open_ground, open_sides
from ffseg.image.parts import connected_parts
from ffseg.image.raster import rasterize
from ffseg.parameters import click_radius
from ffseg.scene import Scene
from ffseg.starts.initial import circle_start
from ffseg.starts.moved import SIZE_WEIGHT, SPARE_MARGIN, Circle, as_circle, nearest_free_circle

MIN_KEPT_RADIUS = 0.5
"""A start that lies across a boundary is moved to one side. It keeps at least this fraction of its radius, and its
centre moves by at most one radius (round what lies outside the domain: `SEARCH_RADII` radii). If no such place
exists, edges cover all of it: it stays where it is, with a message."""

EDGE_REACH = 3
"""Pixels: what is open ground depends on edges no farther away."""

SEARCH_RADII = 1 + SIZE_WEIGHT
"""Search distance from the centre of the start, in radii; less where what is farther costs more than the worst that would be
accepted."""


MIN_PARTED = 2
"""Into so many parts edges divide a start of no named radius, from which on it may be wider than what is meant."""


def on_one_side(scene: Scene) -> tuple[Scene, tuple[str, ...], bool]:
    """The scene with every start circle in the domain and on one side of all edges, and messages about moved ones.

    Returns
    -------
    Scene
        The same if no start can be moved.
    tuple of str
    bool
        Whether a start is left on both sides of an edge or of the domain's limit.

    Notes
    -----
    Starts that close in may hold anything, and boxes and masks are drawn as they are wanted: only circles that grow
    are looked at, and not those round a camera, which sees its own robot in them. A mark that lies in a circle whole has
    no side on its rim; what lies outside the domain would stay in the region, wherever in the circle it is.
    """
    if scene.fixed or scene.params.contour.balloon < 0 or scene.start_mask is not None:
        return scene, (), False
    within = {} if scene.domain is None else {at: _within(one, scene.domain) for at, one in enumerate(scene.starts)}
    beyond = {at for at, pixels in within.items() if not pixels.all()}
    crossed = [at for at, start in enumerate(scene.starts) if _is_parted(start, scene)]
    if not (crossed or beyond):
        return scene, (), False
    sides = open_sides(free_pixels(scene.edges.edges, scene.domain))
    crossed = sorted(beyond.union(at for at in crossed if _num_sides(scene.starts[at], sides) > 1))
    if not crossed:
        return scene, (), False
    apart = {at for at in beyond if not within[at].any()}
    others = len(apart) < len(scene.starts)
    starts: list[FreeForm | None] = list(scene.starts)
    messages, across = [], False
    free = free_pixels(scene.edges.edges, scene.domain, scene.params.contour.clearance)
    for at in crossed:
        what, most = ("the domain's limit", SEARCH_RADII) if at in beyond else ("an edge", 1)
        old, new = _moved(scene.starts[at], free, sides, most, widest=scene.disc is not None)
        before, after = (one.enlarged(scene.factor) for one in (old, new))
        if new.radius >= MIN_KEPT_RADIUS * old.radius and hypot(new.x - old.x, new.y - old.y) <= most * old.radius:
            starts[at] = circle_start((new.x, new.y, new.radius), scene.params)
            messages.append(f"the start at {before} lay across {what} and was moved to {after}")
        elif at in apart and others:
            starts[at] = None
            messages.append(f"the start at {before} lies outside the domain and was left out")
        else:
            across = True
            where = "outside the domain" if at in apart else f"across {what}; the region holds both sides of it"
            messages.append(f"the start at {before} lies {where}")
    kept = all(start is old for start, old in zip(starts, scene.starts, strict=True))
    left = tuple(start for start in starts if start is not None)
    return (scene if kept else replace(scene, starts=left)), tuple(messages), across


def click_in_parted(scene: Scene) -> tuple[Scene, str] | None:
    """The scene with a click in place of its start, and a message, where nobody named a radius and edges part it; else None.

    A circle of that radius may hold a small thing whole. What lies in the middle of an image, or of a mirror, nobody points at.
    """
    init, (wide, *others) = scene.params.init, scene.starts
    alone = scene.pointed and scene.disc is None and not (init.circles or others or scene.has_hints)
    radius, click = init.radius_in(scene.shape), click_radius(scene.shape)
    if init.radius != "auto" or not alone or click >= radius:
        return None
    x, y = wide.control_points.mean(axis=0).tolist()
    window, corner = _window(Circle(x, y, radius), radius + EDGE_REACH)
    edges, domain = scene.edges.edges[window], None if scene.domain is None else scene.domain[window]
    inside = rasterize([FreeForm(wide.control_points - corner, wide.degree)], edges.shape)
    if not edges[inside].any():
        return None
    reached = cv2.dilate(inside.view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    sides = open_sides(free_pixels(edges, domain))[reached]
    if np.count_nonzero(np.bincount(sides)[1:]) < MIN_PARTED:
        return None
    small = circle_start((x, y, click), scene.params)
    before, after = (as_circle(one).enlarged(scene.factor) for one in (wide, small))
    message = f"edges part the start at {before}: it was taken for a click, of radius {after.radius:.4g}"
    return replace(scene, starts=(small,)), message


def _window(start: Circle, reach: float) -> tuple[tuple[slice, slice], tuple[int, int]]:
    """Rows and columns within a distance of a start's centre, and the first column and row."""
    left, top = (max(int(at - reach), 0) for at in (start.x, start.y))
    return np.s_[top : int(start.y + reach) + 1, left : int(start.x + reach) + 1], (left, top)


def _moved(
    start: FreeForm, free: Mask, sides: NDArray[np.int32], most: float, *, widest: bool = False
) -> tuple[Circle, Circle]:
    """A start as a circle, and the cheapest free circle on the side that holds most of it, or on the widest of all sides.

    Under a mirror the widest is meant: a start round the middle shows mostly the robot's own disc.

    Parameters
    ----------
    most : float
        Radii by which it may move. Places are looked at as far as one costs no more than the worst that would be taken, and
        what is free a radius beyond them does not matter.
    """
    old, reach = as_circle(start), min(most + SIZE_WEIGHT * (1 - MIN_KEPT_RADIUS), SEARCH_RADII)
    window, (left, top) = _window(old, (reach + 1) * old.radius + SPARE_MARGIN + 2)
    room = clear_distances(free[window]) - SPARE_MARGIN
    near = FreeForm(start.control_points - (left, top), start.degree)
    under = sides[window][rasterize([near], room.shape)]
    counts = np.bincount(under)[1:]
    if widest:
        counts = np.where(counts > 0, np.bincount(sides.ravel())[1 : len(counts) + 1], 0)
    _, new = nearest_free_circle(near, room, sides[window] == int(counts.argmax()) + 1 if counts.any() else None)
    return old, replace(new, x=new.x + left, y=new.y + top)


def _is_parted(start: FreeForm, scene: Scene) -> bool:
    """Whether edges part the box round a start: mostly they do not, and what lies beyond it need not be known."""
    low, high = start.control_points.min(axis=0).tolist(), start.control_points.max(axis=0).tolist()
    first, end = [int(max(at - 1, 0)) for at in low], [ceil(max(at + 2, 0)) for at in high]
    columns, rows = (slice(max(a - EDGE_REACH, 0), b + EDGE_REACH) for a, b in zip(first, end, strict=True))
    box = np.s_[first[1] - rows.start : end[1] - rows.start, first[0] - columns.start : end[0] - columns.start]
    edges = scene.edges.edges[rows, columns]
    if not edges[box].any():
        return False
    ground = open_ground(free_pixels(edges, None if scene.domain is None else scene.domain[rows, columns]))
    near = FreeForm(start.control_points - first, start.degree)
    return _num_sides(near, connected_parts(ground[box]).labels) > 1


def _within(start: FreeForm, domain: Image) -> Mask:
    """For each pixel of a start, whether it lies in the domain."""
    own = filled(start, domain.shape)
    return domain[own.window()][own.mask] > 0


def _num_sides(start: FreeForm, sides: NDArray[np.int32]) -> int:
    """Number of sides that the rim of a start touches, or the pixel just inside it: samples there move on to that side."""
    points = start.flatten()
    points = np.vstack([points, points[:1]])
    passed = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    steps = np.arange(0.0, passed[-1], 0.5)
    x, y = (np.rint(np.interp(steps, passed, points[:, axis])).astype(np.intp) for axis in (0, 1))
    left, top = (max(int(at.min()) - 1, 0) for at in (x, y))
    sides, x, y = sides[top : max(int(y.max()) + 2, 0), left : max(int(x.max()) + 2, 0)], x - left + 1, y - top + 1
    rim = np.zeros((sides.shape[0] + 2, sides.shape[1] + 2), np.uint8)  # what passes just beside the image touches it
    inside = (x >= 0) & (y >= 0) & (x < rim.shape[1]) & (y < rim.shape[0])
    rim[y[inside], x[inside]] = 1
    near = cv2.dilate(rim, np.ones((3, 3), np.uint8))[1:-1, 1:-1].view(np.bool_)
    return int(np.count_nonzero(np.bincount(sides[near])[1:]))
