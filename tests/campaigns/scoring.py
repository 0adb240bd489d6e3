"""How true the score is on drawings that nothing was learned from: ``python -m tests.campaigns.scoring [--looks 12]``.

Segments so many looks at each kind that ``ffseg.learning.drawn`` draws, of numbers far beyond those it learned from, with the
defaults: from its start, from one to five clicks of a simulated user, and from boxes round it as tight as they can be, as a
quick hand draws them, and too large. Says of each the mean IoU, the mean score, their Spearman correlation, and how many results
with a score of .9 have an IoU below .5; then, of the prior and of boxes, the slope and the ratio (`ffseg.image.edges`) that
a logistic regression of the IoU on the overlap they promise gives: where what is in use came from.
"""

from collections.abc import Iterator
from dataclasses import replace
from statistics import mean

import numpy as np

from ffseg.api import segment
from ffseg.evidence.box import CALIBRATION
from ffseg.image.edges import PRIOR_CALIBRATION, ScoreCalibration
from ffseg.io.images import prepare_worker
from ffseg.learning.drawn.clicks import Clicks
from ffseg.learning.drawn.sights import KINDS, Sight, sights
from ffseg.metrics import iou
from ffseg.parameter_files import load_params
from ffseg.parameters import Init, click_radius
from ffseg.result import Segmentation
from tests.campaigns import harness
from tests.campaigns.real_sets import spearman
from tests.masks import box_round

UNSEEN = 100_000
"""Number of the first picture."""
MOST_CLICKS = 5
WIDE = 0.6
"""Part of a picture up to which the box of a truth says something."""
BOXES = {"tight box": (0.0, 0.0), "quick box": (-0.02, 0.1), "loose box": (0.05, 0.2)}
"""By how much each side lies further out, in parts of the mean of the box's sides."""
SURE, WRONG = 0.9, 0.5

Outcome = tuple[str, float, float, bool]
"""Evidence source, score, IoU, and whether anything else is doubted."""


def outcomes(seen: Sight, number: int) -> Iterator[tuple[str, Outcome]]:
    """What was given, and what came of it."""
    x, y, radius = seen.start
    yield "start", _judged(_found(seen, Init(center=(x, y), radius=radius)), seen)
    clicks, mask = Clicks(), np.zeros(seen.truth.shape, np.bool_)
    for count in range(1, MOST_CLICKS + 1):
        clicks = clicks.next(mask, seen.truth, click_radius(seen.truth.shape))
        found = _found(seen, Init(circles=clicks.inside, background=clicks.outside))
        mask = found.mask
        yield f"click {count}", _judged(found, seen)
    tight = box_round(seen.truth)
    if np.prod(tight[2:] - tight[:2]) < WIDE * seen.truth.size:
        rng = np.random.default_rng(number)
        for name, limits in BOXES.items():
            left, top, right, bottom = map(float, box_round(seen.truth, rng.uniform(*limits, 4)))
            yield name, _judged(_found(seen, Init(boxes=((left, top, right, bottom),))), seen)


def _found(seen: Sight, init: Init) -> Segmentation:
    return segment(seen.image, replace(load_params(), init=init))


def _judged(found: Segmentation, seen: Sight) -> Outcome:
    return found.source, found.score, iou(found.mask, seen.truth), bool(found.doubts)


def regression(overlaps: list[float], found: list[float]) -> tuple[float, float]:
    """Slope and ratio by which promised overlaps become the IoU found: logistic regression by Newton's method."""
    promised = np.clip(overlaps, 1e-3, 1 - 1e-3)
    odds = np.log(promised / (1 - promised))
    inputs, weights = np.stack([np.ones_like(odds), odds - odds.mean()], axis=1), np.array([0.0, 1.0])
    for _ in range(50):
        expected = 1 / (1 + np.exp(-inputs @ weights))
        curvature = (inputs * (expected * (1 - expected))[:, None]).T @ inputs
        weights += np.clip(np.linalg.solve(curvature, inputs.T @ (np.array(found) - expected)), -0.5, 0.5)
    return float(weights[1]), float(np.exp(weights[1] * odds.mean() - weights[0]))


def fitted(rows: list[Outcome], used: ScoreCalibration) -> str:
    """What a regression gives for results that were decided by one calibration, and doubted for nothing else."""
    slope, ratio = regression([used.overlap(row[1]) for row in rows], [row[2] for row in rows])
    return f"{len(rows)} results, slope {slope:.2f} ({used.slope:g} in use), ratio {ratio:.2f} ({used.ratio:g} in use)"


def main(looks: int = 12) -> int:
    """Print the figures."""
    prepare_worker()
    rows: dict[str, list[Outcome]] = {}
    for kind in KINDS:
        for number, seen in enumerate(sights(kind, looks, UNSEEN)):
            for name, outcome in outcomes(seen, number):
                rows.setdefault(name, []).append(outcome)
    print("| given | results | IoU | score | Spearman | sure and wrong |\n| --- | --- | --- | --- | --- | --- |")
    for name, found in rows.items():
        scores, overlaps = [row[1] for row in found], [row[2] for row in found]
        wrong = sum(score >= SURE and overlap < WRONG for score, overlap in zip(scores, overlaps, strict=True))
        print(
            f"| {name} | {len(found)} | {mean(overlaps):.3f} | {mean(scores):.3f} | {spearman(scores, overlaps):.2f} | {wrong} |"
        )
    by = {
        "prior": (rows["start"], PRIOR_CALIBRATION),
        "box": ([one for name in BOXES for one in rows[name]], CALIBRATION),
    }
    for source, (found, used) in by.items():
        print(f"{source}: {fitted([row for row in found if row[0] == source and not row[3]], used)}")
    return 0


if __name__ == "__main__":
    harness.as_command(main)
