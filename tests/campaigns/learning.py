"""How well a model of a few masks does on real images that it has not seen, and what it costs.

Run ``python -m tests.campaigns.learning [--data DATA] [--sets a,b] [--masks 1,3,5,10] [--draws 5]``.
DATA (or FFSEG_DATA) holds the folders of `real_images.SETS`. ``road`` is learned at even places of the sorted names and tested at
odd ones; of the other sets some images are drawn to learn from, and the rest is tested. Each figure is the mean over the
draws of the mean IoU of the contour.
"""

from collections.abc import Sequence
from pathlib import Path
from statistics import mean, pstdev

import numpy as np
from numpy.typing import NDArray

from ffseg.api import segment
from ffseg.evidence.forest import Model
from ffseg.evidence.source import model_odds
from ffseg.io.images import prepare_worker
from ffseg.learning.examples import Example, Samples, samples
from ffseg.learning.training import SampleSet, learn
from ffseg.metrics import iou
from ffseg.parameter_files import load_params
from tests.campaigns import harness
from tests.campaigns.real_images import Photograph, load
from tests.real_data import data_folder


def main(
    data: Path = data_folder(), sets: str = "road,real_floors/indoor", masks: str = "1,3,5,10", draws: int = 5
) -> int:
    """Run the campaign; 0 also when the images are absent."""
    prepare_worker()
    for folder in sets.split(","):
        photographs = list(load(data, [folder]))
        if not photographs:
            print(f"skipped: {folder} is not in {data}; name the folder with --data or FFSEG_DATA")
            continue
        chosen = [samples(Example(p.image, p.truth, start_of(p), p.circle[2])) for p in photographs]
        evaluate(photographs, chosen, [int(number) for number in masks.split(",")], draws)
    return 0


def start_of(photograph: Photograph) -> NDArray[np.bool_]:
    x, y, radius = photograph.circle
    height, width = photograph.truth.shape
    rows, columns = np.ogrid[:height, :width]
    return np.asarray((columns - x) ** 2 + (rows - y) ** 2 <= radius**2)


def evaluate(photographs: Sequence[Photograph], chosen: Sequence[Samples], masks: Sequence[int], draws: int) -> None:
    """Say the figures of one set."""
    folder, count = photographs[0].folder, len(photographs)
    pool = range(0, count, 2 if folder == "road" else 1)
    print(f"{folder}: {count} images, without a model {mean(overlap(one, None) for one in photographs):.3f}")
    for number in masks:
        if number > len(pool) or number >= count:
            continue
        rng, found, elsewhere = np.random.default_rng(1), [], []
        for _ in range(1 if number == len(pool) else draws):
            drawn = sorted(rng.choice(pool, number, replace=False).tolist())
            model = learn(SampleSet([chosen[i] for i in drawn]), searched=False)
            rest = range(1, count, 2) if folder == "road" else [i for i in range(count) if i not in drawn]
            overlaps = {i: overlap(photographs[i], model) for i in rest}
            found.append(mean(overlaps.values()))
            seen = {place_of(photographs[i]) for i in drawn}
            elsewhere += [value for i, value in overlaps.items() if place_of(photographs[i]) not in seen]
        print(f"{folder}: {number} masks: {mean(found):.3f} (spread of the draws {pstdev(found):.3f})")
        if elsewhere:
            print(f"  of these, at places of which no mask was given: {mean(elsewhere):.3f} ({len(elsewhere)} results)")


def place_of(one: Photograph) -> str:
    """Where it was taken, as its name tells; all frames of a street are one place."""
    return one.folder if one.folder == "road" else one.name.partition("_")[0]


def overlap(one: Photograph, model: Model | None) -> float:
    """IoU of the contour from the start circle, by a model or the defaults."""
    evidence = None if model is None else model_odds(model, model.appearance(one.image), start_of(one))
    return iou(segment(one.image, one.placed(load_params()), evidence=evidence).mask, one.truth)


if __name__ == "__main__":
    harness.as_command(main)
