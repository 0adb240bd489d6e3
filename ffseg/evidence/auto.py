"""The source ``auto``: the image's own edges where they are clear along the whole boundary, else what was learned."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ffseg.contour import Found, bounded, run
from ffseg.evidence.gradient import gradient
from ffseg.evidence.surroundings import expected_overlap
from ffseg.image.boundary import Boundary
from ffseg.image.edges import EdgeMap
from ffseg.image.raster import rasterize
from ffseg.scene import BlockedStartError, Scene
from ffseg.starts.rivals import seeds
from ffseg.starts.sides import on_one_side

MET = 0.5
"""Strength from which on an edge is taken to be met."""

ALIKE, AGREED = 0.1, 0.5
"""Look-alikes beyond a region, in its areas, from which on its edges may part what is one, as the joints of tiles do: what was
learned is asked, and the contour stands if so much overlap is expected of it. Of 300 drawn scenes none has more than .081. Of 29
drawn looks that have, the five of .44 and less have an IoU of .32 (.77 from the prior), the others (.60 and more) .85 (.84)."""

LEVELS, SPARED, EVERY = 4, 0.1, 4
"""Bits of a colour that is looked for, part of the region whose colours are its rarest, and which pixels each way count."""


def auto(scene: Scene) -> EdgeMap:
    """The image's own edges, if a contour on them stands on clear ones all round; else where the prior or the hints end.

    Where much beyond it looks like what it holds, these also tell how sure it is, and decide where they doubt it.

    Parameters
    ----------
    scene : Scene
        Thresholds that are given in ``edges.canny`` are trusted as they are.
    """
    edges = gradient(scene)
    if scene.params.edges.canny != "auto":
        return edges
    found = _trial(replace(_not_told_outside(scene), edges=edges, callback=None))
    if found is None or _holds_clicks_outside(found, scene):
        return _learned(scene, edges)
    mask = rasterize(found.outcome.contours or (), scene.shape)
    found = replace(found, outcome=replace(found.outcome, mask=mask))  # which the result has, too
    if look_alikes(scene.image, mask) < ALIKE:
        return replace(edges, trial=found)
    learned = _learned(scene, edges)
    if learned.odds is None:
        return replace(edges, trial=found)
    if expected_overlap(learned.odds, mask) < AGREED:
        return learned
    return replace(edges, trial=replace(found, scene=replace(found.scene, edges=replace(edges, odds=learned.odds))))


def _learned(scene: Scene, edges: EdgeMap) -> EdgeMap:
    if len(scene.starts) > 1 or scene.clicked_outside:
        from ffseg.evidence.hints import with_hints  # these load forests, which clear edges do not need

        return with_hints(scene, edges)
    from ffseg.evidence.prior import with_prior

    return with_prior(scene, edges)


def _not_told_outside(scene: Scene) -> Scene:
    """The scene without clicks outside: a contour on edges that are clear all round shows whether it needs them."""
    if not scene.clicked_outside:
        return scene
    init = replace(scene.params.init, background=())
    return replace(scene, background=None, params=replace(scene.params, init=init))


def _holds_clicks_outside(found: Found, scene: Scene) -> bool:
    if not scene.clicked_outside:
        return False
    outside = seeds(scene.params.init.background, scene.start_region(), scene.background)
    return bool((rasterize(found.outcome.contours or (), scene.shape) & outside).any())


def _trial(scene: Scene) -> Found | None:
    """What the method finds on the image's own edges, where nobody would doubt them."""
    scene = bounded(scene)
    begin = perf_counter()
    scene, messages, across = on_one_side(scene)
    try:
        outcome = run(scene)
    except BlockedStartError:
        return None
    if outcome.contours is None:
        return None
    boundary = Boundary(outcome.contours, scene.edges)
    evolve_ms = (perf_counter() - begin) * 1e3
    return (
        Found(scene, outcome, messages, evolve_ms, across, boundary) if boundary.is_clear(_least_met(scene)) else None
    )


def look_alikes(image: NDArray[np.uint8], mask: NDArray[np.bool_]) -> float:
    """Area of what lies beyond a region in colours that are common in it, over the area of those in it."""
    height, width = (side // EVERY * EVERY for side in mask.shape)
    sums = sum(image[at:height:EVERY, at:width:EVERY].astype(np.uint16) for at in range(EVERY))  # less of the noise
    few, inside = np.asarray(sums // EVERY >> 8 - LEVELS, np.uint16), mask[:height:EVERY, :width:EVERY]
    colours = few if few.ndim == 2 else few[..., 0] << 2 * LEVELS | few[..., 1] << LEVELS | few[..., 2]
    counts = np.bincount(colours[inside], minlength=1 << 3 * LEVELS)
    rarest = np.sort(counts[counts > 0])
    spared = np.searchsorted(np.cumsum(rarest), SPARED * rarest.sum(), "right")
    common = counts >= (rarest[spared] if len(rarest) else 1)
    every = np.bincount(colours.ravel(), minlength=len(counts))
    return float(every[common].sum() / max(1, counts[common].sum()) - 1) if len(rarest) else 0.0


def _least_met(scene: Scene) -> float:
    """Strength below which parts of a boundary lie in open ground: at shut passages, and in a snake's slits."""
    slits = scene.method is not None and scene.method.slits
    return MET if slits or scene.shuts_passages else 0.0
