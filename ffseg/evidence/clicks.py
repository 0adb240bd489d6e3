"""The source ``hints``: what several clicks tell, one after another, each a correction of what was told before it.

The first start tells what the prior says of it; a model, a map or boxes may have told in its place. What a later click and all
before it show (`ffseg.evidence.hints`) then counts on the side of that click, where it hangs together with it, and near
it (`REACH`): so a click mends what it was made for, and little else. Circles and points outside have an order each; of the two
that come next the one deeper in what is wrong is first, as one clicks.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from ffseg.evidence import hints, prior
from ffseg.evidence.features import enlarged, reduced_mean, reduced_shape, reduction
from ffseg.evidence.gradient import gradient
from ffseg.evidence.hints import HELD, thin
from ffseg.evidence.maps import log_odds, odds_edges
from ffseg.evidence.prior import CERTAIN
from ffseg.evidence.surroundings import STRIDE
from ffseg.image.edges import EdgeMap
from ffseg.image.free import distances
from ffseg.image.opencv_peers import grown
from ffseg.image.parts import holding
from ffseg.image.raster import rasterize
from ffseg.scene import Scene
from ffseg.starts.boxes import in_boxes
from ffseg.starts.initial import circle_start, middles
from ffseg.starts.parts import core
from ffseg.starts.rivals import POINT_RADIUS, add_disc, seeds

Plane = NDArray[np.float32]
Region = NDArray[np.bool_]

REACH = 4.0
"""Radius round a click within which it counts, in parts of its distance to where its side was told before it."""

HALF = 0.5

REMEMBERED = 32
"""States that are not found again when one more click is made: of one image and the one before."""


@dataclass(frozen=True, slots=True)
class Click:
    """A disc that lies inside or outside, pixels."""

    x: float
    y: float
    radius: float
    inside: bool


@dataclass(frozen=True, eq=False)
class Asked:
    """What clicks are made in.

    Attributes
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey or BGR.
    inside, outside : ndarray of bool, shape (H, W)
        Pixels known to lie there before the clicks, at least one inside.
    said : ndarray of float32, shape (H, W), or None
        Log odds that a model, a map of the image or boxes tell; None stands for the prior's.
    level : float
        Log odds at which the region ends.
    within : ndarray of bool, shape (H, W), or None
        Pixels of the domain; None means all.
    """

    image: NDArray[np.uint8]
    inside: Region
    outside: Region
    said: Plane | None
    level: float
    within: Region | None

    @property
    def factor(self) -> int:
        """Pixels a side of the image that became one of the reduced image."""
        return reduction(self.image.shape, prior.model()[0].size)

    def reduced(self, plane: Plane) -> Plane:
        """A plane of the image at every `STRIDE`-th pixel of the reduced one, shape (h, w)."""
        return thin(reduced_mean(plane, self.factor))

    @cached_property
    def reduced_say(self) -> Plane | None:
        """What was said, in such a plane."""
        return None if self.said is None else self.reduced(self.said)

    def region(self, pixels: Region) -> Region:
        """Where at least half of such a pixel lies in a region; if that is nowhere, any of it, or of its neighbours."""
        shares = self.reduced(pixels.astype(np.float32))
        if not shares.any():
            shares = reduced_mean(pixels.astype(np.float32), self.factor * STRIDE)
        return shares >= HALF if (shares >= HALF).any() else shares > 0

    def enlarged(self, plane: Plane | Region) -> Plane:
        """Such a plane at the size of the image."""
        return enlarged(plane.astype(np.float32), self.factor, self.inside.shape, STRIDE)

    def disc(self, click: Click) -> Region:
        """The disc of a click in such a plane; the pixel in its middle always belongs to it."""
        height, width = reduced_shape(reduced_shape(self.inside.shape, self.factor), STRIDE)
        row, column = (((at + 0.5) / self.factor - 0.5) / STRIDE for at in (click.y, click.x))
        found = np.zeros((height, width), np.bool_)
        add_disc(found, column, row, click.radius / (self.factor * STRIDE))
        found[min(max(round(row), 0), height - 1), min(max(round(column), 0), width - 1)] = True
        return found

    def correction(self, before: Told, disc: Region, inside: bool, first_outside: bool) -> hints.Correction:
        """A click on such a disc, beside what was told before it."""
        region = before.odds > self.level
        depth = float(distances(~region if inside else region)[disc].max())
        return hints.Correction(disc, inside, before.odds, depth, first_outside and not inside)

    def near(self, click: hints.Correction) -> Region:
        """Where a click counts."""
        return distances(~click.disc) <= REACH * click.depth

    def known(self, clicks: Sequence[Click]) -> tuple[Region, Region]:
        """Pixels known to lie inside and outside after some clicks; what both claim lies inside."""
        inside, outside = self.inside.copy(), self.outside.copy()
        for click in clicks:
            add_disc(inside if click.inside else outside, click.x, click.y, click.radius)
        if self.within is not None:
            inside &= self.within
        return inside, outside & ~inside

    @cached_property
    def digest(self) -> bytes:
        """Equal for what is equal."""
        parts = (self.image, self.inside, self.outside, self.said, self.within)
        found = blake2b(repr((self.image.shape, self.level, [part is None for part in parts])).encode(), digest_size=16)
        for part in parts:
            if part is not None:
                found.update(np.ascontiguousarray(part).data)
        return found.digest()


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """What is told after some clicks, at every `STRIDE`-th pixel of the reduced image.

    Attributes
    ----------
    odds : ndarray of float32, shape (h, w)
        Log odds of belonging to what is meant.
    counted : ndarray of bool, shape (h, w)
        Where a click has counted.
    stays : ndarray of bool, shape (h, w)
        The region: parts that hold a click inside, and those that clicks outside have cut off.
    """

    odds: Plane
    counted: Region
    stays: Region


def hint_edges(scene: Scene) -> EdgeMap:
    """Edges where what was clicked ends: the source ``hints``."""
    return with_clicks(scene, gradient(scene))


def with_clicks(scene: Scene, own: EdgeMap, said: Plane | None = None) -> EdgeMap:
    """Edges where the evidence falls to ``region.probability``; the image's own where clicks on both sides show the same.

    Parameters
    ----------
    said : ndarray of float32, shape (H, W), optional
        Log odds that a model, a map of the image or boxes tell without clicks, in place of the prior's: clicks correct them.
        Without boxes, they do not count where the first start lies in none of the region that they tell.

    Raises
    ------
    SegmentationError
        If a click outside lies in the start region or beyond the image.
    """
    params, limits = scene.params, scene.disc if scene.domain is None else scene.domain
    level, points = log_odds(params.region.probability), params.init.background
    if scene.boxes and said is not None:
        scene = _in_boxes(scene, said - np.float32(level))
    inside = core(scene)
    outside = seeds(points, inside, scene.background)
    within = None if limits is None else limits > 0
    if within is not None:
        inside &= within
    first, circles = _first(scene, inside)
    if said is not None and not scene.boxes and first.any() and said[first].max() <= level:
        said = None
    odds, kept = said, None
    if first.any():
        beyond = np.zeros_like(inside) if scene.background is None else scene.background > 0
        asked = Asked(scene.image, first, beyond, said, level, within)
        told = corrected(asked, circles, [Click(x, y, max([POINT_RADIUS, *rest]), False) for x, y, *rest in points])
        if told is not None:
            odds, kept = _at_full_size(asked, told)
            odds[grown(inside, HELD)] = CERTAIN
            odds[outside], odds[inside] = -CERTAIN, CERTAIN
    if odds is None:
        return own
    edges = odds_edges(odds, params.region.probability, own, "hints")
    if edges is own:
        return own
    edges = replace(edges, kept=kept)
    if not outside.any():
        return edges
    free = ~outside if within is None else ~outside & within
    return replace(edges, domain=np.where(free, np.uint8(255), np.uint8(0)))


def _in_boxes(scene: Scene, odds: Plane) -> Scene:
    """The scene with starts in what its boxes hold, but for what is known to lie outside: their middles say nothing."""
    outside = seeds(scene.params.init.background, np.zeros(scene.shape, np.bool_), scene.background)
    contour = replace(scene.params.contour, balloon=abs(scene.params.contour.balloon))
    circles = tuple(circle_start(circle, scene.params) for circle in scene.params.init.circles)
    starts = circles or middles(scene.params, scene.shape)  # what closes in has the boxes themselves
    growing = replace(scene, starts=starts, params=replace(scene.params, contour=contour))
    return in_boxes(growing, np.where(outside, np.float32(-CERTAIN), odds))


def _first(scene: Scene, inside: Region) -> tuple[Region, list[Click]]:
    """What is known to lie inside at first, and the circles that follow: of circles alone the first begins."""
    circles = () if scene.start_mask is not None else scene.params.init.circles
    begun = rasterize(scene.starts[len(circles) :], scene.shape) & inside
    for start, _ in zip(scene.starts, circles, strict=False):
        if begun.any():
            break
        begun, circles = rasterize([start], scene.shape) & inside, circles[1:]
    return begun, [Click(*circle, True) for circle in circles]


def corrected(asked: Asked, circles: Sequence[Click], points: Sequence[Click]) -> Told | None:
    """What is told after all clicks, of which each side has an order; None where both sides show the same and nothing is said."""
    digest, done, lines = asked.digest, tuple[Click, ...](), [list(circles), list(points)]
    told = _remembered((digest,), partial(_begun_with, asked))
    first_outside = not asked.outside.any()
    while told is not None and any(lines):
        left = [line for line in lines if line]
        next_ones = [asked.correction(told, asked.disc(line[0]), line[0].inside, first_outside) for line in left]
        at = max(range(len(left)), key=lambda side: next_ones[side].depth)
        done = (*done, left[at].pop(0))
        first_outside &= done[-1].inside
        told = _remembered((digest, *done), partial(_after, asked, told, done, next_ones[at]))
    return told


_known: OrderedDict[tuple[bytes | Click, ...], Told | None] = OrderedDict()


def _remembered(key: tuple[bytes | Click, ...], make: Callable[[], Told | None]) -> Told | None:
    try:
        found = _known.pop(key)
    except KeyError:
        found = make()
    _known[key] = found
    if len(_known) > REMEMBERED:
        _known.popitem(last=False)
    return found


_viewed: dict[bytes, tuple[Region, prior.View]] = {}


def _view(asked: Asked, inside: Region) -> prior.View:
    """What the prior looks at from a region; the last is kept, as a click outside changes nothing of it."""
    last = _viewed.get(asked.digest)
    if last is None or not np.array_equal(last[0], inside):
        _viewed.clear()
        _viewed[asked.digest] = last = inside, prior.view(asked.image, inside)
    return last[1]


def _begun_with(asked: Asked) -> Told | None:
    """What is told before any click but a mask of what lies outside."""
    odds = asked.reduced_say
    if odds is None:
        odds = _view(asked, asked.inside).odds - np.float32(prior.CAUTION)
    told = begun(asked, odds)
    if not asked.outside.any():
        return told
    return _after(asked, told, (), asked.correction(told, asked.region(asked.outside), False, True))


def begun(asked: Asked, odds: Plane) -> Told:
    """What is told before any click, of these log odds."""
    return Told(odds, np.zeros(odds.shape, np.bool_), holding(odds > asked.level, asked.region(asked.inside)))


def _after(asked: Asked, before: Told, done: Sequence[Click], click: hints.Correction) -> Told | None:
    """What is told after some clicks, of the last of which this is the correction."""
    inside, outside = asked.known(done)
    shown = hints.hints(partial(_view, asked), inside, outside, click, asked.reduced_say)
    if shown is None:
        return None if asked.said is None else before
    return turned(asked, before, *shown, inside, click)


def turned(asked: Asked, before: Told, near: Plane, elsewhere: Plane, inside: Region, click: hints.Correction) -> Told:
    """What is told after a click: what it shows where that turns pixels near it to its side, and what is left elsewhere."""
    disc, now, then = click.disc, near > asked.level, elsewhere > asked.level
    counted = holding((now & ~then if click.inside else then & ~now) & asked.near(click) | disc, disc)
    odds = np.where(counted, near, elsewhere)
    region = odds > asked.level
    stays = before.stays & region
    if click.inside:
        stays |= holding(region | disc, disc)
    else:
        stays = holding(stays, asked.region(inside) | (distances(stays) >= click.depth))
    return Told(odds, before.counted | counted, stays)


def _at_full_size(asked: Asked, told: Told) -> tuple[Plane, Region]:
    """Log odds and what stays of the region, at the size of the image; where no click counted, details of what was said."""
    odds = asked.enlarged(told.odds)
    if asked.said is not None and asked.reduced_say is not None:
        rest = asked.said + asked.enlarged(told.odds - asked.reduced_say)
        odds = np.where(asked.enlarged(told.counted) > HALF, odds, rest)
    return odds, (asked.enlarged(told.stays) >= HALF) & (odds > asked.level)
