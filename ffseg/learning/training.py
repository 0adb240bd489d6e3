"""Training: boosted forests on labelled pixels, and what they are joined with."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ffseg.arrays import Floats
from ffseg.evidence.base import base, enough_of, joined, mean_overlap, odds_of
from ffseg.evidence.features import ALL_FEATURES, PLACE_FEATURES
from ffseg.evidence.forest import Forest, Model
from ffseg.evidence.openings import OPENING_FEATURES
from ffseg.image.appearance import TEXTURE
from ffseg.learning.examples import MIN_IN_LEAF, Samples
from ffseg.plugins import require

if TYPE_CHECKING:
    import lightgbm

LIGHTGBM = "lightgbm", "learning needs LightGBM", "learn"
"""What grows forests, as `require` takes it."""

SETTINGS = {
    "objective": "binary",
    "num_leaves": 15,
    "feature_fraction": 0.4,
    "bagging_fraction": 0.6,
    "bagging_freq": 1,
    "lambda_l2": 5.0,
    "max_bin": 63,
    "use_missing": False,
    "deterministic": True,
    "force_row_wise": True,
    "num_threads": 1,
    "verbose": -1,
    "seed": 0,
}
"""Of LightGBM; one thread, so that the same masks give the same model."""

TREES, LEARNING_RATE = 100, 0.1

LEAVES_OF_AN_IMAGE = 24
"""A leaf holds as many pixels as this part of an image: smaller ones learn what only one image has. On unseen road frames
a twelfth as many gave an IoU lower by .02 from three and from five masks."""

TREE_FRACTION = 0.7
"""Part of the trees that each of two forests has whose mean is taken; their rate of learning is higher by as much."""

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

TRUSTED_FEATURE, TRUSTED_LOG_ODDS = "open3", 0.5
"""The open ground that a forest of one mask trusts beyond what it has learned, and the log odds that it gets there."""

FOREST_FEATURES = tuple(name for name in ALL_FEATURES if not name.startswith("bend"))
"""Features that forests are grown on: without the bends of the light, which teach the grain of the few images, unseen
road frames and floors come out better by .01 to .03."""

STARTLESS_FEATURES = tuple(
    name for name in FOREST_FEATURES if name.partition("@")[0] in TEXTURE or name in PLACE_FEATURES[:2]
)  # fmt: skip
"""Features that need no start."""


def grow(
    chosen: Sequence[Samples],
    names: tuple[str, ...] = FOREST_FEATURES,
    trees: int = TREES,
    begin: Sequence[Floats] | None = None,
) -> Forest:
    """Grow a forest; every image has the same weight. Log odds in `begin`, if given, are its starting point.

    Notes
    -----
    With open ground among the names it is the mean of two forests, of which one does not see it: where borders are faint,
    open ground runs out of the region, which few masks need not show. From one (with ``TRUSTED_LOG_ODDS``),
    three and five masks, mean of five choices, unseen floors come out better by .15, .06 and .01 than without open ground,
    road frames by -.01, .01 and 0; either forest alone varies more with the choice.

    Parameters
    ----------
    names : tuple of str
        The features; open ground comes last.

    Raises
    ------
    UsageError
        If LightGBM is not installed.
    """
    plain = tuple(name for name in names if name not in OPENING_FEATURES)
    data = _binned(chosen, plain, begin)
    if plain == names:
        return converted(_boosted(data, trees, LEARNING_RATE), names)
    part, rate = round(trees * TREE_FRACTION), LEARNING_RATE / TREE_FRACTION
    without = _boosted(data, part, rate)
    with warnings.catch_warnings(action="ignore"):  # of categories, which there are none of
        data.add_features_from(_binned(chosen, names[len(plain) :]))
    both = converted([*without, *_boosted(data, part, rate)], names)
    return replace(both, arrays=both.arrays | {"value": both.arrays["value"] / 2})


def _binned(
    chosen: Sequence[Samples], names: tuple[str, ...], begin: Sequence[Floats] | None = None
) -> lightgbm.Dataset:
    """LightGBM's data set: to sort each feature into bins takes longer than to grow a forest on them."""
    require(*LIGHTGBM)
    import lightgbm

    columns = [ALL_FEATURES.index(name) for name in names]
    rows = np.concatenate([one.rows[:, columns] for one in chosen])
    labels = np.concatenate([one.inside for one in chosen])
    weights = np.concatenate([np.full(len(one.inside), 1 / len(one.inside)) for one in chosen])
    known = None if begin is None else np.concatenate(begin).astype(np.float64)
    least = max(MIN_IN_LEAF, len(rows) // len(chosen) // LEAVES_OF_AN_IMAGE)
    how = {**SETTINGS, "min_data_in_leaf": least, "num_threads": 0}  # features are sorted apart
    data = lightgbm.Dataset(
        rows, labels.astype(np.float32), weight=weights / weights.mean(), init_score=known, params=how
    )
    return data.construct()


def _boosted(data: lightgbm.Dataset, trees: int, rate: float) -> list[dict[str, Any]]:
    """LightGBM's trees on such a data set."""
    import lightgbm

    booster = lightgbm.train({**(data.params or {}), "learning_rate": rate, "num_threads": 1}, data, trees)
    found: list[dict[str, Any]] = booster.dump_model()["tree_info"]
    return found


def trusting(forest: Forest, odds: float = TRUSTED_LOG_ODDS) -> Forest:
    """The forest with one more tree, which adds log odds on open ground and subtracts them elsewhere."""
    tree = {"feature": [0], "threshold": [0.5], "left": [-1], "right": [-2], "root": [0], "value": [-odds, odds]}
    return joined(forest, Forest({name: np.asarray(values) for name, values in tree.items()}, (TRUSTED_FEATURE,)))


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


def choose_base(chosen: Sequence[Samples], odds: Sequence[Floats]) -> BaseChoice:
    """Whether the base, with these log odds, is corrected: if it suits the masks, or they teach each other less.

    Notes
    -----
    One mask always corrects it: on all four sets of photographs that is better than to begin from nothing.
    """
    own, enough = mean_overlap(odds, [one.inside for one in chosen]), enough_of(len(chosen))
    taught = None if own >= enough or len(chosen) < 2 else _left_out_overlap(chosen)
    return BaseChoice(own >= enough or taught is None or own > taught, own, enough, taught)


@dataclass(frozen=True, slots=True)
class PriorChoice:
    """Whether a model uses the prior, and the figures behind it: mean IoU on the sampled pixels.

    Attributes
    ----------
    prior : float
        What the prior has by itself.
    enough : float or None
        From which on it is asked by one mask; None where there are more.
    taught : float or None
        What the masks teach each other; None where there is one.
    both : float or None
        The same with the prior's log odds added.
    """

    asked: bool
    prior: float
    enough: float | None = None
    taught: float | None = None
    both: float | None = None


def choose_prior(chosen: Sequence[Samples], *, corrected: bool = False) -> PriorChoice | None:
    """Whether the prior is used: if it improves cross-validation; None if its log odds are unknown.

    Parameters
    ----------
    corrected : bool
        Whether the masks correct the base.

    Notes
    -----
    One mask, which does not show what prior there is to doubt, asks it where it serves. Tiles of one drawn picture, which are
    alike (8 pictures), have an IoU of .944 .953 .951 from three, five, eight masks, .947 .958 .957 without the prior, .913 .906
    .905 with it; pictures that are not alike (8 kinds) .700 .702 .704, .661 .676 .708 and .700 .706 .714.
    """
    odds, inside = [one.prior for one in chosen if one.prior is not None], [one.inside for one in chosen]
    if len(odds) < len(chosen):
        return None
    own = mean_overlap(odds, inside)
    if len(chosen) < 2:
        return PriorChoice(own >= enough_of(1), own, enough_of(1))
    few, left_out = some_of(len(chosen)), _left_out_odds(tuple(chosen), corrected=corrected)
    both = [one + np.float32(PRIOR_WEIGHT) * known[few] for one, known in zip(left_out, odds, strict=True)]
    taught, helped = (mean_overlap(told, [one[few] for one in inside]) for told in (left_out, both))
    return PriorChoice(helped > taught, own, taught=taught, both=helped)


def learn(chosen: Sequence[Samples], *, searched: bool = True) -> Model:
    """A model of what lies inside and, if `searched`, of where to start."""
    return replace(grown(chosen), start=grow(chosen, STARTLESS_FEATURES) if searched else None)


def grown(chosen: Sequence[Samples], trees: int = TREES) -> Model:
    """A model of what lies inside: its forest (see `grow_inside`), with the prior if it is used (see `choose_prior`).

    Notes
    -----
    The log odds of both are added. Over ten choices of one, two, three and five masks, with a prior that has not seen
    the set, that gives floors an IoU higher by .02, .01, .02 and .01, things one by 0, .10, .03 and .07, mirrors (of
    one to three masks) one by .03, .03 and 0; road frames, of which it knows little, .02 less from two masks, else the same.
    """
    inside, base_choice = grow_inside(chosen, trees)
    prior_choice = choose_prior(chosen, corrected=base_choice.corrected)
    about = {"base": asdict(base_choice), "prior": None if prior_choice is None else asdict(prior_choice)}
    weight = PRIOR_WEIGHT if prior_choice is not None and prior_choice.asked else 0.0
    return Model(inside, None, about=about, exposed=True, prior=weight)


def grow_inside(chosen: Sequence[Samples], trees: int = TREES) -> tuple[Forest, BaseChoice]:
    """The forest for inside pixels: the corrected base or one of the masks' own, and which (see `choose_base`).

    Notes
    -----
    The base is also corrected where it does better on the masks than they teach each other: on unlike things that gives an
    IoU higher by .05 from three masks, by .11 from five.
    On floors that the base has not seen, correcting it gives an IoU higher by .07 from five masks; on road frames, of
    which it knows little, one lower by .04, and it is left aside.
    One mask corrects it with all trees where it does not serve; over all choices of the mask that gives road frames .01 more
    than nothing but the mask, floors .05, mirrors and things .07. One mask does not show how far open ground can be trusted
    either; it is (``TRUSTED_LOG_ODDS``), which gives floors, mirrors and road frames .01 to .02 more, things .01 less.
    """
    odds = [odds_of(base(), one.rows) for one in chosen]
    base_choice = choose_base(chosen, odds)
    alone = len(chosen) == 1
    known = base_choice.corrected and not (alone and base_choice.base < base_choice.enough)
    found = grow(
        chosen,
        trees=round(trees * CORRECTION_FRACTION) if known else trees,
        begin=odds if base_choice.corrected else None,
    )
    if base_choice.corrected:
        found = joined(base(), found)
    return trusting(found) if alone else found, base_choice


def _left_out_overlap(chosen: Sequence[Samples]) -> float:
    few = some_of(len(chosen))
    return mean_overlap(_left_out_odds(tuple(chosen), corrected=False), [one.inside[few] for one in chosen])


def folds(count: int) -> list[range]:
    """Parts that so many images are left out in."""
    return [range(part, count, min(FOLDS, count)) for part in range(min(FOLDS, count))]


def some_of(count: int) -> slice:
    """Pixels of each of so many images that are looked at to see how well these teach each other."""
    return slice(None, None, SUBSAMPLING * -(-count // FOLDS))


@lru_cache(maxsize=1)  # of masks that leave the base aside both decisions ask
def _left_out_odds(chosen: tuple[Samples, ...], *, corrected: bool) -> list[Floats]:
    """Log odds of some pixels of each image by a small forest from others, alone or correcting the base."""
    few = some_of(len(chosen))
    thin = [Samples(one.rows[few], one.inside[few]) for one in chosen]
    begin = [odds_of(base(), one.rows) for one in thin] if corrected else None
    odds: dict[int, Floats] = {}
    for fold in folds(len(thin)):
        others = [number for number in range(len(thin)) if number not in fold]
        data = _binned([thin[i] for i in others], FOREST_FEATURES, begin and [begin[i] for i in others])
        forest = converted(_boosted(data, round(TREES * CORRECTION_FRACTION), LEARNING_RATE), FOREST_FEATURES)
        for number in fold:
            odds_of_others = odds_of(forest, thin[number].rows)
            odds[number] = odds_of_others if begin is None else odds_of_others + begin[number]
    return [odds[number] for number in range(len(thin))]


def converted(trees: Sequence[dict[str, Any]], names: tuple[str, ...]) -> Forest:
    """LightGBM's trees as arrays; a threshold becomes the largest single below it, which parts singles alike."""
    lists: dict[str, list[Any]] = {name: [] for name in ("feature", "threshold", "left", "right", "root", "value")}
    for tree in trees:
        lists["root"].append(_added(tree["tree_structure"], lists))
    kinds = {"threshold": np.float32, "value": np.float32}
    return Forest({name: np.array(values, kinds.get(name, np.int32)) for name, values in lists.items()}, names)


def _added(node: dict[str, Any], lists: dict[str, list[Any]]) -> int:
    if "leaf_value" in node and "split_feature" not in node:
        lists["value"].append(node["leaf_value"])
        return -len(lists["value"])
    place = len(lists["feature"])
    threshold = np.float32(node["threshold"])
    if float(threshold) > node["threshold"]:
        threshold = np.nextafter(threshold, np.float32(-np.inf))
    lists["feature"].append(node["split_feature"])
    lists["threshold"].append(threshold)
    lists["left"].append(0)
    lists["right"].append(0)
    lists["left"][place] = _added(node["left_child"], lists)
    lists["right"][place] = _added(node["right_child"], lists)
    return place
