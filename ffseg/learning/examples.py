"""What is learned from: labelled pixels of images, seen from several starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Floats, Image, Indices, Mask
from ffseg.errors import UsageError
from ffseg.evidence.features import ALL_FEATURES, features, reduced_mean
from ffseg.evidence.growing import MIN_IN_LEAF
from ffseg.evidence.prior import prior
from ffseg.image.appearance import WORKING_SIZE, Appearance, size_to_see
from ffseg.image.free import distances
from ffseg.image.parts import connected_parts
from ffseg.metrics import IGNORED, INSIDE, OUTSIDE
from ffseg.parameters import Parameters, click_radius

STARTS = 5
"""Starts from which each training image is seen: its own, and others drawn inside its mask, so that the forest learns
what holds from any start."""

CLICKS = 2
"""So many of them are as small as clicks (`click_radius`), from which a model is asked as well. Models of five roads, and of
three floors, reach an IoU of .85 after 1.7 and 1.9 clicks in place of 2.1 and 2.4 on photographs at even places, 1.7 and 3.0 for
2.1 and 3.7 at odd ones; drawings do not tell (-.1, -.3 and +.4 clicks of 5 on 110 each, errors .2)."""

PIXELS = 6000
"""Pixels taken of an image; neighbours say nearly the same."""

MIXED_FRACTION = 0.2
"""A reduced pixel of which between this share and the rest lies inside is no sample of either."""

MIN_KNOWN = 0.5
"""Part of the pixels; masks that know less are scribbles: they say little of where the region ends, and each of their pixels
counts. Where the rest of a mask is known, reduced pixels at the edge of what is not do harm: with them unseen road frames,
learned from three masks, had a mean IoU of .801, without .810."""


MIN_APART = 0.2
"""Part of what masks have inside, in the mean, that lies apart from the largest component, from which on they mean all things of
a kind: 0 in each of 47 photographs and 88 drawings of one thing, .96 in pictures of forty cells."""


@dataclass(frozen=True, slots=True, eq=False)
class Example:
    """An image with labels of some pixels.

    Attributes
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    truth : ndarray of uint8, shape (H, W)
        255 inside, 128 unknown, 0 outside.
    start : ndarray of bool, shape (H, W), or None
        The start region; without one, starts are drawn.
    radius : float
        px; of the starts that are drawn, but for those that are as small as clicks.
    """

    image: Image
    truth: Image
    start: Mask | None
    radius: float


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Samples of one image.

    Attributes
    ----------
    rows : ndarray of float32, shape (N, F)
        Features in the order of ``ALL_FEATURES``.
    inside : ndarray of bool, shape (N,)
    prior : ndarray of float32, shape (N,), or None
        Log odds that the prior gives; None where it was not asked.
    apart : float
        Part of what its mask has inside that lies apart from the largest of its components.
    size : int
        Pixels a side that features were computed at.
    """

    rows: Floats
    inside: Mask
    prior: Floats | None = None
    apart: float = 0.0
    size: int = WORKING_SIZE


def samples_by_default(image: Image, truth: Image, size: int = WORKING_SIZE) -> Samples:
    """Samples of an image and its truth, with starts drawn as `ffseg learn` draws them by default."""
    return samples(Example(image, truth, None, Parameters().init.radius_in(truth.shape)), size)


def samples(example: Example, size: int = WORKING_SIZE) -> Samples:
    """Labelled pixels of an image at so many pixels a side, seen from several starts, each also mirrored.

    Raises
    ------
    UsageError
        If the mask knows no pixel inside, or none outside.
    """
    rng, image = np.random.default_rng(0), Appearance(example.image, size)
    usual = image.usual
    rows, labels, odds = [], [], []
    for start in starts_in(example, rng):
        seen = features(image, start)
        scribbled = np.count_nonzero(example.truth != IGNORED) < MIN_KNOWN * example.truth.size
        known = (known_of_some if scribbled else known_pixels)(example.truth, seen.factor)
        chosen = _chosen(known.ravel(), rng)
        found = seen.of_pixels(ALL_FEATURES, chosen)
        rows += [found, mirrored(found)]
        labels += [known.ravel()[chosen] > 0] * 2
        odds += [reduced_mean(prior(usual, start), seen.factor).ravel()[chosen]] * 2
    inside = np.concatenate(labels) if labels else np.zeros(0, np.bool_)
    if inside.all() or not inside.any():
        side, level = ("outside", OUTSIDE) if inside.any() else ("inside", INSIDE)
        if (example.truth == level).any():
            small = f": the image is seen at {size} pixels a side; cut it out"
            why = small if image.factor > 1 else "; draw more of it"
            raise UsageError(f"what the mask knows {side} is too small or thin{why}, or leave it out")
        raise UsageError(unknown_side(side))
    return Samples(np.concatenate(rows), inside, np.concatenate(odds), share_apart(example.truth), size)


def share_apart(truth: Image) -> float:
    """Part of what a mask has inside that lies apart from the largest of its components; what is unknown may join them."""
    components = connected_parts(truth != OUTSIDE)
    areas = np.bincount(components.labels[truth == INSIDE])
    return 1 - float(areas.max()) / float(areas.sum())


def size_of_things(truths: Sequence[Image]) -> int:
    """Pixels a side that show the things of masks of many: half of them, in half of the masks, as `size_to_see` says.

    Where masks mean one thing, or know little of where things end, it is as for all other evidence.
    """
    if not truths or np.mean([share_apart(one) for one in truths]) < MIN_APART:
        return WORKING_SIZE
    sizes = [WORKING_SIZE]
    for truth in truths:
        if np.count_nonzero(truth != IGNORED) >= MIN_KNOWN * truth.size:
            inside = truth == INSIDE
            parts, depths = connected_parts(inside), distances(inside)
            deepest = np.zeros(parts.number, np.float32)
            np.maximum.at(deepest, parts.labels[inside], depths[inside])
            sizes.append(size_to_see(truth.shape, float(np.median(deepest[1:]))))
    return int(np.median(sizes[1:] or sizes))


def unknown_side(side: str, label: int | None = None) -> str:
    """What to say of a mask that knows no pixel inside, or none outside; `label` is the class that was taken for inside."""
    if label is not None:
        return f"the mask knows no pixel {side}, where --truth-label {label} is inside; name another class"
    return f"the mask knows no pixel {side}: 255 is inside, 0 outside, 128 unknown; draw some of both"


def _chosen(known: NDArray[np.int8], rng: np.random.Generator) -> Indices:
    """Evenly drawn labelled pixels, with at least a leaf's number of each side where there are so many."""
    places = rng.permutation(np.flatnonzero(known >= 0))
    chosen, left = np.split(places, [PIXELS // STARTS])
    few = [max(0, MIN_IN_LEAF - np.count_nonzero(known[chosen] == side)) for side in (0, 1)]
    more = [left[known[left] == side][:count] for side, count in enumerate(few)]
    return np.concatenate([chosen, *more])


def starts_in(example: Example, rng: np.random.Generator) -> list[Mask]:
    """The start of an image, and others drawn inside its mask, the last ones as small as clicks."""
    own = [] if example.start is None else [example.start]
    inside = example.truth == INSIDE
    small = min(click_radius(inside.shape), example.radius)
    large = _discs_inside(inside, example.radius, STARTS - CLICKS - len(own), rng)
    return own + large + _discs_inside(inside, small, CLICKS, rng)


def _discs_inside(inside: Mask, radius: float, count: int, rng: np.random.Generator) -> list[Mask]:
    """Discs drawn inside a mask, smaller than asked for where it has no room; none if it is empty."""
    places = np.argwhere(_windows_inside(inside, radius))
    while not len(places) and radius >= 1:
        radius /= 2
        places = np.argwhere(_windows_inside(inside, radius))
    if not len(places):
        return []
    rows, columns = np.ogrid[: inside.shape[0], : inside.shape[1]]
    drawn = places[rng.integers(0, len(places), count)]
    return [(rows - y) ** 2 + (columns - x) ** 2 <= radius**2 for y, x in drawn]


def _windows_inside(inside: Mask, radius: float) -> Mask:
    """Pixels whose window of half-width ``radius`` lies inside the mask and the image."""
    reach = int(radius)
    sums = np.pad(inside, ((1, 0), (1, 0))).astype(np.int64).cumsum(0).cumsum(1)
    side = 2 * reach + 1
    found = np.zeros_like(inside)
    if min(inside.shape) >= side:
        full = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
        found[reach : inside.shape[0] - reach, reach : inside.shape[1] - reach] = full == side * side
    return found


def known_pixels(truth: Image, factor: int) -> NDArray[np.int8]:
    """Labels of reduced pixels: 1 inside, 0 outside, -1 unknown or mixed."""
    share = reduced_mean((truth == INSIDE).astype(np.float32), factor)
    unknown = reduced_mean((truth == IGNORED).astype(np.float32), factor)
    known = (share >= 0.5).astype(np.int8)
    known[(unknown > MIXED_FRACTION) | ((share > MIXED_FRACTION) & (share < 1 - MIXED_FRACTION))] = -1
    return known


def known_of_some(truth: Image, factor: int) -> NDArray[np.int8]:
    """Labels of reduced pixels from scribbles: a single labelled pixel decides."""
    inside, outside = (reduced_mean((truth == level).astype(np.float32), factor) for level in (INSIDE, OUTSIDE))
    least = (1 - MIXED_FRACTION) * (inside + outside)
    return np.where(inside + outside <= 0, -1, np.where(inside >= least, 1, np.where(outside >= least, 0, -1))).astype(
        np.int8
    )


def mirrored(rows: Floats) -> Floats:
    """The same pixels in the mirrored image, in which only their places differ."""
    found = rows.copy()
    found[:, ALL_FEATURES.index("x")] = 1 - rows[:, ALL_FEATURES.index("x")]
    found[:, ALL_FEATURES.index("across")] = -rows[:, ALL_FEATURES.index("across")]
    return found
