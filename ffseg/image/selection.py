"""Which regions and holes of a result are kept: one choice for its mask, its contours, tables and exports."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress

import numpy as np

from ffseg.arrays import Mask
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed
from ffseg.geometry.regions import group_regions
from ffseg.image.components import filled
from ffseg.image.parts import connected_parts
from ffseg.image.polygons import polygons
from ffseg.image.raster import rasterize
from ffseg.native import _core
from ffseg.parameters import Region


def selected(contours: Sequence[FreeForm], mask: Mask, params: Region) -> tuple[tuple[FreeForm, ...], Mask]:
    """The contours and the mask of the regions and holes that are kept.

    Parameters
    ----------
    contours : sequence of FreeForm
        Which `mask` shows.
    mask : ndarray of bool, shape (H, W)
    params : Region
        ``min_area`` and ``largest`` choose among the regions (pixels that hang together over their sides), then
        ``fill_holes`` among the holes (pixels outside that hang together over sides or corners, and not with the border).

    Returns
    -------
    contours : tuple of FreeForm
        Without those that enclose no pixel, no pixel of what is kept, or a hole that is filled. Where they then show
        another mask, as a contour that touches itself round a hole does, outlines of degree 1 of the mask, through the
        places where the contours cross between pixels.
    mask : ndarray of bool, shape (H, W)
    """
    if not (params.largest or params.min_area or params.fill_holes):
        steps = _core.steps_along_axes(*packed(contours))  # no curve exceeds its control polygon
        # By Steinhaus, a contour whose area exceeds its length encloses a pixel centre.
        shown = (abs(one.signed_area) > most or is_shown(one, mask) for one, most in zip(contours, steps, strict=True))
        return tuple(compress(contours, shown)), mask
    kept = _kept(mask, params)
    held = {id(one) for group in group_regions(contours) if is_shown(group.outer, kept) for one in group.contours}
    left = tuple(one for one in contours if id(one) in held and is_shown(one, kept))
    if params.fill_holes:
        height, width = mask.shape
        frame = FreeForm(np.array([[-1, -1], [-1, height], [width, height], [width, -1]], np.float64), 1)
        twice = rasterize((*left, frame), mask.shape)  # what two contours enclose: islands in a hole that is filled
        left = tuple(one for one in left if one.signed_area < 0 or is_shown(one, ~twice))
    if (rasterize(left, mask.shape) != kept).any():
        rings = (ring for polygon in polygons(kept, left) for ring in polygon.rings)
        left = tuple(FreeForm(ring, 1) for ring in rings)
    return left, kept


def count_regions(mask: Mask) -> tuple[int, int]:
    """Numbers of regions and holes in a mask, connected as in `selected`."""
    points, offsets = _core.mask_outlines(np.ascontiguousarray(mask).view(np.uint8))
    if len(offsets) < 2:
        return 0, 0
    x, y = points.reshape(-1, 2).T
    ahead = np.arange(1, len(x) + 1)
    ahead[offsets[1:] - 1] = offsets[:-1]
    areas = np.add.reduceat((x - x[ahead]) * (y + y[ahead]), offsets[:-1])
    regions = int(np.count_nonzero(areas > 0))
    return regions, len(areas) - regions


def _kept(mask: Mask, params: Region) -> Mask:
    regions = connected_parts(mask)
    chosen = regions.areas >= max(params.min_area, 1)
    if params.largest:
        chosen[np.argsort(-regions.areas, kind="stable")[params.largest :]] = False
    kept: Mask = chosen[regions.labels]
    holes = connected_parts(~np.pad(kept, 1), corners=True)
    small = holes.areas < params.fill_holes
    small[[0, holes.labels[0, 0]]] = False  # not the outside
    return np.asarray(kept | small[holes.labels][1:-1, 1:-1], np.bool_)


def is_shown(contour: FreeForm, mask: Mask) -> bool:
    """Whether a mask has a pixel of the region of an outer contour, or lacks one inside a hole."""
    own = filled(contour, mask.shape)
    inside = mask[own.window()][own.mask]
    return bool(inside.any()) if contour.signed_area > 0 else not inside.all()
