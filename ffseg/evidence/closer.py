"""Closer looks: what somebody points at in a large image may be small, and is seen in crops round that place, too.

The prior and the clicks' forest see `WORKING_SIZE` pixels a side, in which a nucleus of forty pixels in nine megapixels is four
pixels wide. Each crop is half as wide as the one before, and less reduced. What counts is the look of which the prior promises
the largest overlap, if what it finds ends inside the crop.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Mask, Plane
from ffseg.evidence.prior import MAX_LOG_ODDS, Look, appearance_of, look_at, prior_view, shown_by_starts
from ffseg.geometry.freeform import FreeForm
from ffseg.image.appearance import WORKING_SIZE, Appearance, reduction
from ffseg.image.parts import parts_holding
from ffseg.parameters import click_radius
from ffseg.scene import Scene
from ffseg.starts.initial import circle_start
from ffseg.starts.moved import as_circle

Value = TypeVar("Value", bound=np.generic)


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
    """Looks at crops round the start of a scene, if it is a click, from one no wider than a click in the crop.

    One that cuts what it finds is none.
    """
    init, start = scene.params.init, as_circle(scene.starts[0])
    named = init.radius != "auto" or any(len(one) == 3 for one in init.circles)
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
        look = CloserLook(near, starts, prior_view(seen_in(crop, scene), starts), said, crop=crop)
        if not crop.cuts(look.region):
            yield look


def first_crop(scene: Scene, appearance: Appearance) -> Crop | None:
    """The crop of the look at the first start that counts; None if that is of the whole image, which looks so."""
    init = replace(scene.params.init, circles=scene.params.init.circles[:1])
    first = replace(scene, starts=scene.starts[:1], params=replace(scene.params, init=init))
    whole = look_at(first, appearance)
    looks = [*closer_looks(first), *([] if whole is None else [whole])]
    best = max(looks, key=attrgetter("promised"), default=None)
    return best.crop if isinstance(best, CloserLook) else None


def crops_from(crop: Crop, start: FreeForm, discs: Sequence[tuple[float, float, float]]) -> Iterator[Crop]:
    """Crops round a start that hold all of these discs, from this one to the widest."""
    circle = as_circle(start)
    every = [*crops(crop.shape, circle.x, circle.y)]
    return (one for one in every[every.index(crop) :: -1] if all(one.holds(*disc) for disc in discs))


def seen_in(crop: Crop, scene: Scene) -> Appearance:
    """What is seen of a crop of the image of a scene."""
    return appearance_of(replace(scene, image=scene.image[crop.rows_and_columns]))
