"""The fast-marching level set (LS), the paper's geometric rival: parameters and values round the native core."""

from __future__ import annotations

import numpy as np

from ffseg.arrays import Array
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import unpacked
from ffseg.image.edges import GRADIENT_SCALE, EdgeMap
from ffseg.native import _core
from ffseg.parameters import Parameters
from ffseg.scene import MAX_MARCHING_SIDE, BlockedStartError, Outcome, Progress, Scene, Stats, check_sides

LEVELS = 1 << 16
"""Values a stored gradient can have."""


def run(scene: Scene) -> Outcome:
    """March a front from the start contours until only nodes on edges are left (Eq. 12, Section 5.1).

    Parameters
    ----------
    scene : Scene
        Of its parameters ``levelset`` and ``edges.exponent``; of ``contour`` only the sign of ``balloon``. One node
        moves per iteration: a callback hears of the start and the end.

    Returns
    -------
    outcome : Outcome
        Contours of degree 1, through the ridge of the gradient to sub-pixels. Regions that touch at a corner are two.

        ``iterations`` counts accepted nodes, ``initial_points`` the nodes of the first narrow band,
        ``final_points`` the potentially-on-contour nodes, as in Table 1.

    Raises
    ------
    SegmentationError
        If no node beside the start contour can be entered.

    Notes
    -----
    First-order upwind scheme with unit spacing and speed F_diff (Eq. 8). A node whose speed is not above
    ``levelset.stop_speed`` is potentially on the contour and never accepted.
    Differs: the paper's contour stands where the front stopped, before the edge. Here the stopped front climbs the
    edge while the gradient rises, at most ``levelset.settle`` pixels, and the outline crosses between two nodes where
    the gradient's slope along the grid line changes sign.
    """
    check_sides(scene.image.shape, MAX_MARCHING_SIDE, "method levelset")
    edge_map, starts, params = scene.edges, scene.starts, scene.params
    options = _options(edge_map, params)
    inside = scene.start_region()
    seeds = ~inside if options.closing_in else inside
    flat, ends, counts = _core.level_set(
        edge_map.gradient,
        _slowness(params.edges.exponent, options.stop),
        np.ascontiguousarray(seeds).view(np.uint8),
        edge_map.domain,
        options,
    )
    if counts["initial_band"] == 0 and not seeds.all():
        raise BlockedStartError("move init.center, change init.radius or lower levelset.stop_speed")
    contours = unpacked(flat.reshape(-1, 2), ends, 1)
    if scene.callback is not None:
        scene.callback(Progress(0, starts))
        scene.callback(Progress(counts["accepted"], contours))
    return Outcome(contours, _stats(counts, contours))


def _options(edge_map: EdgeMap, params: Parameters) -> _core.LevelSetOptions:
    """Options of the core; the stop speed as the stored gradient level from which on nodes are on an edge."""
    levelset, options = params.levelset, _core.LevelSetOptions()
    if levelset.stop_speed == "auto":
        threshold = edge_map.thresholds[1]
    else:
        threshold = (1.0 / levelset.stop_speed - 1.0) ** (1.0 / params.edges.exponent)
    options.stop = int(np.clip(np.ceil(threshold * GRADIENT_SCALE), 1, LEVELS))
    options.reach = levelset.settle
    options.min_area = levelset.min_area
    options.closing_in = params.contour.balloon < 0
    return options


def _slowness(exponent: float, stop: int) -> Array:
    """1 / F_diff for every stored gradient level; infinite from `stop` on."""
    slowness = np.full(LEVELS, np.inf)
    slowness[:stop] = 1.0 + (np.arange(stop) / GRADIENT_SCALE) ** exponent
    return slowness


def _stats(counts: dict[str, int], contours: tuple[FreeForm, ...]) -> Stats:
    return Stats(
        iterations=counts["accepted"],
        initial_points=counts["initial_band"],
        final_points=counts["on_contour"],
        patches=sum(c.num_patches for c in contours),
    )
