"""Starts in the depth of what evidence tells in boxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ffseg.image.parts import parts
from ffseg.image.raster import window_of
from ffseg.scene import Scene
from ffseg.starts.initial import circle_start
from ffseg.starts.pockets import depths, discs

LEAST_PART = 0.1
"""Smaller parts of what evidence tells in a box, measured in its largest, are not worth a start."""


def in_boxes(scene: Scene) -> Scene:
    """The scene with its starts in the depth of what evidence tells in its boxes; the same where nothing tells, or a start does.

    Parameters
    ----------
    scene : Scene
        With its edges. Contours that close in start on the boxes themselves.
    """
    odds, params = scene.edges.odds, scene.params
    if odds is None or params.init.circles or params.contour.balloon < 0:
        return scene
    inside = odds > 0 if scene.domain is None else (odds > 0) & (scene.domain > 0)
    circles = []
    for box in scene.boxes:
        rows, columns = window = window_of(box, scene.shape)
        region = inside[window].astype(np.uint8)
        told = parts(region)
        large = np.flatnonzero(told.areas >= max(LEAST_PART * told.areas.max(), 1))
        found = discs(depths(region), told, large, np.inf)
        if scene.method is None or not scene.method.merges:
            found = found[:1]
        circles += [(x + columns.start, y + rows.start, radius) for x, y, radius in found]
    return replace(scene, starts=tuple(circle_start(one, params) for one in circles)) if circles else scene
