"""Log odds after the last of several clicks (`ffseg.evidence.clicks`), by a forest grown on drawings.

The seeds inside (start regions) and outside (``init.background``) give the colours of both sides of this image and
geodesic distances from them. The features of the forest are those of the prior seen from the seeds inside; the prior's
log odds (or those of a model or a map); the same distances and colours seen from the seeds outside; and, of the last
click, the log odds before it, its depth in the error and the distances from it. So the forest has learned to correct the
errors that simulated users click, of the prior and of models. It is part of the package; ``python -m ffseg.learning.grow``
makes it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ffseg.arrays import Image, Mask, Plane
from ffseg.evidence import prior
from ffseg.evidence.features import BARRIER_FEATURES, Features, barriers, broadened, geodesic, reduced_region
from ffseg.evidence.forest import shipped
from ffseg.evidence.maps import blurred, logarithm
from ffseg.evidence.prior import MAX_LOG_ODDS, MIN_START_RADIUS, SMOOTHING
from ffseg.evidence.surroundings import (
    STRIDE,
    colours_of,
    likelihood_ratio,
    likeness,
    steepest,
    strided,
    voted,
)
from ffseg.image.free import distances
from ffseg.image.parts import Parts, scattered
from ffseg.native import _core

MODEL = Path(__file__).with_name("hints.ffmodel")

ABSENT_DISTANCE = 2.0
"""Distance to a side that has no clicks, in units of the square root of the image area."""

EQUAL_LOG_ODDS = 1e-3
"""If the colours on both sides differ by less than this, in log odds, the clicks show the same colours (equal ones
differ by rounding only)."""

DISTANCE_OFFSET = 0.01
"""Added to distances, in the same unit, before taking logarithms."""

HELD_RADIUS = 3.0
"""Pixels round a click that belong to its side: a smaller start would lie on the edge of its own evidence and leak over
it."""

MIN_RADIUS_FRACTION, USUAL_RADIUS = 0.75, 0.01
"""A click is a sample of its side's colours if its radius is at least this fraction of the widest click's, or of a usual
click's (a fraction of the longer side of the image) where the widest is wider. Narrower clicks correct a rim and lie
on its edge: they fix the pixels that they cover. On 55 drawings .60, .75 and .90 do equally well; on 55 others half
as many clicks lower the IoU as without this rule."""

ELSEWHERE_WEIGHT, COLOUR_WEIGHT = 0.3, 1.0
"""Away from where it counts, the first click outside, the first to show both sides, changes the log odds by this
fraction. The log likelihood ratio of colours, estimated after it, is added with the second weight: with a click in
each, two plain halves are told apart. A fraction of .5 gains .01 on drawings, and loses more with models on roads."""

TWO_SIDED_FEATURES = (
    "prior",
    *(f"outside_{name}" for name in BARRIER_FEATURES),
    "outside_way",
    "inside_or_outside",
    "barrier_or_outside",
    "outside_likeness",
    "likelier",
    "likelier~3",
    "guessed",
    "near_inside",
    "near_outside",
    "nearer",
)
LAST_CLICK_FEATURES = (
    "before",
    "side",
    *(f"click_{name}" for name in BARRIER_FEATURES),
    "click_way",
    "click_likeness",
    "click_distance",
    "click_depth",
    "click_or_inside",
    "click_or_outside",
)
"""Features of the last click: the log odds before it, its side, what stands on ways from it, and its depth in the error."""

FEATURE_NAMES = (*prior.FEATURE_NAMES, *TWO_SIDED_FEATURES, *LAST_CLICK_FEATURES)


@dataclass(frozen=True, slots=True, eq=False)
class Correction:
    """The last click and the evidence before it, at every `STRIDE`-th pixel of the reduced image.

    Attributes
    ----------
    disc : ndarray of bool, shape (h, w)
        What it holds.
    inside : bool
        Whether that lies inside.
    before : ndarray of float32, shape (h, w)
        Log odds before it.
    depth : float
        Pixels from the click to the nearest of its side before it: how deep in the error it lies.
    shows_both : bool
        Whether it is the first outside, and so the first to tell of both sides.
    """

    disc: Mask
    inside: bool
    before: Plane
    depth: float
    shows_both: bool


@dataclass(frozen=True, slots=True, eq=False)
class HintView:
    """An image seen from the seeds of both sides: the input of the forest.

    Attributes
    ----------
    own : prior.View
        What the prior looks at, from what is known to lie inside.
    outside : ndarray of uint8, shape (h, w)
        1 where it is known to lie outside.
    """

    own: prior.PriorView
    outside: Image

    @property
    def seen(self) -> Features:
        """Features seen from the seeds inside."""
        return self.own.seen

    def is_even(self) -> bool:
        """Whether clicks outside show the same colours as those inside, as in images of flat ink."""
        if not self.outside.any():
            return False
        inside, outside = _halved(self.seen.inside), _halved(self.outside)
        colours = colours_of(self.seen)
        differs = likeness(colours, inside) - likeness(colours, outside)
        return bool(np.abs(differs).max() < EQUAL_LOG_ODDS)


def hints(
    see: Callable[[Mask], prior.PriorView],
    inside: Mask,
    outside: Mask,
    click: Correction,
    base: Callable[[Mask], Plane | None],
) -> tuple[Plane, Plane] | None:
    """Log odds of inside after the last click, as a correction of those before it.

    Parameters
    ----------
    see : callable
        Gives what the prior looks at in the image from a region, shape (H, W).
    inside, outside : ndarray of bool, shape (H, W)
        Pixels known to lie there, that click's among them; at least one inside, none in both.
    base : callable
        Gives the log odds of a model or a map of the image from a region, in place of the prior's, shape (h, w); None stands for
        these.

    Returns
    -------
    near, elsewhere : ndarray of float32, shape (h, w)
        Log odds of inside, at most ``MAX_LOG_ODDS`` either way, at every `STRIDE`-th pixel of the reduced image: where the click
        counts, and in other places. Those before it while only one click shows anything; None in place of both where both
        sides look the same.
    """
    (shown, count), (beyond, _) = showing(inside, outside)
    if count == 1 and not beyond.any():
        return click.before, click.before
    view = hint_view(see(shown), beyond)
    if view.is_even():
        return None
    forest = shipped(MODEL, FEATURE_NAMES).inside
    odds = np.clip(forest.log_odds(all_planes(view, click, base(shown))), -MAX_LOG_ODDS, MAX_LOG_ODDS)
    return near_and_elsewhere(odds, view, click)


def near_and_elsewhere(odds: Plane, view: HintView, click: Correction) -> tuple[Plane, Plane]:
    """Log odds near a click and elsewhere, after the seeds are fixed and the result is smoothed."""
    odds = np.where(strided(view.outside) > 0, np.float32(-MAX_LOG_ODDS), odds)
    odds[strided(view.seen.inside) > 0] = MAX_LOG_ODDS
    near = blurred(voted(odds, view.seen), SMOOTHING / STRIDE)
    if not click.shows_both:
        return near, click.before
    odds += np.float32(COLOUR_WEIGHT) * likelihood_ratio(colours_of(view.seen), voted(odds, view.seen) > 0)
    again = blurred(voted(odds, view.seen), SMOOTHING / STRIDE)
    return near, click.before + np.float32(ELSEWHERE_WEIGHT) * (again - click.before)


def showing(inside: Mask, outside: Mask) -> tuple[tuple[Mask, int], tuple[Mask, int]]:
    """Clicks of either side that are samples of it (`MIN_RADIUS_FRACTION`), at least the widest inside, and their number."""
    sides = list(scattered(inside)), list(scattered(outside))
    widest = [max((float(one.areas.max()) for _, one in side), default=0.0) for side in sides]
    least = MIN_RADIUS_FRACTION**2 * min(max(widest), np.pi * (USUAL_RADIUS * max(inside.shape)) ** 2)
    return _at_least(sides[0], min(least, widest[0]), inside.shape), _at_least(sides[1], least, inside.shape)


def _at_least(
    side: Sequence[tuple[tuple[slice, slice], Parts]], area: float, shape: tuple[int, ...]
) -> tuple[Mask, int]:
    """The clicks of at least this area as one mask, and their number."""
    kept = np.zeros(shape, np.bool_)
    for window, found in side:
        kept[window] = found.at_least(area)
    return kept, sum(len(found.touching(kept[window])) for window, found in side)


def hint_view(own: prior.PriorView, outside: Mask) -> HintView:
    """The view of an image from what is known to lie inside and outside, shape (H, W)."""
    inside = own.seen.inside
    beyond = (
        broadened(reduced_region(outside, own.seen.factor), MIN_START_RADIUS)
        if outside.any()
        else np.zeros_like(inside)
    )
    beyond[inside > 0] = 0
    return HintView(own, beyond)


def all_planes(view: HintView, click: Correction, base: Plane | None = None) -> Plane:
    """The features of the forest, in its order, at every `STRIDE`-th pixel."""
    seen, count = view.seen, len(prior.FEATURE_NAMES)
    planes = np.empty((len(FEATURE_NAMES), *strided(seen.inside).shape), np.float32)
    planes[:count] = view.own.planes
    planes[count] = view.own.forest_odds if base is None else np.clip(base, -MAX_LOG_ODDS, MAX_LOG_ODDS)
    own_way, own_barrier = (planes[prior.FEATURE_NAMES.index(name)] for name in ("way", "barrier@1.5"))
    slope, colours = steepest(seen["slope@1.5"]), colours_of(seen)
    both_sides = _both_sides(view, slope, colours, planes[count], own_way, own_barrier)
    outside_way = both_sides[TWO_SIDED_FEATURES.index("outside_way") - 1]
    last_click = _last_click(view, click, slope, colours, own_way, outside_way)
    for to, plane in zip(planes[count + 1 :], (*both_sides, *last_click), strict=True):
        to[:] = plane
    return planes


def _both_sides(
    view: HintView, slope: Plane, colours: Plane, odds: Plane, own_way: Plane, own_barrier: Plane
) -> list[Plane]:
    """Distances from the seeds outside, how much likelier a colour is inside, and which side is nearer."""
    inside, outside = _halved(view.seen.inside), _halved(view.outside)
    barrier, length = np.zeros((len(BARRIER_FEATURES), *odds.shape), np.float32), np.zeros_like(odds)
    alike, other = likeness(colours, inside), np.zeros_like(odds)
    near, far = _distance(inside), np.full_like(odds, ABSENT_DISTANCE)
    guess = odds > 0
    if outside.any():
        barrier = barriers(slope, outside)
        geodesic(slope, outside, length)
        other, far = likeness(colours, outside), _distance(outside)
        guess &= own_way < length
    return [
        *barrier,
        length,
        logarithm((own_way + 1) / (length + 1)),
        logarithm((own_barrier + 1) / (barrier[0] + 1)),
        blurred(other, 1.0 / STRIDE),
        blurred(alike - other, 1.0 / STRIDE),
        blurred(alike - other, 3.0 / STRIDE),
        blurred(likelihood_ratio(colours, guess), 1.0 / STRIDE),
        near,
        far,
        logarithm((near + DISTANCE_OFFSET) / (far + DISTANCE_OFFSET)),
    ]


def _last_click(
    view: HintView, click: Correction, slope: Plane, colours: Plane, inside_way: Plane, outside_way: Plane
) -> list[Plane | float]:
    """The log odds before the last click, and the distances from it, beside those from all seeds."""
    other = strided(view.outside if click.inside else view.seen.inside)
    disc = np.where(other > 0, np.uint8(0), broadened(click.disc.view(np.uint8), MIN_START_RADIUS / STRIDE))
    disc = disc if disc.any() else click.disc.view(np.uint8)
    length = np.empty_like(slope)
    geodesic(slope, disc, length)
    return [
        click.before,
        1.0 if click.inside else -1.0,
        *barriers(slope, disc),
        length,
        blurred(likeness(colours, disc), 1.0 / STRIDE),
        distances(~click.disc) / np.float32(max(click.depth, 1.0)),
        click.depth / np.sqrt(disc.size),
        logarithm((length + 1) / (inside_way + 1)),
        logarithm((length + 1) / (outside_way + 1)),
    ]


def _halved(region: Image) -> Image:
    """A region at every `STRIDE`-th pixel: where half of a block lies in it or, if there are none, any part."""
    return reduced_region(region > 0, STRIDE) if region.any() else strided(region)


def _distance(region: Image) -> Plane:
    """Distance to a region as a fraction of the square root of the area."""
    length = np.empty(region.shape, np.float32)
    _core.evidence_geodesic(np.zeros_like(length), region, 1.0, 1, length)
    return length / np.float32(np.sqrt(length.size))
