"""How true the score is on drawings that the prior has not learned from: ``python -m tests.campaigns.scoring [--looks 12]``.

Segments so many looks at each kind that ``ffseg.learning.drawn`` draws, of numbers far beyond those it learned from, with the
defaults. Says for each kind the mean IoU and the mean score, for all of them the Spearman correlation of both, and by what the
odds of the overlap that the prior promises must be divided (`ffseg.judge.OVERLAP_ODDS_RATIO`): a logistic regression of the IoU.
"""

from collections.abc import Iterator
from dataclasses import replace
from statistics import mean

import numpy as np

from ffseg.api import segment
from ffseg.io.images import prepare_worker
from ffseg.judge import OVERLAP_ODDS_RATIO
from ffseg.learning.drawn.sights import KINDS, sights
from ffseg.metrics import iou
from ffseg.parameters import load_params
from tests.campaigns import harness
from tests.campaigns.real_sets import spearman

UNSEEN = 100_000
"""Number of the first picture."""


def outcomes(kind: str, looks: int) -> Iterator[tuple[str, float, float]]:
    """Evidence source, score and IoU of each look at a kind."""
    params = load_params()
    for seen in sights(kind, looks, UNSEEN):
        x, y, radius = seen.start
        found = segment(seen.image, replace(params, init=replace(params.init, center=(x, y), radius=radius)))
        yield found.source, found.score, iou(found.mask, seen.truth)


def odds_ratio(scores: list[float], overlaps: list[float]) -> float:
    """What the odds of the promises must be divided by, from scores that `OVERLAP_ODDS_RATIO` made of them: Newton's method."""
    promised = np.clip(np.array(scores), 1e-3, 1 - 1e-3)
    odds, shift = np.log(promised / (1 - promised)) + np.log(OVERLAP_ODDS_RATIO), 0.0
    for _ in range(50):
        expected = 1 / (1 + np.exp(shift - odds))
        shift += float((expected - overlaps).sum() / (expected * (1 - expected)).sum())
    return float(np.exp(shift))


def main(looks: int = 12) -> int:
    """Print the figures."""
    prepare_worker()
    found = {kind: list(outcomes(kind, looks)) for kind in KINDS}
    for kind, rows in found.items():
        print(f"{kind}: IoU {mean(row[2] for row in rows):.3f}, score {mean(row[1] for row in rows):.3f}")
    scores, overlaps = ([row[at] for rows in found.values() for row in rows if row[0] == "prior"] for at in (1, 2))
    print(f"prior: {len(scores)} results, IoU {mean(overlaps):.3f}, score {mean(scores):.3f}", end=", ")
    print(f"Spearman {spearman(scores, overlaps):.2f}, odds ratio {odds_ratio(scores, overlaps):.2f}")
    return 0


if __name__ == "__main__":
    harness.as_command(main)
