"""What a forest learned from other pictures says of a new one: which pixels belong to what the start lies on.

The forest sees no place in the image and no absolute position, only how a pixel looks, how it differs from the start
region, and what stands on the best way there. It is part of the package; ``tests/campaigns/learn_prior.py`` makes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ffseg.evidence.features import PLACE, PLAIN, Features, enlarged, exposed, features
from ffseg.evidence.forest import Model, load_model
from ffseg.evidence.maps import evidence_edges, log_odds
from ffseg.evidence.surroundings import STRIDE, SURROUNDINGS, every, surroundings, thinned, voted
from ffseg.image.edges import EdgeMap, Scene, gradient_edges
from ffseg.native import _core

MODEL = Path(__file__).with_name("prior.ffmodel")

SEEN = tuple(name for name in PLAIN if name not in PLACE[:4])
"""Features the forest sees: all but the place in the image and the direction from the start; the distance it sees."""

TAKEN = (*SEEN, *SURROUNDINGS)

SMOOTHING = 1.0
"""Reduced pixels, afterwards."""

LEAST_START = 6.0
"""Reduced pixels; radius below which a start does not show what its region looks like, and is looked at with its surroundings."""

CERTAIN = 7.0
"""Log odds up to which a pixel votes, and which the start region is given: inside by definition."""


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """The evidence for one image.

    Attributes
    ----------
    odds : ndarray of float32, shape (H, W)
        Logarithm of the odds of belonging to what the start lies on, at most ``CERTAIN`` either way.
    """

    odds: NDArray[np.float32]

    def at(self, level: float) -> Prior:
        """The evidence whose odds are divided by those of a level, which becomes one half."""
        shift = np.float32(log_odds(level))
        return Prior(self.odds - shift) if shift else self

    def map(self) -> NDArray[np.float32]:
        """The probability's tangent at one half, between 0 and 1: the same level, without a rounded exponential."""
        found: NDArray[np.float32] = np.clip(np.float32(0.5) + np.float32(0.25) * self.odds, 0, 1)
        return found

    def expected_overlap(self, mask: NDArray[np.bool_]) -> float:
        """The IoU to be expected of a region if the probabilities are true: their sum in it over that of its union.

        Parameters
        ----------
        mask : ndarray of bool, shape (H, W)

        Notes
        -----
        Probabilities below one half count as none: there are many of them far off, where they say more of the size of
        the image than of the region.
        """
        odds, inside = thinned(self.odds), mask[::STRIDE, ::STRIDE]
        every = (odds > 0) / (1 + np.exp(-odds))  # products and quotients, where choices would wait for each pixel
        both = float((every * inside).sum(dtype=np.float64))
        either = float(np.count_nonzero(inside)) + float(every.sum(dtype=np.float64)) - both
        return both / either if either > 0 else 0.0


@lru_cache(maxsize=1)
def _model() -> tuple[Model, _core.EvidenceForest]:
    model = load_model(MODEL, TAKEN)
    return model, model.inside.compiled()


def prior(image: NDArray[np.uint8], starts: NDArray[np.bool_]) -> Prior:
    """Evidence of what belongs to the start.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey or BGR.
    starts : ndarray of bool, shape (H, W)
        Pixels of the start region, at least one.
    """
    model, native = _model()
    seen = look(image, starts, model.size)
    smooth = voted(np.clip(model.inside.log_odds(all_planes(seen), native), -CERTAIN, CERTAIN), seen)
    votes = np.empty_like(smooth)
    _core.evidence_blur(smooth, SMOOTHING / STRIDE, votes)
    whole = enlarged(votes, seen.factor, seen.shape, STRIDE)
    whole[starts] = CERTAIN
    return Prior(whole)


def look(image: NDArray[np.uint8], starts: NDArray[np.bool_], size: int, least: float = LEAST_START) -> Features:
    """The features that the prior's planes are made of, at most so many pixels a side, from a start of `least` or more."""
    return features(exposed(image), starts, size, PLAIN, least)


def all_planes(seen: Features) -> NDArray[np.float32]:
    """The planes that the forest takes, in its order, of every `STRIDE`-th pixel: those of ``SEEN``, the surroundings."""
    planes = np.empty((len(TAKEN), *seen.inside[::STRIDE, ::STRIDE].shape), np.float32)
    every(seen, SEEN, planes[: len(SEEN)])
    surroundings(seen, planes[len(SEEN) :])
    return planes


def prior_edges(scene: Scene) -> EdgeMap:
    """Edges where the evidence falls to ``region.probability``: the source ``prior``."""
    return with_prior(scene, gradient_edges(scene))[0]


def with_prior(scene: Scene, image_edges: EdgeMap) -> tuple[EdgeMap, Prior | None]:
    """Edges where the evidence falls to its level, and the evidence at it; the image's own edges if the start covers nothing."""
    if scene.starts is None or not scene.starts.any():
        return image_edges, None
    found = prior(scene.image, scene.starts).at(scene.params.region.probability)
    return evidence_edges(found.map(), image_edges), found
