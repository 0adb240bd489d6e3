"""How well a model of a few masks does on real images that it has not seen, and what it costs.

Run ``python -m tests.campaigns.learning [--data DATA] [--sets a,b] [--masks 1,3,5,10] [--draws 5]``.
DATA (or FFSEG_DATA) holds the folders of `real_images.SETS`. ``road`` is learned at even places of the sorted names and tested at
odd ones; of the other sets some images are drawn to learn from, and the rest is tested. Each figure is the mean over the
draws of the mean IoU of the contour. ``--rivals`` grows
scikit-learn's forests on the same pixels.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import mean, pstdev

import numpy as np
from numpy.typing import NDArray

from ffseg.api import segment
from ffseg.evidence.features import KNOWN, enlarged, exposed, features
from ffseg.evidence.forest import Model
from ffseg.evidence.openings import OPEN
from ffseg.evidence.source import told
from ffseg.io.images import single_thread
from ffseg.learning.training import (
    LEAST_IN_LEAF,
    LEAVES_OF_AN_IMAGE,
    PART,
    RATE,
    TAUGHT,
    TREES,
    Example,
    Samples,
    grow,
    learn,
    samples,
)
from ffseg.metrics import iou
from ffseg.parameters import load_params
from tests.campaigns import harness
from tests.campaigns.real_images import Photograph, load
from tests.real_data import data_folder

GOALS = {("road", 1): 0.68, ("road", 3): 0.78, ("road", 5): 0.82, ("road", 10): 0.85, ("real_floors/indoor", 5): 0.78}
"""Mean IoU wanted, by set and number of masks."""


def main(
    data: Path = data_folder(),
    sets: str = "road,real_floors/indoor",
    masks: str = "1,3,5,10",
    draws: int = 5,
    rivals: bool = False,
) -> int:
    """Run the campaign; 0 also when the images are absent."""
    single_thread()
    for folder in sets.split(","):
        photographs = list(load(data, [folder]))
        if not photographs:
            print(f"skipped: {folder} is not in {data}; name the folder with --data or FFSEG_DATA")
            continue
        chosen = [samples(Example(p.image, p.truth, start_of(p), p.circle[2])) for p in photographs]
        evaluate(photographs, chosen, [int(number) for number in masks.split(",")], draws)
        if rivals:
            against_rivals(photographs, chosen, 5, draws)
    return 0


def start_of(photograph: Photograph) -> NDArray[np.bool_]:
    """Pixels in the start circle."""
    x, y, radius = photograph.circle
    rows, columns = np.indices(photograph.truth.shape, sparse=True)
    return np.asarray((columns - x) ** 2 + (rows - y) ** 2 <= radius**2)


def evaluate(photographs: Sequence[Photograph], chosen: Sequence[Samples], masks: Sequence[int], draws: int) -> None:
    """Say the figures of one set."""
    folder, count = photographs[0].folder, len(photographs)
    pool = list(range(0, count, 2)) if folder == "road" else list(range(count))
    plain = mean(overlap(one, None) for one in photographs)
    print(f"{folder}: {count} images, without a model {plain:.3f}")
    for number in masks:
        if number > len(pool) or number >= count:
            continue
        rng, found, elsewhere = np.random.default_rng(1), [], []
        for _ in range(1 if number == len(pool) else draws):
            drawn = sorted(rng.choice(pool, number, replace=False).tolist())
            model = learn([chosen[i] for i in drawn], searched=False)
            rest = range(1, count, 2) if folder == "road" else [i for i in range(count) if i not in drawn]
            overlaps = {i: overlap(photographs[i], model) for i in rest}
            found.append(mean(overlaps.values()))
            seen = {place_of(photographs[i]) for i in drawn}
            elsewhere += [value for i, value in overlaps.items() if place_of(photographs[i]) not in seen]
        goal = GOALS.get((folder, number))
        wanted = f", wanted {goal}" if goal else ""
        print(f"{folder}: {number} masks: {mean(found):.3f} (spread of the draws {pstdev(found):.3f}){wanted}")
        if elsewhere:
            print(f"  of these, at places of which no mask was given: {mean(elsewhere):.3f} ({len(elsewhere)} results)")


def place_of(one: Photograph) -> str:
    """Where it was taken, as its name tells; all frames of a street are one place."""
    return one.folder if one.folder == "road" else one.name.partition("_")[0]


def against_rivals(photographs: Sequence[Photograph], chosen: Sequence[Samples], masks: int, draws: int) -> None:
    """Say what scikit-learn's forests take to grow and how well they do, in LightGBM's place, without the base."""
    folder, count = photographs[0].folder, len(photographs)
    pool, rng = list(range(0, count, 2 if folder == "road" else 1)), np.random.default_rng(1)
    spent: dict[str, list[float]] = {"LightGBM": [], "scikit-learn": []}
    found: dict[str, list[float]] = {"LightGBM": [], "scikit-learn": []}
    for _ in range(draws):
        drawn = sorted(rng.choice(pool, masks, replace=False).tolist())
        rest = range(1, count, 2) if folder == "road" else [i for i in range(count) if i not in drawn]
        for name, grown in (("LightGBM", _own), ("scikit-learn", _histogram)):
            begin = time.process_time()
            says = grown([chosen[i] for i in drawn])
            spent[name].append(time.process_time() - begin)
            found[name].append(mean(contoured(photographs[i], says(photographs[i])) for i in rest))
    for name, seconds in spent.items():
        print(f"{folder}: {masks} masks: {name}: {mean(found[name]):.3f}, grown in {mean(seconds):.1f} s")


Says = Callable[[Photograph], NDArray[np.float32]]


def _own(chosen: Sequence[Samples]) -> Says:
    model = Model(grow(chosen), exposed=True)
    return lambda one: model.map(model.look(one.image, start_of(one)))


def _histogram(chosen: Sequence[Samples]) -> Says:
    """The mean of two forests, of which one does not see open ground, with the settings that both libraries have."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    rows, labels = np.concatenate([one.rows for one in chosen]), np.concatenate([one.inside for one in chosen])
    weights = np.concatenate([np.full(len(one.inside), 1 / len(one.inside)) for one in chosen])
    least = max(LEAST_IN_LEAF, len(rows) // len(chosen) // LEAVES_OF_AN_IMAGE)
    forests = []
    for names in ([name for name in TAUGHT if name not in OPEN], TAUGHT):
        columns = [KNOWN.index(name) for name in names]
        forest = HistGradientBoostingClassifier(
            learning_rate=RATE / PART, max_iter=round(PART * TREES), max_leaf_nodes=15, l2_regularization=5.0, max_bins=63,
            min_samples_leaf=least, max_features=0.4, early_stopping=False, random_state=0,
        )  # fmt: skip
        forests.append((forest.fit(rows[:, columns], labels, weights / weights.mean()), columns))

    def says(one: Photograph) -> NDArray[np.float32]:
        seen = features(exposed(one.image), start_of(one), names=KNOWN)
        flat = seen.planes.reshape(len(KNOWN), -1).T
        odds = np.mean([forest.decision_function(flat[:, columns]) for forest, columns in forests], axis=0)
        probability = (1 / (1 + np.exp(-odds))).astype(np.float32).reshape(seen.inside.shape)
        return enlarged(probability, seen.factor, seen.shape)

    return says


def overlap(one: Photograph, model: Model | None) -> float:
    """IoU of the contour from the start circle."""
    return contoured(one, None if model is None else told(model, one.image, start_of(one)))


def contoured(one: Photograph, evidence: NDArray[np.float32] | None) -> float:
    """IoU of the contour that a map gives, or the defaults without one."""
    return iou(segment(one.image, one.placed(load_params()), evidence=evidence).mask, one.truth)


if __name__ == "__main__":
    harness.as_command(main)
