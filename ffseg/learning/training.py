"""Training: boosted forests on labelled pixels, and what they are joined with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ffseg.arrays import Floats
from ffseg.evidence.base import base, enough_of, joined, mean_overlap, odds_of
from ffseg.evidence.features import ALL_FEATURES, PLACE_FEATURES
from ffseg.evidence.forest import Forest, Model
from ffseg.image.appearance import TEXTURE
from ffseg.learning.examples import MIN_IN_LEAF, Samples
from ffseg.plugins import require

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

STARTLESS_FEATURES = tuple(
    name for name in ALL_FEATURES if name.partition("@")[0] in TEXTURE or name in PLACE_FEATURES[:2]
)  # fmt: skip
"""Features that need no start."""


def grow(
    chosen: Sequence[Samples],
    names: tuple[str, ...] = ALL_FEATURES,
    trees: int = TREES,
    begin: Sequence[Floats] | None = None,
) -> Forest:
    """Grow a forest; every image has the same weight. Log odds in `begin`, if given, are its starting point.

    Raises
    ------
    UsageError
        If LightGBM is not installed.
    """
    require(*LIGHTGBM)
    import lightgbm

    columns = [ALL_FEATURES.index(name) for name in names]
    rows = np.concatenate([one.rows[:, columns] for one in chosen])
    labels = np.concatenate([one.inside for one in chosen])
    weights = np.concatenate([np.full(len(one.inside), 1 / len(one.inside)) for one in chosen])
    known = None if begin is None else np.concatenate(begin).astype(np.float64)
    least = max(MIN_IN_LEAF, len(rows) // len(chosen) // LEAVES_OF_AN_IMAGE)
    how = {**SETTINGS, "learning_rate": LEARNING_RATE, "min_data_in_leaf": least}
    data = lightgbm.Dataset(
        rows,
        labels.astype(np.float32),
        weight=weights / weights.mean(),
        init_score=known,
        params={**how, "num_threads": 0},  # features are sorted into bins one by one
    ).construct()
    return converted(lightgbm.train(how, data, trees).dump_model()["tree_info"], names)


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
    taught : float or None
        What the masks teach each other; None where there is one.
    both : float or None
        The same with the prior's log odds added.
    """

    asked: bool
    prior: float
    taught: float | None = None
    both: float | None = None


def choose_prior(chosen: Sequence[Samples], *, corrected: bool = False) -> PriorChoice | None:
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
    odds, inside = [one.prior for one in chosen if one.prior is not None], [one.inside for one in chosen]
    if len(odds) < len(chosen):
        return None
    own = mean_overlap(odds, inside)
    if len(chosen) < 2:
        return PriorChoice(True, own)
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
    """
    odds = [odds_of(base(), one.rows) for one in chosen]
    base_choice = choose_base(chosen, odds)
    if not base_choice.corrected:
        return grow(chosen, trees=trees), base_choice
    corrections = grow(chosen, trees=round(trees * CORRECTION_FRACTION), begin=odds)
    return joined(base(), corrections), base_choice


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
        known = begin and [begin[i] for i in others]
        forest = grow([thin[i] for i in others], trees=round(TREES * CORRECTION_FRACTION), begin=known)
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
