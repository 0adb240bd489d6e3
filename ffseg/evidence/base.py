"""A forest grown on drawings, from which `ffseg learn` continues if it already suits the given masks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import mean

import numpy as np

from ffseg.arrays import Floats, Mask
from ffseg.evidence.features import ALL_FEATURES
from ffseg.evidence.forest import ARRAYS, Forest, shipped

BASE = Path(__file__).with_name("base.ffmodel")
"""Part of the package; ``python -m ffseg.learning.grow`` makes it. It sees what a learned forest sees but no place in the
image."""

MIN_IOU, IOU_SPREAD = 0.5, 0.25
"""IoU from which on that forest is corrected by the masks, and not left aside; and how far apart the IoU of images of one
kind lie: their mean must be better by this over the root of their number. On floors unseen by it, it has .67 to .74 on five
masks, on unseen road frames .37 to .56."""

ROW_PIXELS = 1000
"""Pixels side by side in the plane that the native core is given; no plane may have more than 65535 a side."""


def base() -> Forest:
    """The forest, read once."""
    return shipped(BASE, ALL_FEATURES).inside


def odds_of(forest: Forest, rows: Floats) -> Floats:
    """Log odds of inside of pixels, by a forest.

    Parameters
    ----------
    rows : ndarray of float32, shape (N, F)
        Features in the order of ``ALL_FEATURES``.

    Returns
    -------
    ndarray of float32, shape (N,)
    """
    padded = np.zeros((len(forest.features), -(-len(rows) // ROW_PIXELS) * ROW_PIXELS), np.float32)
    padded[:, : len(rows)] = rows[:, [ALL_FEATURES.index(name) for name in forest.features]].T
    found: Floats = forest.log_odds(padded.reshape(len(padded), -1, ROW_PIXELS)).ravel()[: len(rows)]
    return found


def enough_of(masks: int) -> float:
    """Least mean IoU on this many masks for the forest to be corrected rather than replaced."""
    return float(MIN_IOU + IOU_SPREAD / masks**0.5)


def mean_overlap(odds: Sequence[Floats], inside: Sequence[Mask]) -> float:
    """Mean over images of the IoU of their pixels."""
    overlaps = []
    for one, known in zip(odds, inside, strict=True):
        found = one >= 0
        either = np.count_nonzero(found | known)
        overlaps.append(np.count_nonzero(found & known) / either if either else 1.0)
    return float(mean(overlaps))


def joined(one: Forest, other: Forest) -> Forest:
    """The forest whose log odds are the sum of those of two."""
    nodes, leaves = len(one.arrays["feature"]), len(one.arrays["value"])
    places = {name: np.asarray([ALL_FEATURES.index(it) for it in forest.features])[forest.arrays["feature"]]
              for name, forest in (("one", one), ("other", other))}  # fmt: skip
    added = dict(other.arrays)
    for side in ("left", "right"):
        child = other.arrays[side]
        added[side] = np.where(child < 0, child - leaves, child + nodes)
    root = other.arrays["root"]
    added["root"] = np.where(root < 0, root - leaves, root + nodes)
    arrays = {name: np.append(one.arrays[name], added[name]).astype(kind[1:]) for name, kind, _ in ARRAYS}
    arrays["feature"] = np.append(places["one"], places["other"]).astype(np.int32)
    return replace(one, arrays=arrays, features=ALL_FEATURES, bias=one.bias + other.bias)
