"""Starts at the deepest places of the regions found in boxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ffseg.arrays import Plane
from ffseg.image.parts import connected_parts
from ffseg.image.raster import window_of
from ffseg.scene import Scene
from ffseg.starts.initial import box_domain, circle_start
from ffseg.starts.pockets import discs

MIN_PART_FRACTION = 0.1
"""Components of the region in a box that are smaller than this fraction of the largest get no start."""


def within_boxes(scene: Scene) -> Scene:
    """The scene with what its boxes hold for a domain."""
    held = box_domain(scene.boxes, scene.shape)
    return replace(scene, domain=held if scene.domain is None else np.where(held > 0, scene.domain, np.uint8(0)))


def in_boxes(scene: Scene, odds: Plane | None) -> Scene:
    """The scene with starts at the deepest places of the regions found in its boxes, beside circles that are given.

    Parameters
    ----------
    scene : Scene
        As it comes back where nothing tells. Contours that close in start on the boxes themselves, those of methods that do not
        merge on one circle.
    odds : ndarray of float32, shape (H, W), or None
        Log odds of belonging to the objects.
    """
    params = scene.params
    named = scene.starts if params.init.circles else ()
    alone = scene.method is None or not scene.method.merges
    if odds is None or params.contour.balloon < 0 or (named and alone):
        return scene
    inside = odds > 0 if scene.domain is None else (odds > 0) & (scene.domain > 0)
    circles = []
    for box in scene.boxes:
        rows, columns = window = window_of(box, scene.shape)
        region = inside[window]
        components = connected_parts(region)
        large = np.flatnonzero(components.areas >= max(MIN_PART_FRACTION * components.areas.max(), 1))
        found = discs(region, components, large, np.inf)
        circles += [(x + columns.start, y + rows.start, radius) for x, y, radius in (found[:1] if alone else found)]
    return replace(scene, starts=(*named, *(circle_start(one, params) for one in circles))) if circles else scene
