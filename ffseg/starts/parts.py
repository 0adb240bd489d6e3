"""Further starts, in components of the evidence's region that the contour from the first cannot reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ffseg.arrays import Mask
from ffseg.geometry.freeform import FreeForm
from ffseg.image.parts import connected_parts
from ffseg.image.raster import rasterize
from ffseg.scene import Scene
from ffseg.starts.initial import circle_start


def with_parts(scene: Scene) -> Scene:
    """The scene with a start in each component of a told region, where all are meant: those of what clicks have left, or all.

    A start that lies in none of them shows nothing of these, and gives way.
    """
    stays, params = scene.edges.kept, scene.params
    if stays is None and params.region.islands == "all" and scene.edges.odds is not None:
        stays = scene.edges.odds > 0
    if stays is None or _one_contour(scene):
        return scene
    from ffseg.starts.pockets import MIN_PIXELS, discs

    if scene.domain is not None:
        stays = stays & (scene.domain > 0)
    components = connected_parts(stays)
    large = np.setdiff1d(np.flatnonzero(components.areas >= MIN_PIXELS), components.touching(scene.start_region()))
    found = discs(stays, components, large, params.init.radius_in(scene.shape))
    own = tuple(one for one in scene.starts if not found or (rasterize([one], scene.shape) & stays).any())
    return replace(scene, starts=(*own, *(circle_start(circle, params) for circle in found)))


def start_core(scene: Scene) -> Mask:
    """Pixels that show what is inside: the start region or, of contours that close in round the object, its core.

    The core is a disc of 0.6 times the radius of the largest inscribed one: the object is taken to fill that.
    """
    region = scene.start_region()
    if scene.params.contour.balloon >= 0 or not region.any():
        return region
    from ffseg.starts.pockets import discs

    components = connected_parts(region)
    circles = discs(region, components, np.flatnonzero(components.areas), np.inf)
    return rasterize([circle_start(circle, scene.params) for circle in circles], scene.shape)


def _one_contour(scene: Scene) -> bool:
    """Whether no further starts may be added."""
    alone = scene.shuts_passages or scene.params.contour.balloon < 0 or not scene.params.contour.topology
    return alone or scene.method is None or not scene.method.merges


def further_starts(scene: Scene) -> tuple[FreeForm, ...]:
    """Start circles in components of the evidence's region: beyond narrow places, and separate but as sure.

    Parameters
    ----------
    scene : Scene
        With its edges; none tell a region where ``edges.odds`` is None.
    """
    odds, params = scene.edges.odds, scene.params
    if odds is None or _one_contour(scene):
        return ()
    from ffseg.starts.islands import islands  # load what only told regions need
    from ffseg.starts.pockets import starts_beyond

    starts, most = scene.start_region(), params.init.radius_in(scene.shape)
    if scene.domain is not None:
        odds = np.where(scene.domain > 0, odds, np.float32(-1))
    circles = list(starts_beyond((scene.edges.edges == 0) & (odds > -1), starts, most))
    if params.region.islands and scene.edges.source == "prior":  # which parts a model means, its start says
        circles += islands(odds, starts, most)
    return tuple(circle_start(circle, params) for circle in circles)
