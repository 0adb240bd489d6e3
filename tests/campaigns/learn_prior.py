"""Learn the forest that comes with ffseg (``ffseg/evidence/prior.ffmodel``), and say how well it does on what it has not seen.

Run ``python -m tests.campaigns.learn_prior --data DATA --out FILE [--part even|odd|all|none] [--without SET]``.
DATA (or the environment variable FFSEG_DATA) holds the sets of real images that ``tests/campaigns/real_sets.py`` reads; the
images are sorted by name, those at even places are one half. Each image is seen from its own start and from others drawn in
its truth, as it is and with other light, mirrored, and, under a mirror, turned. Beside them stand pictures of rooms, streets,
mirrors and things that ``tests/campaigns/places`` draws; ``--drawn 0`` leaves them out, ``--part none`` learns from them alone.

``python -m tests.campaigns.learn_prior --cross`` learns from each half and segments the other with the defaults, then
learns without each set and segments that set, then from what is drawn alone: the figures of ``docs/real-images.md``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import mean

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.evidence import prior
from ffseg.evidence.features import WORKING_SIZE, Features, exposed, features
from ffseg.evidence.forest import Model, to_bytes
from ffseg.evidence.surroundings import STRIDE
from ffseg.io.files import write_bytes_atomic
from ffseg.io.images import single_thread
from ffseg.learning.training import SETTINGS, converted, known_pixels
from ffseg.metrics import INSIDE
from ffseg.parameters import load_params
from tests.campaigns.places.drawn import KINDS, Sight
from tests.campaigns.places.drawn import sights as drawn_sights
from tests.campaigns.real_images import SETS, Outcome, Photograph, evaluate, load
from tests.campaigns.real_sets import spearman
from tests.real_data import data_folder

VIEWS = {"road": 6, "seeded_objects": 12, "real_floors/indoor": 9, "real_floors/omni": 18}
"""Starts and lights each image of a set is seen in; sets of few images more often."""
HALVES = ("even", "odd")
TREES, PIXELS = 110, 1200
DRAWN_PIXELS = 400
"""Of each drawn picture: they are many."""
DRAWN_AS = 36
"""A kind of drawn pictures counts as much as a place with so many sights."""
OTHERS = {
    **SETTINGS,
    "learning_rate": 0.08,
    "num_leaves": 24,
    "min_data_in_leaf": 100,
    "feature_fraction": 0.35,
    "max_bin": 255,
}
DRAWN = 300
"""Looks at each kind of drawn pictures."""
LEARNED_START = 4.0
"""Reduced pixels; the forest learns from smaller starts than it is asked with (`prior.LEAST_START`)."""
RADII = (6.0, 24.0)
"""px, of the starts that are drawn."""


def sights(photograph: Photograph, rng: np.random.Generator) -> Iterator[Sight]:
    """The image from its own start, then from others, in other light."""
    own = Sight(photograph.image, photograph.truth, photograph.circle)
    yield own
    for _ in range(VIEWS[photograph.folder] - 1):
        seen = replace(own, start=_inside(own.truth, rng))
        if rng.random() < 0.6:
            seen = replace(seen, image=relit(own.image, rng))
        if rng.random() < 0.5:
            seen = _mirrored(seen)
        if photograph.folder.endswith("omni"):
            for _ in range(int(rng.integers(4))):
                seen = _turned(seen)
        yield seen


def relit(image: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Another exposure, gamma and colour of light; sometimes noise or blur."""
    levels = (image.astype(np.float32) / 255) ** np.float32(np.exp(rng.normal(0, 0.25)))
    levels *= np.float32(np.exp(rng.normal(0, 0.25)))
    if image.ndim == 3:
        levels = levels * np.exp(rng.normal(0, 0.06, 3)).astype(np.float32)
    if rng.random() < 0.5:
        levels = levels + rng.normal(0, rng.uniform(0, 0.012), levels.shape)
    found = np.clip(levels * 255, 0, 255).astype(np.uint8)
    return cv2.GaussianBlur(found, (0, 0), float(rng.uniform(0.5, 1.5))) if rng.random() < 0.3 else found


def _inside(truth: NDArray[np.uint8], rng: np.random.Generator) -> tuple[float, float, float]:
    """A start in the inner part of the truth."""
    depth = cv2.distanceTransform(np.pad((truth == INSIDE).astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    least = max(4.0, float(np.quantile(depth[depth > 0], 0.6)))
    rows, columns = np.nonzero(depth >= min(least, depth.max() * 0.7))
    place = int(rng.integers(len(rows)))
    y, x = int(rows[place]), int(columns[place])
    return float(x), float(y), float(min(depth[y, x] * 0.9, rng.uniform(*RADII)))


def _mirrored(seen: Sight) -> Sight:
    x, y, radius = seen.start
    width = seen.image.shape[1]
    return Sight(
        np.ascontiguousarray(seen.image[:, ::-1]),
        np.ascontiguousarray(seen.truth[:, ::-1]),
        (width - 1 - x, y, radius),
    )


def _turned(seen: Sight) -> Sight:
    x, y, radius = seen.start
    width = seen.image.shape[1]
    image, truth = (np.ascontiguousarray(np.rot90(plane)) for plane in (seen.image, seen.truth))
    return Sight(image, truth, (y, width - 1 - x, radius))


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Pixels of one sight, both sides weighed between alike and by their area."""

    rows: NDArray[np.float32]
    inside: NDArray[np.bool_]
    weights: NDArray[np.float64]


def samples(seen: Sight, rng: np.random.Generator, pixels: int = PIXELS) -> Samples:
    """Some pixels that are known, half of them inside."""
    found = prior.look(seen.image, start_of(seen), WORKING_SIZE, LEARNED_START)
    known = known_pixels(seen.truth, found.factor)[::STRIDE, ::STRIDE]
    return picked(prior.all_planes(found), known, rng, pixels)


def looked(seen: Sight, names: tuple[str, ...]) -> Features:
    """Features of a sight from its start."""
    return features(exposed(seen.image), start_of(seen), names=names)


def start_of(seen: Sight) -> NDArray[np.bool_]:
    """The pixels of its start circle."""
    x, y, radius = seen.start
    rows, columns = np.indices(seen.truth.shape, sparse=True)
    disc: NDArray[np.bool_] = (rows - y) ** 2 + (columns - x) ** 2 <= radius**2
    return disc


def picked(planes: NDArray[np.float32], known: NDArray[np.int8], rng: np.random.Generator, pixels: int) -> Samples:
    """Some of the pixels that are known, of planes of shape (F, h, w), half of them inside."""
    known = known.ravel()
    sides = [np.flatnonzero(known == side) for side in (0, 1)]
    chosen = [rng.permutation(side)[: pixels // 2] for side in sides]
    share = len(sides[1]) / max(1, len(sides[0]) + len(sides[1]))
    weights = [
        np.full(len(one), (0.25 + 0.5 * part) / max(1, len(one)))
        for one, part in zip(chosen, (1 - share, share), strict=True)
    ]
    at = np.concatenate(chosen)
    return Samples(
        np.ascontiguousarray(planes.reshape(len(planes), -1)[:, at].T), known[at] > 0, np.concatenate(weights)
    )


Taking = Callable[[Sight, np.random.Generator, int], Samples]


def drawn_samples(count: int, taking: Taking = samples) -> list[Samples]:
    """What so many looks at each kind of drawn pictures give; the kinds side by side."""
    if count == 0:
        return []
    with ProcessPoolExecutor() as pool:
        parts = pool.map(_drawn, KINDS, [count] * len(KINDS), [taking] * len(KINDS))
        return [one for found in parts for one in found]


def _drawn(kind: str, count: int, taking: Taking) -> list[Samples]:
    single_thread()
    rng = np.random.default_rng(KINDS.index(kind))
    found = [taking(seen, rng, DRAWN_PIXELS) for seen in drawn_sights(kind, count)]
    return [replace(one, weights=one.weights * np.sqrt(DRAWN_AS) / count) for one in found]


def grow(
    photographs: Sequence[Photograph],
    drawn: Sequence[Samples],
    about: str,
    taking: Taking = samples,
    names: tuple[str, ...] = prior.TAKEN,
) -> Model:
    """The model that those images give, on what `taking` takes of them, the features of those `names`.

    Places with many images count as the root of their number.
    """
    import lightgbm

    rng = np.random.default_rng(0)
    taken: list[Samples] = list(drawn)
    for photograph in photographs:
        found = [taking(seen, rng, PIXELS) for seen in sights(photograph, rng)]
        alike = sum(_place(other) == _place(photograph) for other in photographs) * len(found)
        taken += [replace(one, weights=one.weights / np.sqrt(alike)) for one in found]
    weights = np.concatenate([one.weights for one in taken])
    data = lightgbm.Dataset(
        np.concatenate([one.rows for one in taken]),
        np.concatenate([one.inside for one in taken]).astype(np.float32),
        weight=weights / weights.mean(),
    )
    booster = lightgbm.train(OTHERS, data, TREES)
    forest = converted(booster.dump_model()["tree_info"], names)
    return Model(forest, None, WORKING_SIZE, {"images": len(photographs), "drawn": len(drawn), "part": about})


def _place(photograph: Photograph) -> str:
    """Where an image was taken, as its name tells; all frames of a street are one place."""
    if photograph.folder == "road":
        return "road"
    return f"{photograph.folder}/{photograph.name.partition('_')[0]}"


def main() -> int:
    """Learn, or with ``--cross`` learn from parts and score the rest; 0 also when the images are absent."""
    options = _options()
    single_thread()
    photographs = list(load(options.data, list(SETS)))
    if not photographs:
        print(f"skipped: none of the sets is in {options.data}; name the folder with --data or FFSEG_DATA")
        return 0
    drawn = drawn_samples(options.drawn)
    if options.cross:
        return _cross(photographs, drawn, options)
    chosen = [one for one in photographs if options.part in ("all", HALVES[one.half]) and one.folder != options.without]
    model = grow(chosen, drawn, f"{options.part} of {len(photographs)}")
    write_bytes_atomic(options.out, to_bytes(model))
    return 0


def _cross(photographs: Sequence[Photograph], drawn: Sequence[Samples], options: argparse.Namespace) -> int:
    """Scores of each half by the other, of each set by the other sets, and of all by what is drawn."""
    params = load_params(None, options.set)

    def scored(tested: Sequence[Photograph], others: Sequence[Photograph]) -> list[Outcome]:
        write_bytes_atomic(options.out, to_bytes(grow(others, drawn, "part")))
        prior.MODEL = options.out
        prior._model.cache_clear()
        return [evaluate(one, params, 1) for one in tested]

    def without(apart: Callable[[Photograph], bool]) -> list[Outcome]:
        return scored([one for one in photographs if apart(one)], [one for one in photographs if not apart(one)])

    _say(
        "learned from the other half",
        [one for half in (0, 1) for one in without(lambda it, half=half: it.half == half)],
    )
    _say(
        "learned from the other sets",
        [one for name in SETS for one in without(lambda it, name=name: it.folder == name)],
    )
    if drawn:
        _say("learned from drawings", scored(photographs, []))
    return 0


def _say(what: str, outcomes: Sequence[Outcome]) -> None:
    by_set = {folder: [one.overlap for one in outcomes if one.photograph.folder == folder] for folder in SETS}
    figures = "  ".join(f"{folder} {mean(values):.3f}" for folder, values in by_set.items() if values)
    pairs = [(one.result.score, one.overlap) for one in outcomes if one.result is not None]
    rho = spearman([sure for sure, _ in pairs], [found for _, found in pairs])
    print(f"{what}: {figures}  Spearman of the score {rho:.2f}", flush=True)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=data_folder())
    parser.add_argument("--out", type=Path, required=True, help="the model file to write")
    parser.add_argument("--part", choices=("even", "odd", "all", "none"), default="all")
    parser.add_argument("--drawn", type=int, default=DRAWN, metavar="N", help="looks at each kind of drawn pictures")
    parser.add_argument("--without", choices=SETS, help="leave a set out")
    parser.add_argument("--cross", action="store_true", help="learn from parts and score the rest")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="for the scores")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
