"""Start contours: a circle, or several circles, boxes, or the outlines in a mask image."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ffseg.arrays import Image, Points
from ffseg.errors import SegmentationError
from ffseg.geometry.freeform import FreeForm
from ffseg.image.checked import require_size
from ffseg.image.outlines import outlines
from ffseg.image.raster import window_of
from ffseg.parameters import MIN_START_RADIUS, Box, Circle, Init, Parameters, Point

MIDDLE_RADIUS_FRACTION = 0.25
"""Radius of the start circle in the middle of a box, as a fraction of the box's shorter side. Used where the evidence
offers no better place."""


def start_contours(
    shape: tuple[int, int],
    params: Parameters,
    start_mask: Image | None = None,
    center: tuple[float, float] | None = None,
    domain: Image | None = None,
) -> tuple[FreeForm, ...]:
    """Start contours of a segmentation, outer ones with positive area.

    Parameters
    ----------
    shape : tuple of int
        (H, W) of the image.
    params : Parameters
        ``init`` says where; ``contour.degree`` and ``contour.patches`` how.
    start_mask : ndarray of uint8, shape (H, W), optional
        Nonzero inside the start regions; takes the place of circles and boxes.
    center : tuple of float, optional
        What ``init.center: auto`` stands for; without it the image centre.
    domain : ndarray of uint8, shape (H, W), optional
        Nonzero where the contour may go: what a start mask has there counts, if it has anything there.

    Raises
    ------
    SegmentationError
        If a start lies outside the image, the mask has another size or is empty, or there are others beside it.
    """
    circles, boxes = params.init.circles_in(shape), params.init.boxes
    if start_mask is not None and (circles or boxes):
        raise SegmentationError(
            f"a start mask and init.{'boxes' if boxes else 'circles'} do not go together; leave out one"
        )
    if start_mask is not None:
        return _from_mask(start_mask, shape, params, domain)
    if not circles and not boxes:
        one_of_many = center is None and (params.init.background or params.region.islands == "all")
        radius = params.init.click_radius_in(shape) if one_of_many else params.init.radius_in(shape)
        circles = ((*_center(shape, params, center), radius),)
    for x, y, radius in circles:
        _check_inside((x, y), shape, f"the start circle at ({x:g}, {y:g}), radius {radius:g}")
    for box in boxes:
        _check_box(box, shape)
    if params.contour.balloon < 0 and boxes:  # circles in them are clicks
        for x, y in circles_beside(params.init):
            raise SegmentationError(
                f"the start circle at ({x:g}, {y:g}) lies in no box, and contours that close in begin at boxes; "
                "move it into one, or leave it out"
            )
        return tuple(_box(box, params) for box in boxes)
    return tuple(circle_start(circle, params) for circle in circles) or middles(params, shape)


def circles_beside(init: Init) -> tuple[Point, ...]:
    """Centres of the circles that lie in no box, where there are boxes: what these leave out is not all background then."""
    return tuple(
        (x, y)
        for x, y, *_ in init.circles
        if init.boxes and not any(x0 <= x <= x1 and y0 <= y <= y1 for x0, y0, x1, y1 in init.boxes)
    )


def box_domain(boxes: tuple[Box, ...], shape: tuple[int, int]) -> Image:
    """255 where a pixel's centre lies in a box, 0 elsewhere; shape (H, W)."""
    found = np.zeros(shape, np.uint8)
    for box in boxes:
        found[window_of(box, shape)] = 255
    return found


def _check_box(box: Box, shape: tuple[int, int]) -> None:
    x0, y0, x1, y1 = box
    what = f"the box [{x0:g}, {y0:g}, {x1:g}, {y1:g}]"
    if not (x0 < x1 and y0 < y1):
        raise SegmentationError(f"{what} needs x0 < x1 and y0 < y1")
    _check_inside(((x0 + x1) / 2, (y0 + y1) / 2), shape, what)
    if any(part.stop <= part.start for part in window_of(box, shape)):
        raise SegmentationError(f"{what} holds no pixel's centre; make it larger")


def middles(params: Parameters, shape: tuple[int, int]) -> tuple[FreeForm, ...]:
    """Start circles in the middles of the boxes."""
    return tuple(circle_start(_middle(box, shape), params) for box in params.init.boxes)


def _middle(box: Box, shape: tuple[int, int]) -> Circle:
    """A circle in the middle of what the image has of a box."""
    rows, columns = window_of(box, shape)
    least = min(part.stop - part.start for part in (rows, columns))
    y, x = ((part.start + part.stop - 1) / 2 for part in (rows, columns))
    return x, y, max(MIN_START_RADIUS, MIDDLE_RADIUS_FRACTION * least)


def circle_start(circle: tuple[float, float, float], params: Parameters) -> FreeForm:
    """A start circle, x, y and radius in pixels, with the patches and the degree that `params` ask for."""
    return _circle(*circle, params.contour.patches, params.contour.degree)


@lru_cache(maxsize=64)
def _circle(x: float, y: float, radius: float, patches: int, degree: int) -> FreeForm:
    """The circle most images of a batch begin with."""
    return FreeForm.circle((x, y), radius, patches, degree)


def _center(shape: tuple[int, int], params: Parameters, center: tuple[float, float] | None) -> tuple[float, float]:
    if params.init.center != "auto":
        return params.init.center
    if center is not None:
        return center
    return ((shape[1] - 1) / 2, (shape[0] - 1) / 2)


def _check_inside(point: tuple[float, float], shape: tuple[int, int], what: str) -> None:
    height, width = shape
    if not (-0.5 <= point[0] <= width - 0.5 and -0.5 <= point[1] <= height - 0.5):
        raise SegmentationError(f"{what} has its centre outside the image of {width} x {height} pixels; move it inside")


def check_background(shape: tuple[int, int], params: Parameters, background: Image | None) -> None:
    """Refuse points outside the region that lie outside the image, and a mask of them of another size.

    Raises
    ------
    SegmentationError
    """
    for x, y, *_ in params.init.background:
        _check_inside((x, y), shape, f"the background seed at ({x:g}, {y:g})")
    if background is not None:
        require_size("the background mask", background, shape, "init.background_mask must have the image's size")


def _box(box: Box, params: Parameters) -> FreeForm:
    x0, y0, x1, y1 = box
    return _along(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]), params)


def _from_mask(mask: Image, shape: tuple[int, int], params: Parameters, domain: Image | None) -> tuple[FreeForm, ...]:
    require_size("the start mask", mask, shape, "init.mask must have the image's size")
    inside = mask if domain is None else np.where(domain > 0, mask, np.uint8(0))
    contours = starts_from_mask(inside if inside.any() else mask, params)
    if not contours:
        raise SegmentationError("the start mask has no pixel set; init.mask must be nonzero inside the start region")
    return contours


def starts_from_mask(mask: Image, params: Parameters) -> tuple[FreeForm, ...]:
    """Contours along the outlines of a mask, shape (H, W), nonzero inside; none if it is empty."""
    return tuple(_along(polygon, params) for polygon in outlines(mask))


def _along(polygon: Points, params: Parameters) -> FreeForm:
    """A polygon as patches with corners kept: straight patches no longer than half the split threshold."""
    degree, longest = params.contour.degree, params.contour.split_threshold / 2
    points = []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        pieces = max(1, int(np.ceil(np.hypot(*(b - a)) / longest)))
        steps = np.arange(pieces * degree)[:, None] / (pieces * degree)
        points.append(a + steps * (b - a))
    return FreeForm(np.concatenate(points), degree)
