"""The source ``hints``: what a forest learned from drawings says of what several clicks mean.

What is known to lie inside (start regions) and outside (``init.background``) teaches the colours and ways of both sides of this
image: the forest sees what the prior sees from the inside, the prior's own say, and the same ways and colours seen from the
outside. Where a model or a map tells of the image, the forest takes what that says for the prior's say. It is part of the
package; ``python -m ffseg.learning.grow`` makes it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.evidence import prior
from ffseg.evidence.features import BARRIER, STEP, Features, broadened, reduced_region, way
from ffseg.evidence.forest import Compiled, shipped
from ffseg.evidence.maps import blurred
from ffseg.evidence.prior import CERTAIN, LEAST_START, SMOOTHING
from ffseg.evidence.surroundings import STRIDE, colours_of, likelier, likeness, steepest, with_own_colours
from ffseg.image.parts import Parts, scattered
from ffseg.native import _core

Plane = NDArray[np.float32]
Region = NDArray[np.bool_]

MODEL = Path(__file__).with_name("hints.ffmodel")

FAR = 2.0
"""Distance of what is not there, in parts of the root of the area that is looked at."""

EVEN = 1e-3
"""Log odds of colours below which clicks on both sides show the same: of equal ones rounding leaves less."""

NEAREST = 0.01
"""Added to distances, in the same parts, before their logarithm."""

HELD = 3.0
"""Pixels round a click that are its side's: a smaller disc would start on the edge of its own evidence, and leak over it."""

SHOWS, CLICK = 0.75, 0.01
"""Part of the widest click's radius from which on a click shows what it lies on, and radius of a usual click in parts of the
image's longer side, if the widest is wider. Narrower ones mend a rim and lie on its edge: they hold what they cover, no more.
On 55 drawings .60, .75 and .90 do alike; on 55 others clicks lose half as much as if all were to show something."""

TOLD = (
    "prior",
    *(f"outside_{name}" for name in BARRIER),
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
TAKEN = (*prior.TAKEN, *TOLD)


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What the forest looks at.

    Attributes
    ----------
    seen : Features
        Seen from what is known to lie inside.
    outside : ndarray of uint8, shape (h, w)
        1 where it is known to lie outside.
    """

    seen: Features
    outside: NDArray[np.uint8]

    def is_even(self) -> bool:
        """Whether clicks outside show just the colours that those inside show, as in pictures of flat ink."""
        if not self.outside.any():
            return False
        inside, outside = _halved(self.seen.inside), _halved(self.outside)
        colours = colours_of(self.seen)
        differs = likeness(colours, inside) - likeness(colours, outside)
        return bool(np.abs(differs[(inside | outside) > 0]).max() < EVEN)


def hints(image: NDArray[np.uint8], inside: Region, outside: Region, said: Plane | None = None) -> Plane | None:
    """Evidence of what clicks mean.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey or BGR.
    inside, outside : ndarray of bool, shape (H, W)
        Pixels known to lie there, at least one inside, none in both.
    said : ndarray of float32, shape (h, w), optional
        Log odds that a model or a map of the image tells without clicks, in place of the prior's.

    Returns
    -------
    ndarray of float32, shape (h, w), or None
        Logarithm of the odds of belonging to what is meant, at most ``CERTAIN`` either way, at every `STRIDE`-th pixel of the
        reduced image; of one click, what is told without it. None where both sides show the same.
    """
    (shown, count), (beyond, _) = showing(inside, outside)
    if count == 1 and not beyond.any():
        return prior.reduced(image, shown)[0] - np.float32(prior.CAUTION) if said is None else said
    view = look(image, shown, beyond)
    return None if view.is_even() else _odds(view, said)


def showing(inside: Region, outside: Region) -> tuple[tuple[Region, int], tuple[Region, int]]:
    """Parts of clicks on either side that show what they lie on (`SHOWS`), at least the widest inside, and their number."""
    sides = list(scattered(inside)), list(scattered(outside))
    widest = [max((float(one.areas.max()) for _, one in side), default=0.0) for side in sides]
    least = SHOWS**2 * min(max(widest), np.pi * (CLICK * max(inside.shape)) ** 2)
    return _at_least(sides[0], min(least, widest[0]), inside.shape), _at_least(sides[1], least, inside.shape)


def _at_least(
    side: Sequence[tuple[tuple[slice, slice], Parts]], area: float, shape: tuple[int, ...]
) -> tuple[Region, int]:
    """The parts of so many pixels as one mask, and their number."""
    kept = np.zeros(shape, np.bool_)
    for window, found in side:
        kept[window] = found.at_least(area)
    return kept, sum(len(found.touching(kept[window])) for window, found in side)


def _odds(view: View, said: Plane | None) -> Plane:
    """Log odds of every `STRIDE`-th pixel; colours of what was found at first are asked again."""
    model, native = shipped(MODEL, TAKEN)
    seen = view.seen
    odds = np.clip(model.inside.log_odds(all_planes(view, prior.model(), said), native), -CERTAIN, CERTAIN)
    odds[thin(view.outside) > 0], odds[thin(seen.inside) > 0] = -CERTAIN, CERTAIN
    return blurred(with_own_colours(odds, seen), SMOOTHING / STRIDE)


def look(image: NDArray[np.uint8], inside: Region, outside: Region) -> View:
    """The image, seen from what is known of it."""
    seen = prior.look(image, inside, prior.model()[0].size)
    beyond = (
        broadened(reduced_region(outside, seen.factor), LEAST_START) if outside.any() else np.zeros_like(seen.inside)
    )
    beyond[seen.inside > 0] = 0
    return View(seen, beyond)


def thin(region: NDArray[Any]) -> NDArray[Any]:
    """Every `STRIDE`-th pixel each way."""
    return np.ascontiguousarray(region[::STRIDE, ::STRIDE])


def all_planes(view: View, asked: Compiled, said: Plane | None = None) -> Plane:
    """The planes that the forest takes, in its order, of every `STRIDE`-th pixel; of the prior, `asked` is the model."""
    seen = view.seen
    planes = np.empty((len(TAKEN), *thin(seen.inside).shape), np.float32)
    own, told = planes[: len(prior.TAKEN)], planes[len(prior.TAKEN) :]
    own[:] = prior.all_planes(seen)
    say = asked[0].inside.log_odds(own, asked[1]) if said is None else said
    told[0] = np.clip(say, -CERTAIN, CERTAIN)
    from_inside = {name: own[prior.TAKEN.index(name)] for name in ("way", "barrier@1.5")}
    for to, plane in zip(told[1:], _told(view, told[0], from_inside["way"], from_inside["barrier@1.5"]), strict=True):
        to[:] = plane
    return planes


def _told(view: View, odds: Plane, own_way: Plane, own_barrier: Plane) -> list[Plane]:
    """What stands on ways from outside, how much likelier a colour is inside, and which side is nearer."""
    seen, inside, outside = view.seen, _halved(view.seen.inside), _halved(view.outside)
    barrier, length = np.zeros((len(BARRIER), *odds.shape), np.float32), np.zeros_like(odds)
    colours = colours_of(seen)
    alike, other = likeness(colours, inside), np.zeros_like(odds)
    near, far = _distance(inside), np.full_like(odds, FAR)
    guess = odds > 0
    if outside.any():
        slope = steepest(seen["slope@1.5"])
        _core.evidence_barrier(slope, outside, STEP, barrier)
        way(slope, outside, length)
        other, far = likeness(colours, outside), _distance(outside)
        guess &= own_way < length
    return [
        *barrier,
        length,
        np.log((own_way + 1) / (length + 1)),
        np.log((own_barrier + 1) / (barrier[0] + 1)),
        blurred(other, 1.0 / STRIDE),
        blurred(alike - other, 1.0 / STRIDE),
        blurred(alike - other, 3.0 / STRIDE),
        blurred(likelier(colours, guess), 1.0 / STRIDE),
        near,
        far,
        np.log((near + NEAREST) / (far + NEAREST)),
    ]


def _halved(region: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A region at every `STRIDE`-th pixel: where half of these lie in it, or, if there are none, any."""
    return reduced_region(region > 0, STRIDE) if region.any() else thin(region)


def _distance(region: NDArray[np.uint8]) -> Plane:
    """Distance to a region in parts of the root of the area."""
    length = np.empty(region.shape, np.float32)
    _core.evidence_geodesic(np.zeros_like(length), region, 1.0, 1, length)
    return length / np.float32(np.sqrt(length.size))
