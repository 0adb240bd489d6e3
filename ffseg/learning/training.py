"""Training: boosted forests on labelled pixels, and what they are joined with."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from ffseg.arrays import Floats, Mask
from ffseg.batch.workers.launch import cores
from ffseg.evidence.base import base, enough_of, joined, mean_overlap, odds_of
from ffseg.evidence.features import ALL_FEATURES, PLACE_FEATURES, TEXTURE_FEATURES
from ffseg.evidence.forest import Forest, Model
from ffseg.evidence.growing import SETTINGS, boosted, leaf_size
from ffseg.learning.examples import MIN_APART, Samples
from ffseg.plugins import require_lightgbm

T = TypeVar("T")

MAX_AT_ONCE = 4
"""Forests that are grown side by side: each of many images needs memory."""

TREES = 100

CORRECTION_FRACTION = 0.4
"""Part of the trees where they correct the base: with all of them, few masks unlearn what it knows, and unseen floors come out
worse by .02."""

PRIOR_WEIGHT = 1.0
"""Of the prior's log odds beside a model's own: two witnesses that do not know of each other. With half of it things, floors
and mirrors gain less, and roads lose less where the prior is asked in vain."""

FOLDS = 10
"""Parts that images are left out in; with fewer images, each is left out alone."""

SUBSAMPLING = 5
"""Every fifth pixel is enough to see how well masks teach each other, so many starts lie one behind another; of more masks than
are left out one by one, fewer of each."""

STARTLESS_FEATURES = (*TEXTURE_FEATURES, *PLACE_FEATURES[:2])
"""Features that need no start."""


class SampleSet:
    """Samples of images that are learned from, or of some of a set.

    Forests of any images of a set share the bins that its features are sorted into, as if all were at hand: bins are quantiles,
    and know no label.

    Parameters
    ----------
    images : sequence of Samples
    whole, numbers
        The set that they are some of, and which.
    """

    def __init__(self, images: Sequence[Samples], whole: SampleSet | None = None, numbers: Sequence[int] = ()) -> None:
        self.images = tuple(images)
        self._whole = self if whole is None else whole
        self.numbers = tuple(range(len(images)) if whole is None else numbers)
        self._bins: dict[tuple[str, ...], Any] = {}
        self._forests: dict[tuple[tuple[int, ...], bool], Forest] = {}

    def __len__(self) -> int:
        return len(self.images)

    @property
    def parts(self) -> bool:
        """Whether the masks mean all things of a kind, not one that a start shows."""
        return float(np.mean([one.apart for one in self.images])) >= MIN_APART

    @property
    def size(self) -> int:
        """Pixels a side that features were computed at."""
        return self.images[0].size

    @property
    def inside(self) -> list[Mask]:
        """Labels of the pixels of each image."""
        return [one.inside for one in self.images]

    def some(self, places: Iterable[int]) -> SampleSet:
        """The images at these places."""
        chosen = sorted(places)
        return SampleSet([self.images[i] for i in chosen], self._whole, [self.numbers[i] for i in chosen])

    def left_out(self) -> list[tuple[SampleSet, SampleSet]]:
        """Parts that are left out in turn, each after the others."""
        count, parts = len(self), min(FOLDS, len(self))
        places = [range(part, count, parts) for part in range(parts)]
        return [(self.some(set(range(count)).difference(part)), self.some(part)) for part in places]

    def thinned(self) -> SampleSet:
        """Some pixels of each: enough to see how well the images teach each other."""
        return self._whole._thin.some(self.numbers)

    @cached_property
    def _thin(self) -> SampleSet:
        few = slice(None, None, SUBSAMPLING * -(-len(self) // FOLDS))
        priors = [None if one.prior is None else one.prior[few] for one in self.images]
        both = zip(self.images, priors, strict=True)
        return SampleSet([replace(one, rows=one.rows[few], inside=one.inside[few], prior=prior) for one, prior in both])

    @property
    def base_odds(self) -> list[Floats]:
        """Log odds of the pixels of each image by the base."""
        return [self._whole._base_odds[i] for i in self.numbers]

    @cached_property
    def _base_odds(self) -> list[Floats]:
        return [odds_of(base(), one.rows) for one in self.images]

    def small_forest(self, *, corrected: bool) -> Forest:
        """A small forest of these images, alone or correcting the base: grown once, however often these are what is left."""
        forests, key = self._whole._forests, (self.numbers, corrected)
        if key not in forests:
            begin = self.base_odds if corrected else None
            forests[key] = grow(self, trees=round(TREES * CORRECTION_FRACTION), begin=begin)
        return forests[key]

    def binned(self, names: tuple[str, ...]) -> Any:  # noqa: ANN401 - a lightgbm.Dataset
        """These images for LightGBM, each with the same weight, as a part of the whole set."""
        import lightgbm

        images, bins = self._whole.images, self._whole._bins
        ends = np.cumsum([0, *(len(one.inside) for one in images)]).tolist()
        if names not in bins:
            # all columns need no copy
            columns = slice(None) if names == ALL_FEATURES else [ALL_FEATURES.index(name) for name in names]
            bins[names] = lightgbm.Dataset(
                [one.rows[:, columns] for one in images],
                np.concatenate(self._whole.inside).astype(np.float32),
                params={**SETTINGS, "min_data_in_leaf": leaf_size(ends[-1] // len(images))},
            ).construct()
        data = bins[names].subset(())  # which would make a list of the numbers, forty bytes each
        data.used_indices = np.concatenate([np.arange(ends[i], ends[i + 1], dtype=np.int32) for i in self.numbers])
        data.construct()
        weights = np.concatenate([np.full(len(one), 1 / len(one)) for one in self.inside])
        return data.set_weight(weights / weights.mean())


def at_once(work: Callable[[Any], T], items: Sequence[Any]) -> Iterator[T]:
    """What comes of each, in order; as many are at work as there are cores, but no more than `MAX_AT_ONCE`."""
    with ThreadPoolExecutor(min(cores(), MAX_AT_ONCE)) as pool:
        yield from pool.map(work, items)


def grow(
    chosen: SampleSet,
    names: tuple[str, ...] = ALL_FEATURES,
    trees: int = TREES,
    begin: Sequence[Floats] | None = None,
) -> Forest:
    """Grow a forest. Log odds in `begin`, if given, are its starting point.

    Raises
    ------
    UsageError
        If LightGBM is not installed.
    """
    require_lightgbm()
    data = chosen.binned(names)
    if begin is not None:
        data.set_init_score(np.concatenate(begin).astype(np.float64))
    return boosted(data, trees, names)


@dataclass(frozen=True, slots=True)
class BaseChoice:
    """Whether masks correct the base, and the figures behind it: mean IoU on the sampled pixels.

    Attributes
    ----------
    base : float
        What the base has by itself.
    enough : float
        From which on it is corrected, whatever the masks teach each other.
    taught : float or None
        What the masks teach each other; None where that was not asked: it was enough, or there is one mask.
    """

    corrected: bool
    base: float
    enough: float
    taught: float | None


def choose_base(chosen: SampleSet, odds: Sequence[Floats]) -> BaseChoice:
    """Whether the base, with these log odds, is corrected: if it suits the masks, or they teach each other less.

    Notes
    -----
    One mask always corrects it: on all four sets of photographs that is better than to begin from nothing.
    """
    own, enough = mean_overlap(odds, chosen.inside), enough_of(len(chosen))
    if len(chosen) < 2:
        return BaseChoice(not chosen.parts, own, enough, None)
    taught = None if own >= enough else _left_out_overlap(chosen, corrected=False)
    return BaseChoice(taught is None or own > taught, own, enough, taught)


@dataclass(frozen=True, slots=True)
class PriorChoice:
    """Whether a model uses the prior, and the figures behind it: mean IoU on the sampled pixels.

    Attributes
    ----------
    prior : float
        What the prior has by itself.
    taught : float or None
        What the masks teach each other; None where there is one.
    both : float or None
        The same with the prior's log odds added.
    """

    asked: bool
    prior: float
    taught: float | None = None
    both: float | None = None


def choose_prior(chosen: SampleSet, *, corrected: bool = False) -> PriorChoice | None:
    """Whether the prior is used: if it improves cross-validation, and by one mask; None if its log odds are unknown.

    Parameters
    ----------
    corrected : bool
        Whether the masks correct the base.

    Notes
    -----
    One mask does not show what prior there is to doubt: models of one, tested on others of the kind, have with it .725 on
    drawings (11 kinds) and .654 on photographs (4 sets), without it .663 and .635; no model has .737 and .621. Tiles of one
    drawn picture, which are alike (8 pictures), have an IoU of .944 .953 .951 from three, five, eight masks, .947 .958 .957
    without the prior, .913 .906 .905 with it; pictures that are not alike (8 kinds) .700 .702 .704, .661 .676 .708 and .700
    .706 .714.
    """
    odds = [one.prior for one in chosen.images if one.prior is not None]
    if len(odds) < len(chosen):
        return None
    own = mean_overlap(odds, chosen.inside)
    if len(chosen) < 2:
        return PriorChoice(not chosen.parts, own)
    taught, both = (_left_out_overlap(chosen, corrected=corrected, prior=weight) for weight in (0.0, PRIOR_WEIGHT))
    return PriorChoice(both > taught, own, taught=taught, both=both)


def learn(chosen: SampleSet, *, searched: bool = True) -> Model:
    """A model of what lies inside and, if `searched`, of where to start."""
    with ThreadPoolExecutor(1) as beside:
        start = beside.submit(lambda: grow(chosen, STARTLESS_FEATURES) if searched else None)
        inside = grown(chosen)
    return replace(inside, start=start.result())


def grown(chosen: SampleSet, trees: int = TREES) -> Model:
    """A model of what lies inside: its forest (see `grow_inside`), with the prior if it is used (see `choose_prior`).

    Notes
    -----
    The log odds of both are added. Over ten choices of one, two, three and five masks, with a prior that has not seen
    the set, that gives floors an IoU higher by .02, .01, .02 and .01, things one by 0, .10, .03 and .07, mirrors (of
    one to three masks) one by .03, .03 and 0; road frames, of which it knows little, .02 less from two masks, else the same.
    """
    inside, base_choice = grow_inside(chosen, trees)
    prior_choice = choose_prior(chosen, corrected=base_choice.corrected)
    said = None if prior_choice is None else asdict(prior_choice)
    about = {"base": asdict(base_choice), "prior": said, "parts": chosen.parts}
    weight = PRIOR_WEIGHT if prior_choice is not None and prior_choice.asked else 0.0
    return Model(inside, None, chosen.size, about=about, exposed=True, prior=weight)


def grow_inside(chosen: SampleSet, trees: int = TREES) -> tuple[Forest, BaseChoice]:
    """The forest for inside pixels: the corrected base or one of the masks' own, and which (see `choose_base`).

    Notes
    -----
    The base is also corrected where it does better on the masks than they teach each other: on unlike things that gives an
    IoU higher by .05 from three masks, by .11 from five.
    On floors that the base has not seen, correcting it gives an IoU higher by .07 from five masks; on road frames, of
    which it knows little, one lower by .04, and it is left aside.
    """
    odds = chosen.base_odds
    base_choice = choose_base(chosen, odds)
    if not base_choice.corrected:
        return grow(chosen, trees=trees), base_choice
    corrections = grow(chosen, trees=round(trees * CORRECTION_FRACTION), begin=odds)
    return joined(base(), corrections), base_choice


def _left_out_overlap(chosen: SampleSet, *, corrected: bool, prior: float = 0.0) -> float:
    """Mean IoU on some pixels of each image by a small forest from others, with the prior's log odds at some weight."""
    odds, inside = list[Floats](), list[Mask]()
    for others, part in chosen.thinned().left_out():
        forest = others.small_forest(corrected=corrected)
        for one, known in zip(part.images, part.base_odds, strict=True):
            told = odds_of(forest, one.rows) + (known if corrected else np.float32(0))
            odds.append(told if one.prior is None else told + np.float32(prior) * one.prior)
            inside.append(one.inside)
    return mean_overlap(odds, inside)
