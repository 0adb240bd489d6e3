"""Forests of one node."""

import numpy as np

from ffseg.evidence.features import ALL_FEATURES, Features
from ffseg.evidence.forest import Forest
from ffseg.evidence.maps import probability


def stump(name: str, threshold: float, above: float = 2.0, names: tuple[str, ...] = ALL_FEATURES) -> Forest:
    """Log odds of `above` where a feature is above the threshold, the opposite elsewhere, and 0.25 everywhere."""
    kinds = {"feature": [names.index(name)], "left": [-1], "right": [-2], "root": [0]}
    arrays = {key: np.array(value, np.int32) for key, value in kinds.items()}
    arrays |= {"threshold": np.array([threshold], np.float32), "value": np.array([-above, above], np.float32)}
    return Forest(arrays, names, 0.25)


def probabilities(forest: Forest, seen: Features) -> np.ndarray:
    """Probability of inside by a forest alone for each reduced pixel, shape (h, w)."""
    return probability(forest.log_odds(np.stack([seen[name] for name in forest.features])))
