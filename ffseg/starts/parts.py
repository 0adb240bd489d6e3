"""Further starts, in parts of a told region that the contour from the first cannot reach."""

from __future__ import annotations

import numpy as np

from ffseg.geometry.freeform import FreeForm
from ffseg.scene import Scene
from ffseg.starts.initial import circle_start


def parts(scene: Scene) -> tuple[FreeForm, ...]:
    """Start circles in the parts of a region that evidence tells: beyond narrow places, and apart from it but as sure.

    Parameters
    ----------
    scene : Scene
        With its edges; none tell a region where ``edges.odds`` is None.
    """
    odds, params = scene.edges.odds, scene.params
    one_contour = scene.shuts_passages or params.contour.balloon < 0 or not params.contour.topology
    if odds is None or one_contour or scene.method is None or not scene.method.merges:
        return ()
    from ffseg.starts.islands import islands  # load what only told regions need
    from ffseg.starts.pockets import starts_beyond

    starts, most = scene.start_region(), params.init.radius_in(scene.shape)
    if scene.domain is not None:
        odds = np.where(scene.domain > 0, odds, np.float32(-1))
        starts &= scene.domain > 0
    walls = np.where((scene.edges.edges == 0) & (odds > -1), np.uint8(0), np.uint8(255))
    circles = list(starts_beyond(walls, starts, most))
    if params.region.islands and scene.edges.source == "prior":  # which parts a model means, its start says
        circles += islands(odds, starts, most)
    return tuple(circle_start(circle, params) for circle in circles)
