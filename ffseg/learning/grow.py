"""Grow the forests that come with ffseg from drawings alone; run ``python -m ffseg.learning.grow [--out DIR]``.

Writes ``prior.ffmodel`` and ``base.ffmodel``. No photograph is read: all they learn from is what ``ffseg/learning/drawn``
draws from the seeds written there. The same versions of NumPy, OpenCV and LightGBM give the same bytes on any x86-64
machine: the command starts itself again without the vector instructions that not all of them have (`SAME_EVERYWHERE`).
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ffseg.evidence import base, prior
from ffseg.evidence.features import NAMES, PLACE, WORKING_SIZE, exposed, features
from ffseg.evidence.forest import Model, to_bytes
from ffseg.evidence.surroundings import STRIDE
from ffseg.io.files import write_bytes_atomic
from ffseg.io.images import single_thread
from ffseg.learning.drawn.sights import KINDS, Sight, sights
from ffseg.learning.training import SETTINGS, converted, known_pixels

LOOKS, PIXELS = 160, 400
"""Looks at each kind of pictures, and pixels taken of each look."""

TREES = 110
GROWN = {
    **SETTINGS,
    "learning_rate": 0.08,
    "num_leaves": 24,
    "min_data_in_leaf": 100,
    "feature_fraction": 0.35,
    "max_bin": 255,
}
"""Settings of LightGBM beside those that `ffseg learn` has."""

LEARNED_START = 4.0
"""Reduced pixels; the prior learns from smaller starts than it is asked with (`prior.LEAST_START`)."""

BASE_SEES = tuple(name for name in NAMES if name not in PLACE[:4])

SAME_EVERYWHERE = {
    "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX",
    "OPENBLAS_CORETYPE": "Nehalem",
    "OPENCV_CPU_DISABLE": "AVX,FP16,AVX2,FMA3,AVX512-SKX",
    "OPENCV_IPP": "disabled",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F",
}
"""What makes NumPy, its linear algebra, OpenCV and the C library compute alike whatever the processor can do."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Pixels of one look: rows of what a forest sees, which lie inside, and how much each counts."""

    rows: NDArray[np.float32]
    inside: NDArray[np.bool_]
    weights: NDArray[np.float64]


def main() -> int:
    """Write both forests."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--out", type=Path, default=prior.MODEL.parent, help="folder to write to")
    parser.add_argument("--looks", type=int, default=LOOKS, metavar="N", help="looks at each kind of pictures")
    options = parser.parse_args()
    if any(os.environ.get(name) != value for name, value in SAME_EVERYWHERE.items()):
        again = [sys.executable, "-m", "ffseg.learning.grow", *sys.argv[1:]]
        os.execve(sys.executable, again, os.environ | SAME_EVERYWHERE)  # noqa: S606 - this very program
    with ProcessPoolExecutor() as pool:
        looks = [one for found in pool.map(taken, KINDS, [options.looks] * len(KINDS)) for one in found]
    about = {"drawn": {"looks": options.looks, "kinds": list(KINDS)}, "photographs": 0}
    for path, place, names in ((prior.MODEL, 0, prior.TAKEN), (base.BASE, 1, BASE_SEES)):
        write_bytes_atomic(options.out / path.name, to_bytes(grow([look[place] for look in looks], names, about)))
    return 0


def taken(kind: str, count: int) -> list[tuple[Samples, Samples]]:
    """What the prior and what the base learn from so many looks at a kind of pictures."""
    single_thread()
    found = []
    for number, seen in enumerate(sights(kind, count)):
        rng = np.random.default_rng([*kind.encode(), number, 1])
        found.append((for_prior(seen, rng), for_base(seen, rng)))
    return found


def for_prior(seen: Sight, rng: np.random.Generator) -> Samples:
    """Some known pixels as the prior sees them."""
    found = prior.look(seen.image, seen.disc(), WORKING_SIZE, LEARNED_START)
    known = known_pixels(seen.truth, found.factor)[::STRIDE, ::STRIDE]
    return picked(prior.all_planes(found), known, rng)


def for_base(seen: Sight, rng: np.random.Generator) -> Samples:
    """Some known pixels as the base sees them."""
    found = features(exposed(seen.image), seen.disc())
    planes = found.planes[[NAMES.index(name) for name in BASE_SEES]]
    return picked(planes, known_pixels(seen.truth, found.factor), rng)


def picked(planes: NDArray[np.float32], known: NDArray[np.int8], rng: np.random.Generator) -> Samples:
    """Some of the pixels that are known, of planes of shape (F, h, w), half of them inside.

    Both sides are weighed between alike and by their area.
    """
    known = known.ravel()
    sides = [np.flatnonzero(known == side) for side in (0, 1)]
    chosen = [rng.permutation(side)[: PIXELS // 2] for side in sides]
    share = len(sides[1]) / max(1, len(sides[0]) + len(sides[1]))
    weights = [
        np.full(len(one), (0.25 + 0.5 * part) / max(1, len(one)))
        for one, part in zip(chosen, (1 - share, share), strict=True)
    ]
    at = np.concatenate(chosen)
    rows = np.ascontiguousarray(planes.reshape(len(planes), -1)[:, at].T)
    return Samples(rows, known[at] > 0, np.concatenate(weights))


def grow(looks: Sequence[Samples], names: tuple[str, ...], about: dict[str, object]) -> Model:
    """The model that those looks give, of the features of those names; every look counts alike."""
    import lightgbm

    weights = np.concatenate([one.weights for one in looks])
    data = lightgbm.Dataset(
        np.concatenate([one.rows for one in looks]),
        np.concatenate([one.inside for one in looks]).astype(np.float32),
        weight=weights / weights.mean(),
    )
    booster = lightgbm.train(GROWN, data, TREES)
    return Model(converted(booster.dump_model()["tree_info"], names), None, WORKING_SIZE, about)


if __name__ == "__main__":
    sys.exit(main())
