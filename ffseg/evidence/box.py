"""The source ``box``: the object inside a box, by a forest grown on drawings and a graph cut by colours.

Each box is looked at with its surroundings at one size, so that an image and its enlargement give the same. The forest
uses the features of the prior with everything outside the box as the start, and the same features seen from the core of
the box. It is part of the package; ``python -m ffseg.learning.grow`` makes it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image, Mask, Plane
from ffseg.errors import SegmentationError
from ffseg.evidence.clicks import with_clicks
from ffseg.evidence.features import (
    BARRIER_FEATURES,
    SHAPELESS_FEATURES,
    Features,
    barriers,
    enlarged,
    features,
    geodesic,
)
from ffseg.evidence.forest import shipped
from ffseg.evidence.gradient import gradient
from ffseg.evidence.maps import blurred, logarithm, odds_edges, probability
from ffseg.evidence.prior import (
    MAX_LOG_ODDS,
    PIXEL_FEATURES,
    SMOOTHING,
    appearance_of,
    cautious_prior,
    write_pixel_features,
)
from ffseg.evidence.recent import Recent
from ffseg.evidence.surroundings import (
    COLOURS,
    STRIDE,
    SURROUNDINGS_FEATURES,
    strided,
    surroundings,
    voted,
    write_strided,
)
from ffseg.image.appearance import Appearance
from ffseg.image.edges import EdgeMap, ScoreCalibration
from ffseg.image.opencv_peers import grabcut_mask
from ffseg.image.raster import rasterize, window_of
from ffseg.image.resized import resized
from ffseg.native import _core
from ffseg.parameters import Point
from ffseg.scene import Scene
from ffseg.starts.initial import box_domain, circle_start

MODEL = Path(__file__).with_name("box.ffmodel")

WORKING_SIZE = 256
"""Pixels of the longer side of a box with its surroundings in the reduced image."""

SURROUND_WIDTH = 0.3
"""Width of the surroundings, as a fraction of the mean side of the box."""

MIN_SIDE = 8
"""Pixels of the shorter side in the reduced image, however narrow the box."""

LOG_ODDS_OFFSET = 0.5
"""Added to the log odds of the forest: objects fill more of their boxes than it predicts. The best of 0.25, 0.5 and 0.75
on drawings that no figure is taken from."""

CUT_SIZE, CUT_THRESHOLD, CUT_LOG_ODDS, MIN_CUT_OVERLAP = 200, -1.0, 3.0, 0.5
"""Graph cut by colours: longer side of the reduced image in pixels, log odds above which a pixel starts as object,
weight of the result in log odds, and its smallest overlap with the region of the forest to count at all. Chosen on
the same drawings; gains .01 on them."""

CACHED_LOOKS = 16
"""Looks at boxes, and what lies beside them, that are kept for the next click, or the next box."""

CORE_RADIUS = 0.4
"""Semi-axes of the ellipse that is taken as the core of the object, as fractions of half the box's sides."""

MODEL_WEIGHT, MODEL_SHARPNESS = 2.0, 8.0
"""Weight of a model's log odds beside those of the box's forest, where it finds nothing round the box; and the power of one less
the ratio of its mean probabilities round the box and in it, by which that falls. Chosen among 1 to 3 and 1 to 8 on drawings
that no figure is taken from, and on photographs at even places."""

BOX_SLOPE, BOX_ODDS_RATIO = 0.53, 1.2
"""As `ScoreCalibration` has them, of the overlap promised in boxes, with a model or without: what logistic regressions give for
1033 results of drawings (.46 to .59 and .9 to 1.4; with models .6 and 2), boxes as tight as can be, as quick hands draw them,
and 5 to 20 % too large (``python -m tests.campaigns.scoring``)."""

CALIBRATION = ScoreCalibration(BOX_SLOPE, BOX_ODDS_RATIO)

BOX_FEATURES = (
    "box_x",
    "box_y",
    "box_middle",
    "box_border",
    *(f"core_{name}" for name in BARRIER_FEATURES),
    "core_way",
    "core_or_outside",
    "core_likeness",
    "likelier",
    "likelier~3",
)
"""Planes that tell of the box: places in parts of its halves, and the core seen against what lies outside."""

FEATURE_NAMES = (*PIXEL_FEATURES, *SURROUNDINGS_FEATURES, *BOX_FEATURES)


def box_edges(scene: Scene) -> EdgeMap:
    """Edges where the object in each box ends, corrected by clicks; the image's own if nothing differs from outside.

    Raises
    ------
    SegmentationError
        If there is no box.
    """
    own = gradient(scene)
    if not scene.boxes:
        raise SegmentationError("edges.source: box needs a box; give one with --box, or set init.boxes")
    seen = looks(scene)
    odds = box_odds(scene, seen, _beside(scene, seen))
    if scene.clicked_outside or scene.params.init.circles:
        return with_clicks(scene, own, odds, calibration=CALIBRATION)
    edges = odds_edges(odds, scene.params.region.probability, own, "box")
    return replace(edges, calibration=CALIBRATION)


Look = tuple[tuple[slice, slice], Plane]
"""Rows and columns of a box, and the log odds of the object for each of its pixels."""


def looks(scene: Scene) -> tuple[Look, ...]:
    """What is seen in each box of a scene; in one that leaves nothing outside, nothing is."""
    found, cut = list[Look](), not scene.draft
    for box in scene.boxes:
        rows, columns = window = window_of(box, scene.shape)
        part, key = (
            scene.image[surrounded(window, scene.shape)],
            (rows.start, rows.stop, columns.start, columns.stop, cut),
        )
        odds = _looks.of(part, key, partial(in_box, scene.image, window, cut=cut))
        found += [] if odds is None else [(window, odds)]
    return tuple(found)


_looks = Recent[Plane | None](CACHED_LOOKS)


def _beside(scene: Scene, seen: Iterable[Look]) -> Plane | None:
    """Log odds of what the first circle that no look has seen lies on, shape (H, W), if there is one; the others correct them."""
    for x, y, radius in scene.params.init.circles_in(scene.shape):
        if not any(_in_window((y, x), window) for window, _ in seen):
            disc = rasterize([circle_start((x, y, radius), scene.params)], scene.shape)
            return _looks.of(scene.image, "beside", partial(cautious_prior, appearance_of(scene), disc), disc)
    return None


def _in_window(place: Point, window: tuple[slice, slice]) -> bool:
    """Whether the nearest pixel of a place (row, column) lies in rows and columns."""
    return all(part.start - 0.5 <= at <= part.stop - 0.5 for at, part in zip(place, window, strict=True))


def box_odds(scene: Scene, seen: Iterable[Look], beside: Plane | None) -> Plane:
    """Log odds of the objects in the boxes of a scene, from what is seen in each, shape (H, W).

    Those of a pixel in several boxes are the largest; where none has seen, they are those given `beside` them, or else, as
    outside the domain, ``-MAX_LOG_ODDS``.
    """
    odds, left = np.full(scene.shape, np.float32(-MAX_LOG_ODDS)), np.ones(scene.shape, np.bool_)
    for window, inside in seen:
        np.maximum(odds[window], inside, out=odds[window])
        left[window] = False
    if beside is not None:
        odds = np.where(left, beside, odds)
    if scene.domain is not None:
        odds[scene.domain == 0] = -MAX_LOG_ODDS
    return odds


def with_said(scene: Scene, seen: Iterable[Look], said: Plane) -> Iterator[Look]:
    """What is seen in each box with a model's log odds, shape (H, W), added as far as they tell it from what lies beside it."""
    beside = box_domain(scene.boxes, scene.shape) == 0
    for window, inside in seen:
        yield window, inside + np.float32(trust_in(said, window, beside)) * said[window]


def trust_in(said: Plane, window: tuple[slice, slice], beside: Mask) -> float:
    """Weight of a model's log odds in a box: less the more of what lies round it, and in no box, the model takes for inside.

    Parameters
    ----------
    said : ndarray of float32, shape (H, W)
        Log odds by the model.
    window : tuple of slice
        Rows and columns of the box.
    beside : ndarray of bool, shape (H, W)
        Pixels in no box.
    """
    near = surrounded(window, said.shape)
    if not beside[near].any():
        return MODEL_WEIGHT
    round_it, in_it = float(probability(said[near])[beside[near]].mean()), float(probability(said[window]).mean())
    return MODEL_WEIGHT * float(max(0.0, 1 - round_it / in_it) ** MODEL_SHARPNESS)


def in_box(image: Image, window: tuple[slice, slice], *, cut: bool) -> Plane | None:
    """Log odds of the object in a box; None where that leaves nothing outside.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey or BGR.
    window : tuple of slice
        Rows and columns of the box, some of each.
    cut : bool
        Whether a graph cut has its say, too, which takes two thirds of the time. While the hand moves it has none: the regions of
        130 boxes on drawings and photographs then have an IoU of .94 with those when it rests.

    Returns
    -------
    ndarray of float32
        Logarithm of the odds of belonging to the object, for each pixel of the box.
    """
    view = box_view(image, window)
    if view is None:
        return None
    forest = shipped(MODEL, FEATURE_NAMES).inside
    odds = np.clip(forest.log_odds(all_planes(view)) + np.float32(LOG_ODDS_OFFSET), -MAX_LOG_ODDS, MAX_LOG_ODDS)
    odds[view.seen.inside[::STRIDE, ::STRIDE] > 0] = -MAX_LOG_ODDS
    return view.enlarged(blurred(_with_cut(odds, image, view) if cut else voted(odds, view.seen), SMOOTHING / STRIDE))


def _with_cut(odds: Plane, image: Image, view: BoxView) -> Plane:
    """Smoothed log odds, combined with a graph cut by colours if that finds much the same region."""
    found = voted(odds, view.seen)
    height, width = (max(MIN_SIDE, side * CUT_SIZE // WORKING_SIZE) for side in view.seen.shape)
    shape = height, width
    outside = resized(view.seen.inside, shape) > 0
    likely, picture = (resized(found, shape) > CUT_THRESHOLD) & ~outside, resized(image[view.outer], shape)
    if not likely.any() or likely.all() or not np.ptp(picture, axis=(0, 1)).any():  # of one colour: seconds for nothing
        return found
    inside = resized(grabcut_mask(picture, likely, outside, 1).astype(np.float32), odds.shape)
    both, either = (np.count_nonzero(joint(found > 0, inside > 0.5)) for joint in (np.logical_and, np.logical_or))
    return found + np.float32(CUT_LOG_ODDS) * (2 * inside - 1) if both > MIN_CUT_OVERLAP * either else found


@dataclass(frozen=True, slots=True, eq=False)
class BoxView:
    """A box with its surroundings at the working size: the input of the forest.

    Attributes
    ----------
    seen : Features
        With what lies outside the box for a start.
    outer, inner : tuple of slice
        Rows and columns of the image that are looked at, and of the box in these.
    away : tuple of ndarray of float32, shape (1, w) and (h, 1)
        Distance of columns and rows from the box's middle, in parts of its halves.
    """

    seen: Features
    outer: tuple[slice, slice]
    inner: tuple[slice, slice]
    away: tuple[Plane, Plane]

    def at(self, plane: NDArray[Any]) -> NDArray[Any]:
        """Every `STRIDE`-th pixel of what is looked at, of a plane of the image, shape (H, W)."""
        part = plane[self.outer]
        rows, columns = (
            ((np.arange(0, size, STRIDE) + 0.5) * side / size).astype(np.intp)
            for size, side in zip(self.seen.shape, part.shape, strict=True)
        )
        found: NDArray[Any] = part[rows[:, None], columns]
        return found

    def enlarged(self, plane: Plane) -> Plane:
        """A plane of every `STRIDE`-th pixel, for each pixel of the box."""
        rows, columns = self.outer
        size = (rows.stop - rows.start, columns.stop - columns.start)
        whole = resized(enlarged(plane, 1, self.seen.shape, STRIDE), size)
        return whole[self.inner]


def box_view(image: Image, window: tuple[slice, slice]) -> BoxView | None:
    """A box, given as its rows and columns, and its surroundings; None where it leaves nothing outside."""
    rows, columns = surrounded(window, image.shape)
    part = image[rows, columns]
    gain = WORKING_SIZE / max(part.shape[:2])
    height, width = (max(MIN_SIDE, round(gain * side)) for side in part.shape[:2])
    inner = tuple(slice(a.start - b.start, a.stop - b.start) for a, b in zip(window, (rows, columns), strict=True))
    y, x = (
        np.abs((np.arange(size, dtype=np.float32) + 0.5) * side / size - (at.start + at.stop) / 2)
        * np.float32(2 / (at.stop - at.start))
        for size, side, at in zip((height, width), part.shape, inner, strict=False)
    )
    away = x[None, :], y[:, None]
    outside = np.maximum(*away) > 1
    if not outside.any():
        return None
    small = resized(part, (height, width))
    return BoxView(
        features(Appearance(small), outside, SHAPELESS_FEATURES),
        (rows, columns),
        (inner[0], inner[1]),
        away,
    )


def surrounded(window: tuple[slice, slice], shape: tuple[int, ...]) -> tuple[slice, slice]:
    """A box with its surroundings, as rows and columns of an image of this shape (H, W, ...)."""
    wide = max(2, round(SURROUND_WIDTH * sum(part.stop - part.start for part in window) / 2))
    rows, columns = (
        slice(max(part.start - wide, 0), min(part.stop + wide, size)) for part, size in zip(window, shape, strict=False)
    )
    return rows, columns


def all_planes(view: BoxView) -> Plane:
    """The planes that the forest takes, in its order, of every `STRIDE`-th pixel: `PIXEL_FEATURES`, the surroundings, the box."""
    seen = view.seen
    planes = np.empty((len(FEATURE_NAMES), *seen.inside[::STRIDE, ::STRIDE].shape), np.float32)
    write_pixel_features(seen, planes[: len(PIXEL_FEATURES)])
    beside, own = planes[len(PIXEL_FEATURES) : -len(BOX_FEATURES)], planes[-len(BOX_FEATURES) :]
    surroundings(seen, beside)
    x, y = (part[::STRIDE, ::STRIDE] for part in view.away)
    own[0], own[1], own[2], own[3] = x, y, np.hypot(x, y), np.maximum(x, y)
    core = (own[2] <= max(CORE_RADIUS, float(own[2].min()))).astype(np.uint8)
    _from_core(seen, core, beside[SURROUNDINGS_FEATURES.index("way")], own[4:])
    return planes


def _from_core(seen: Features, core: Image, others_way: Plane, out: Plane) -> None:
    """Write the features seen from the core, and how much likelier a colour is in the core than outside the box."""
    planes = np.empty((1 + len(COLOURS), *core.shape), np.float32)
    write_strided(seen, ("slope@1.5", *COLOURS), planes)
    length, place = out[len(BARRIER_FEATURES)], len(BARRIER_FEATURES) + 1
    barriers(planes[0], core, out[: len(BARRIER_FEATURES)])
    geodesic(planes[0], core, length)
    out[place] = logarithm((length + 1) / (others_way + 1))
    alike, other = np.empty((2, *core.shape), np.float32)
    _core.evidence_likelihood(planes[1:], core, alike)
    _core.evidence_likelihood(planes[1:], strided(seen.inside), other)
    _core.evidence_blur(alike, 1.0 / STRIDE, out[place + 1])
    _core.evidence_blur(alike - other, 1.0 / STRIDE, out[place + 2])
    _core.evidence_blur(alike - other, 3.0 / STRIDE, out[place + 3])
