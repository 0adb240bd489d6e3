"""The source ``alike``: all things that look like the one that the first start lies in, by a forest grown on the image itself.

What the first start holds is found as it is by default. Its pixels, those of further start circles, and those of a ring round it
and of clicks outside teach a forest, which sees colours and textures, but no place and no start; it tells the rest of the image.
All clicks then correct what it says.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ffseg.arrays import Mask, Plane
from ffseg.contour import ContourResult, contour, trial_result, tried
from ffseg.evidence.auto import auto
from ffseg.evidence.clicks import with_clicks
from ffseg.evidence.features import TEXTURE_FEATURES, enlarged, reduced_mean, startless_planes
from ffseg.evidence.gradient import gradient
from ffseg.evidence.growing import boosted_on
from ffseg.evidence.maps import odds_edges
from ffseg.evidence.prior import appearance_of
from ffseg.evidence.recent import Recent
from ffseg.geometry.freeform import FreeForm
from ffseg.image.appearance import size_to_see
from ffseg.image.edges import EdgeMap
from ffseg.image.free import distances
from ffseg.image.raster import rasterize
from ffseg.scene import Scene
from ffseg.starts.boxes import within_boxes
from ffseg.starts.initial import circle_start, middles
from ffseg.starts.moved import as_circle
from ffseg.starts.rivals import seeds

TREES = 40
"""With twenty it promises .81 of the IoU for .88, with eighty as much as with forty."""

SIDE_PIXELS = 1500
"""Pixels of either side that teach the forest, at most: with twice as many it tells the same, with half as many less."""

MIN_SHARE = 0.8
"""Part of a reduced pixel that lies on one side, from which on it teaches that. With .6 half as many clicks again do harm."""

RING, MIN_RING = 0.2, 2.0
"""Width of the ring that lies outside: in parts of the depth of what the first start holds, and reduced pixels at least. Wider
ones hold other things: with .5 and 1 an IoU of .72 from two things was .70 and .65."""

CACHED_TOLD = 2
"""What the forest tells of the reduced copy, without the last circle, which the hand moves: that only corrects it there."""


def alike_edges(scene: Scene) -> EdgeMap:
    """Edges of all that looks like what the first start holds; edges of that alone if nothing is seen outside it.

    Raises
    ------
    UsageError
        If LightGBM, which grows the forest, is not installed.
    SegmentationError
        If the first start can hold nothing, or a click outside lies in one.
    """
    first, further = _first(scene)
    edges = _edges_by_default(first)
    found = trial_result(edges) or contour(replace(first, edges=edges))
    shown = found.region() if found.outcome.mask is None else found.outcome.mask
    narrow, further = _narrowed(scene, first, found, further)
    inside = rasterize(further[:-1] if scene.draft else further, scene.shape)
    outside = seeds(scene.params.init.background, inside, scene.background)
    known = (shown & ~outside, inside, outside)
    make = partial(alike_odds, scene, *known)
    odds = _told.of(scene.image, (), make, *known) if scene.draft else make()
    if odds is None:
        return edges
    own = gradient(scene)
    if narrow.has_hints:
        edges = with_clicks(narrow, own, odds)
    else:
        edges = odds_edges(odds, scene.params.region.probability, own, "alike")
    if narrow is scene:
        return edges
    return tried(contour(replace(narrow, edges=edges, callback=None)), *found.messages[:1])


_told = Recent[Plane | None](CACHED_TOLD)


def _first(scene: Scene) -> tuple[Scene, tuple[FreeForm, ...]]:
    """The scene with what is to be found by default: its boxes, its mask or the first of its starts; and the other starts."""
    init, count = scene.params.init, len(scene.params.init.circles)
    shown = 0 if scene.boxes else min(count, 1)
    params = replace(
        scene.params,
        init=replace(init, circles=init.circles[:shown]),
        region=replace(scene.params.region, islands=True),
    )
    starts = middles(params, scene.shape) if scene.boxes else scene.starts[: shown or None]
    first = replace(scene, params=params, starts=starts, callback=None)
    return within_boxes(first) if scene.boxes else first, scene.starts[shown:count]


def _narrowed(
    scene: Scene, first: Scene, found: ContourResult, further: tuple[FreeForm, ...]
) -> tuple[Scene, tuple[FreeForm, ...]]:
    """The scene with starts without a radius of their own no wider than the first was in the end; and those after it."""
    begun, named = found.scene.starts[: len(first.starts)], scene.params.init.named_radii
    if scene.boxes or scene.start_mask is not None or named[0] or begun == first.starts:
        return scene, further
    radius = as_circle(begun[0]).radius
    further = tuple(
        one if wide else circle_start((circle.x, circle.y, min(circle.radius, radius)), scene.params)
        for one, circle, wide in zip(further, map(as_circle, further), named[1:], strict=True)
    )
    return replace(scene, starts=(*begun, *further)), further


def _edges_by_default(scene: Scene) -> EdgeMap:
    if not scene.boxes:
        return auto(scene)
    from ffseg.evidence.box import box_edges  # loads features of the box's forest

    return box_edges(scene)


def alike_odds(scene: Scene, shown: Mask, inside: Mask, outside: Mask) -> Plane | None:
    """Log odds that pixels lie in things that look like what is shown; None where nothing shows one of both sides.

    Parameters
    ----------
    shown : ndarray of bool, shape (H, W)
        One of the things.
    inside, outside : ndarray of bool, shape (H, W)
        What else is known to lie there.

    Returns
    -------
    ndarray of float32, shape (H, W), or None
    """
    depth = float(distances(shown).max())
    seen = appearance_of(scene, size_to_see(scene.shape, depth))
    share, known, beyond = (reduced_mean(one.astype(np.float32), seen.factor) for one in (shown, inside, outside))
    apart = share <= 1 - MIN_SHARE
    away = distances(apart)
    ring = (away > 0) & (away <= max(MIN_RING, RING * depth / seen.factor))
    sides = [ring & (known == 0) | (beyond >= MIN_SHARE), (share >= MIN_SHARE) | (known >= MIN_SHARE)]
    if not all(side.any() for side in sides):
        return None
    rng = np.random.default_rng(0)
    chosen = [rng.permutation(np.flatnonzero(side))[:SIDE_PIXELS] for side in sides]
    planes, at = startless_planes(seen, TEXTURE_FEATURES), np.concatenate(chosen)
    rows = np.ascontiguousarray(planes.reshape(len(planes), -1)[:, at].T)
    forest = boosted_on(rows, np.arange(len(at)) >= len(chosen[0]), TREES, TEXTURE_FEATURES)
    return enlarged(forest.log_odds(planes), seen.factor, scene.shape)
