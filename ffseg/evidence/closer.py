"""Closer looks: what somebody points at in a large image may be small, and is seen in crops round that place, too.

The prior and the clicks' forest see `WORKING_SIZE` pixels a side, in which a nucleus of forty pixels in nine megapixels is four
pixels wide. Each crop is half as wide as the one before, and less reduced. What counts is the look of which the prior promises
the largest overlap, if what it finds ends inside the crop.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from functools import partial
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Mask, Plane
from ffseg.evidence.prior import MAX_LOG_ODDS, Look, appearance_of, look_at, prior_view, shown_by_starts
from ffseg.evidence.recent import Recent, digest_of
from ffseg.geometry.freeform import FreeForm
from ffseg.image.appearance import WORKING_SIZE, Appearance, reduction
from ffseg.image.parts import parts_holding
from ffseg.parameters import Circle, Seed, click_radius
from ffseg.scene import Scene
from ffseg.starts.initial import circle_start
from ffseg.starts.moved import as_circle
from ffseg.starts.rivals import disc_of

Value = TypeVar("Value", bound=np.generic)
Place = TypeVar("Place", bound=tuple[float, ...])

MOST_LOOKED_FROM = 20
"""Starts from which an image is looked at, in crops of each scale, to see at which one all are seen: with a thousand in 23 MP it
takes a third of the time. What they promise is kept, so that one more click does not repeat it."""


@dataclass(frozen=True, slots=True)
class Crop:
    """A part of an image.

    Attributes
    ----------
    left, top, right, bottom : int
        Its first column and row, and those behind its last.
    shape : tuple of int
        (H, W) of the image.
    """

    left: int
    top: int
    right: int
    bottom: int
    shape: tuple[int, int]

    @property
    def rows_and_columns(self) -> tuple[slice, slice]:
        """Of its pixels."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    @property
    def size(self) -> tuple[int, int]:
        """(H, W) of the crop."""
        return self.bottom - self.top, self.right - self.left

    def holds(self, x: float, y: float, radius: float) -> bool:
        """Whether a disc lies in it, but for what lies beyond the image."""
        across = max(x - radius, 0) >= self.left and min(x + radius, self.shape[1] - 1) < self.right
        return across and max(y - radius, 0) >= self.top and min(y + radius, self.shape[0] - 1) < self.bottom

    def inner_border(self, shape: tuple[int, ...]) -> Mask:
        """Pixels beside which the image goes on beyond the crop, in a reduced copy of that shape."""
        found = np.zeros(shape[:2], np.bool_)
        found[0] |= self.top > 0
        found[-1] |= self.bottom < self.shape[0]
        found[:, 0] |= self.left > 0
        found[:, -1] |= self.right < self.shape[1]
        return found

    def cuts(self, region: Mask) -> bool:
        """Whether a region of the crop, or of a reduced copy of it, reaches where the image goes on."""
        return bool((region & self.inner_border(region.shape)).any())

    def of(self, scene: Scene) -> Scene:
        """What it has of a scene, with those starts that are circles; of points outside those that it holds."""
        part, corner, init = self.rows_and_columns, np.array([self.left, self.top]), scene.params.init
        domain, disc, background = (
            None if plane is None else plane[part] for plane in (scene.domain, scene.disc, scene.background)
        )
        points = (point for point in init.background if self.holds(*disc_of(point, self.size)))
        init = replace(
            init,
            circles=tuple(self._seen(circle) for circle in init.circles),
            background=tuple(self._seen(point) for point in points),
        )
        return replace(
            scene,
            image=scene.image[part],
            starts=tuple(FreeForm(one.control_points - corner, one.degree) for one in scene.starts),
            params=replace(scene.params, init=init),
            domain=domain,
            disc=disc,
            background=background if background is not None and background.any() else None,
        )

    def _seen(self, place: Place) -> Place:
        x, y, *rest = place
        return cast(Place, (x - self.left, y - self.top, *rest))

    def in_whole(self, plane: NDArray[Value], rest: float) -> NDArray[Value]:
        """A plane of the crop in one of the image, which has a value of its own in all other pixels."""
        whole = np.full(self.shape, rest, plane.dtype)
        whole[self.rows_and_columns] = plane
        return whole


@dataclass(frozen=True, eq=False, kw_only=True)
class CloserLook(Look):
    """A look at a crop of a scene, from a start that suits it; `starts` has its pixels there."""

    crop: Crop

    @property
    def odds(self) -> Plane:
        """Log odds of the pixels of the image: what lies beyond the crop, and what it cuts, lies outside."""
        part = super().odds
        part[parts_holding(part > self.level, self.crop.inner_border(part.shape))] = -MAX_LOG_ODDS
        return self.crop.in_whole(part, -MAX_LOG_ODDS)


def crops(shape: tuple[int, int], x: float, y: float) -> Iterator[Crop]:
    """Crops round a place of an image of shape (H, W), each half as wide as the one before, to one that is not reduced."""
    factor = reduction(shape)
    while factor > 1:
        factor = round(factor / 2)
        left, top = (_first(int(at), WORKING_SIZE * factor, size) for at, size in zip((x, y), shape[::-1], strict=True))
        right, bottom = (at + WORKING_SIZE * factor for at in (left, top))
        yield Crop(left, top, min(right, shape[1]), min(bottom, shape[0]), shape)


def _first(place: int, width: int, size: int) -> int:
    """The first of so many pixels with a place in their middle, or as near to it as an image of that size has them."""
    return min(max(place - width // 2, 0), max(size - width, 0))


def closer_looks(scene: Scene) -> Iterator[CloserLook]:
    """Looks at crops round the only start of a scene, if it is a click, from one no wider than a click in the crop.

    One that cuts what it finds is none.
    """
    (named, *_), start = scene.params.init.named_radii, as_circle(scene.starts[0])
    if len(scene.starts) > 1 or (named and round(start.radius, 1) > click_radius(scene.shape)):
        return
    for crop in crops(scene.shape, start.x, start.y):
        small = replace(start, radius=min(start.radius, click_radius(crop.size)))
        near = replace(scene, starts=(circle_start((small.x, small.y, small.radius), scene.params),))
        starts = shown_by_starts(near)[crop.rows_and_columns]
        if not starts.any():
            continue
        before, after = (one.enlarged(scene.factor) for one in (start, small))
        said = "" if named else f"the start at {before} was seen closer, as a click of radius {after.radius:.4g}"
        look = CloserLook(near, starts, prior_view(appearance_of(crop.of(scene)), starts), said, crop=crop)
        if not crop.cuts(look.region):
            yield look


Crops = tuple[Crop, ...]


@dataclass(frozen=True, slots=True)
class _Place:
    """A start: its centre, its radius if it has one, else 0, and the crops that it may be seen in, from the widest."""

    x: float
    y: float
    radius: float
    crops: Crops

    @property
    def looks(self) -> tuple[Crop | None, ...]:
        """What it may be seen in: None is the whole image."""
        return (None, *self.crops)

    def from_crop(self, crop: Crop | None) -> Crops:
        """A crop and the wider ones; of the whole image none."""
        return () if crop is None else self.crops[self.crops.index(crop) :: -1]


_Promises = dict[Crop | None, float]

_known = Recent[_Promises](MOST_LOOKED_FROM)


def crops_of_starts(scene: Scene) -> list[Crops]:
    """The crop that each start of a scene is seen in, and wider ones round the same place; none is the whole image.

    A start that lies in the crop of an earlier one is seen in that. The others are seen at the scale at which looks from the
    first of them promise the most in all; those of the first that it cuts, where their own look promises the most.
    """
    appearance, places, told = appearance_of(scene), _places(scene), dict[int, _Promises]()
    seen = digest_of(appearance.lab, scene.limits)
    while True:
        led, chosen = _seen_in(places, told)
        new = [number for number in chosen if number not in told][: MOST_LOOKED_FROM - len(told)]
        if not new:
            break
        for number in new:
            look = partial(_promised_overlaps, _with_starts(scene, [number]), appearance)
            told[number] = _known.get((seen, scene.params.region.probability, places[number]), look)
    return [places[leader].from_crop(chosen[leader]) for leader in led]


def _places(scene: Scene) -> list[_Place]:
    circles = [as_circle(start) for start in scene.starts]
    return [
        _Place(one.x, one.y, one.radius if named else 0.0, tuple(crops(scene.shape, one.x, one.y)))
        for one, named in zip(circles, scene.params.init.named_radii, strict=True)
    ]


def _seen_in(places: Sequence[_Place], told: dict[int, _Promises]) -> tuple[list[int], dict[int, Crop | None]]:
    """Of each start the number of the one in whose crop it is seen, and of those their crops."""
    scales = range(len(places[0].looks))
    best = max(scales, key=lambda scale: sum(one.get(places[k].looks[scale], 0.0) for k, one in told.items()))
    led, chosen = list[int](), dict[int, Crop | None]()
    for number, place in enumerate(places):
        held = (k for k, crop in chosen.items() if (crop or places[k].crops[0]).holds(place.x, place.y, place.radius))
        led.append(next(held, number))
        if led[-1] == number:
            crop, own = place.looks[best], told.get(number)
            chosen[number] = crop if own is None or crop in own else max(own, key=own.__getitem__, default=None)
    return led, chosen


def _promised_overlaps(scene: Scene, appearance: Appearance) -> _Promises:
    """Overlaps that looks from the only start of a scene promise: at crops, and None: at the whole image, which looks so."""
    whole = look_at(scene, appearance)
    found: _Promises = {look.crop: look.promised for look in closer_looks(scene)}
    return found if whole is None else found | {None: whole.promised}


def _with_starts(scene: Scene, numbers: Sequence[int]) -> Scene:
    """The scene with these of its starts alone."""
    init, starts = scene.params.init, tuple(scene.starts[k] for k in numbers)
    if init.circles:
        init = replace(init, circles=tuple(init.circles[k] for k in numbers))
    return replace(scene, starts=starts, params=replace(scene.params, init=init))


def as_seen(scene: Scene, seen: Sequence[Crops]) -> tuple[Scene, str]:
    """The scene with what has no radius as clicks of the crops that it is seen in, and what to say of starts among it."""
    init, smaller = scene.params.init, list[float]()
    circles = [*init.circles_in(scene.shape)] or [cast(Circle, astuple(as_circle(scene.starts[0])))]
    for number, (named, crops_) in enumerate(zip(init.named_radii, seen, strict=True)):
        if crops_ and not named:
            x, y, radius = circles[number]
            smaller.append(min(radius, click_radius(crops_[0].size)))
            circles[number] = x, y, smaller[-1]
    background = tuple(_as_seen(point, [one[0] for one in seen if one]) for point in init.background)
    init = replace(init, circles=tuple(circles) if init.circles else (), background=background)
    params = replace(scene.params, init=init)
    if not smaller:
        return replace(scene, params=params), ""
    starts = tuple(circle_start(circle, scene.params) for circle in circles)
    radii = " to ".join(dict.fromkeys(f"{scene.factor * one:.4g}" for one in (min(smaller), max(smaller))))
    count = len(smaller)
    what = "a start was seen closer, as a click" if count == 1 else f"{count} starts were seen closer, as clicks"
    return replace(scene, starts=starts, params=params), f"{what} of radius {radii}"


def _as_seen(point: Seed, seen: Sequence[Crop]) -> Seed:
    """A point outside with the radius of a click in the narrowest crop that holds it."""
    if len(point) > 2:
        return point
    sizes = (crop.size for crop in seen if crop.holds(*point, 0))
    size = min(sizes, default=None)
    return point if size is None else (*point, click_radius(size))


def part_with(scene: Scene, numbers: Sequence[int], crop: Crop | None = None) -> Scene:
    """What a crop has of a scene with these of its starts alone; points outside say after how many of them they came."""
    found, init = _with_starts(scene, numbers), scene.params.init
    background = tuple(
        (*point[:3], float(sum(k < point[3] for k in numbers))) if len(point) == 4 else point
        for point in init.background
    )
    found = replace(found, params=replace(found.params, init=replace(found.params.init, background=background)))
    return found if crop is None else crop.of(found)
