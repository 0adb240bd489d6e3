"""The learned prior: which pixels of an unknown image belong to the region of the start, by a forest grown on drawings.

The forest uses no place in the image and no absolute position, only the appearance of a pixel, its difference from the
start region, and what lies on the best path between them. It is part of the package; ``python -m ffseg.learning.grow``
makes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from ffseg.arrays import Mask, Plane
from ffseg.evidence.features import (
    BARRIER_FEATURES,
    COLOUR_FEATURES,
    GEODESIC_SCALES,
    RELATIVE_FEATURES,
    SHAPELESS_FEATURES,
    Features,
    barriers,
    distance_plane,
    enlarged,
    features,
    from_middle,
    reduced_region,
    write_relative,
)
from ffseg.evidence.forest import shipped
from ffseg.evidence.maps import blurred, expected_overlap, log_odds
from ffseg.evidence.recent import Recent
from ffseg.evidence.surroundings import STRIDE, SURROUNDINGS_FEATURES, strided, surroundings, voted, write_strided
from ffseg.image.appearance import WORKING_SIZE, Appearance
from ffseg.image.parts import parts_holding
from ffseg.scene import Scene
from ffseg.starts.parts import start_core

MODEL = Path(__file__).with_name("prior.ffmodel")

SMOOTHED, UNSCALED = COLOUR_FEATURES[:3], SHAPELESS_FEATURES[len(GEODESIC_SCALES) * len(COLOUR_FEATURES) :]
"""Features that are seen at each scale, and those that are seen once."""

PIXEL_FEATURES = (
    *(f"{name}@{scale:g}" for scale in GEODESIC_SCALES for name in (*SMOOTHED, *RELATIVE_FEATURES)),
    *UNSCALED,
    "distance",
)
"""Features the forest sees: all but the place in the image and the direction from the start (the distance it sees), and but
gradients as they are, which only tell where they stand on a way."""

COLOUR_FLOOD_FEATURES = tuple(f"unlike_{name}" for name in BARRIER_FEATURES)
"""Planes of a flood from the start over colours, which rises as these become less like the start's."""

ALIKE_LOG_RATIO = 5.0
"""Log likelihood ratio of a colour, in the start over in the image, above which the colour flood passes freely."""

FEATURE_NAMES = (*PIXEL_FEATURES, *SURROUNDINGS_FEATURES, *COLOUR_FLOOD_FEATURES)

SMOOTHING = 1.0
"""Reduced pixels: standard deviation of the final smoothing of the log odds."""

MIN_START_RADIUS = 6.0
"""Reduced pixels. A smaller start is too small a sample of its region and is enlarged by its surroundings."""

MAX_LOG_ODDS = 7.0
"""Largest absolute log odds of a pixel, and those of the start region, which is inside by definition."""

CAUTION = 0.32
"""Subtracted from the log odds: on kinds of images that it was not grown on, the forest predicts too large regions. The
mean IoU of pixels gains .012 (standard error .003) on kinds left out, .004 on kinds that were learned from."""


CACHED_APPEARANCES = 4
"""What the prior and a model see of the reduced copy that is looked at while the hand moves, and of crops of it."""

_appearances = Recent[Appearance](CACHED_APPEARANCES)


def appearance_of(scene: Scene, size: int = WORKING_SIZE, *, even: bool = True) -> Appearance:
    """What is seen of the image of a scene; that of a draft is kept, as the same is asked for again at each move of the hand."""
    make = partial(Appearance, scene.image, size, even)
    return _appearances.of(scene.image, (size, even), make) if scene.draft else make()


@dataclass(frozen=True, eq=False)
class PriorView:
    """An image seen from a start: the input of the forest.

    Attributes
    ----------
    seen : Features
    """

    seen: Features

    @cached_property
    def planes(self) -> Plane:
        """Features of the forest (`all_planes`), shape (len(FEATURE_NAMES), h, w)."""
        return all_planes(self.seen)

    @cached_property
    def forest_odds(self) -> Plane:
        """Log odds of the forest before smoothing, shape (h, w), at most ``MAX_LOG_ODDS`` in absolute value."""
        forest = shipped(MODEL, FEATURE_NAMES).inside
        return np.clip(forest.log_odds(self.planes), -MAX_LOG_ODDS, MAX_LOG_ODDS)

    @cached_property
    def odds(self) -> Plane:
        """Smoothed log odds at every `STRIDE`-th pixel of the reduced image, shape (h, w)."""
        return blurred(voted(self.forest_odds, self.seen), SMOOTHING / STRIDE)

    @property
    def cautious_odds(self) -> Plane:
        """The same less `CAUTION`: the region ends where they are 0."""
        return self.odds - np.float32(CAUTION)

    def of_pixels(self, starts: Mask) -> Plane:
        """Smoothed log odds of the pixels of the image, and those of its start, shape (H, W)."""
        whole = enlarged(self.odds, self.seen.factor, self.seen.shape, STRIDE)
        whole[starts] = MAX_LOG_ODDS
        return whole


def prior_view(image: Appearance, starts: Mask) -> PriorView:
    """The input of the forest."""
    return PriorView(start_features(image, starts))


def prior(image: Appearance, starts: Mask) -> Plane:
    """Log odds that pixels belong to the region of the start.

    Parameters
    ----------
    image : Appearance
        In even exposure, of an image of shape (H, W) or (H, W, 3).
    starts : ndarray of bool, shape (H, W)
        Pixels of the start region, at least one.

    Returns
    -------
    ndarray of float32, shape (H, W)
        Logarithm of the odds of belonging to what the start lies on, at most ``MAX_LOG_ODDS`` either way.
    """
    return prior_view(image, starts).of_pixels(starts)


def cautious_prior(image: Appearance, starts: Mask) -> Plane:
    """The same less `CAUTION`: the region ends where they are 0."""
    return prior(image, starts) - np.float32(CAUTION)


def start_features(image: Appearance, starts: Mask, least: float = MIN_START_RADIUS) -> Features:
    """Features for the prior, from a start that is enlarged to the radius `least` if it is smaller."""
    return features(image, starts, SHAPELESS_FEATURES, least)


def all_planes(seen: Features) -> Plane:
    """The planes that the forest takes, in its order, of every `STRIDE`-th pixel: `FEATURE_NAMES`."""
    planes = np.empty((len(FEATURE_NAMES), *seen.inside[::STRIDE, ::STRIDE].shape), np.float32)
    write_pixel_features(seen, planes[: len(PIXEL_FEATURES)])
    surroundings(seen, planes[len(PIXEL_FEATURES) : -len(COLOUR_FLOOD_FEATURES)])
    heights = np.maximum(np.float32(ALIKE_LOG_RATIO) - blurred(strided(seen["likeness"]), 1.0 / STRIDE), np.float32(0))
    barriers(heights, reduced_region(seen.inside > 0, STRIDE), planes[-len(COLOUR_FLOOD_FEATURES) :])
    return planes


def write_pixel_features(seen: Features, out: Plane) -> None:
    """Write ``PIXEL_FEATURES`` of every `STRIDE`-th pixel."""
    count, rest = len(SMOOTHED), len(UNSCALED) + 1
    for scale, planes in zip(GEODESIC_SCALES, np.split(out[:-rest], len(GEODESIC_SCALES)), strict=True):
        names = tuple(f"{name}@{scale:g}" for name in SMOOTHED)
        write_strided(seen, names, planes[:count])
        write_relative(seen.colours[scale], seen.inside, planes[:count], planes[count:])
    write_strided(seen, UNSCALED, out[-rest:-1])
    across, along = from_middle(seen.inside)
    out[-1] = distance_plane(across[::STRIDE], along[::STRIDE])


@dataclass(frozen=True, eq=False)
class Look:
    """What the prior sees from the start of a scene.

    Attributes
    ----------
    starts : ndarray of bool, shape (H, W)
        Pixels of the domain that show what is inside, at least one.
    view : PriorView
    said : str
        What to say of a start that is none that was asked for.
    """

    scene: Scene
    starts: Mask
    view: PriorView
    said: str = ""

    @cached_property
    def level(self) -> float:
        """Log odds at which the region ends."""
        return log_odds(self.scene.params.region.probability)

    @cached_property
    def region(self) -> Mask:
        """Where it ends, as far as it hangs together with the start, at every `STRIDE`-th reduced pixel."""
        inside = strided(self.view.seen.inside) > 0
        return parts_holding((self.view.cautious_odds > self.level) | inside, inside)

    @cached_property
    def promised(self) -> float:
        """Overlap to expect of that region."""
        return expected_overlap(self.view.cautious_odds - np.float32(self.level), self.region)

    @property
    def odds(self) -> Plane:
        """Log odds of the pixels of the image, shape (H, W)."""
        found: Plane = self.view.of_pixels(self.starts) - np.float32(CAUTION)
        return found


def look_at(scene: Scene, appearance: Appearance, said: str = "") -> Look | None:
    """A look at a scene that looks so, or None where no start covers a pixel of the domain."""
    starts = shown_by_starts(scene)
    return Look(scene, starts, prior_view(appearance, starts), said) if starts.any() else None


def shown_by_starts(scene: Scene) -> Mask:
    """Pixels of the domain that show what is inside."""
    starts = start_core(scene)
    return starts if scene.limits is None else starts & (scene.limits > 0)
