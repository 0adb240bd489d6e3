"""Growing forests on labelled pixels, with LightGBM."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ffseg.arrays import Floats, Mask
from ffseg.evidence.forest import Forest
from ffseg.plugins import require_lightgbm

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
    "force_col_wise": True,
    "num_threads": 1,
    "learning_rate": 0.1,
    "verbose": -1,
    "seed": 0,
}
"""Of LightGBM. One thread for each forest, and forests side by side: its own threads wait for one another in all that
is done, and two of them take longer than one where anything else has the processor."""

MIN_IN_LEAF = 20
"""Pixels in a leaf of a forest, at least: so many of each side are taken where there are as many."""

LEAVES_OF_AN_IMAGE = 24
"""A leaf holds as many pixels as this part of an image: smaller ones learn what only one image has. On unseen road frames
a twelfth as many gave an IoU lower by .02 from three and from five masks."""


def leaf_size(pixels: int) -> int:
    """Least number of pixels in a leaf of a forest, of so many pixels of an image."""
    return max(MIN_IN_LEAF, pixels // LEAVES_OF_AN_IMAGE)


def boosted(data: Any, trees: int, names: tuple[str, ...]) -> Forest:  # noqa: ANN401 - a lightgbm.Dataset
    """A forest of so many trees, grown on the rows of features of these names, with the settings that these have."""
    import lightgbm

    return converted(lightgbm.train(data.params, data, trees).dump_model()["tree_info"], names)


def boosted_on(rows: Floats, inside: Mask, trees: int, names: tuple[str, ...]) -> Forest:
    """The same, grown on these rows, shape (N, F), with both sides of the same weight, of shape (N,).

    Raises
    ------
    UsageError
        If LightGBM is not installed.
    """
    require_lightgbm()
    import lightgbm

    weight = np.where(inside, 0.5 / np.count_nonzero(inside), 0.5 / np.count_nonzero(~inside)) * len(inside)
    settings = {**SETTINGS, "min_data_in_leaf": leaf_size(len(inside))}
    return boosted(lightgbm.Dataset(rows, inside.astype(np.float32), weight=weight, params=settings), trees, names)


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
