"""Grow the forests that come with ffseg from drawings alone; run ``python -m ffseg.learning.grow [--out DIR | --check]``.

Writes ``prior.ffmodel``, ``base.ffmodel``, ``box.ffmodel`` and ``hints.ffmodel``. No photograph is read: all they learn from
is what ``ffseg/learning/drawn`` draws from the seeds written there. The same versions of NumPy, OpenCV and LightGBM, which the
header of each model names, give the same bytes on any x86-64 machine: the command starts itself again without the vector
instructions that not all of them have (`SAME_ARITHMETIC`). ``--check`` says in seconds whether the forests there are of this
code: their headers hold a digest of what the first look at each kind teaches (`fingerprint`).
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from hashlib import blake2b
from importlib.metadata import version
from itertools import chain, repeat
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Array, Floats, Mask, Plane
from ffseg.evidence import base, box, hints, prior
from ffseg.evidence.clicks import HALF, Click, ClickedImage, first_state, next_state
from ffseg.evidence.features import ALL_FEATURES, PLACE_FEATURES, features
from ffseg.evidence.forest import Model, load_model, to_bytes
from ffseg.evidence.growing import SETTINGS, boosted
from ffseg.evidence.maps import certain_odds
from ffseg.evidence.source import model_odds
from ffseg.evidence.surroundings import STRIDE
from ffseg.image.appearance import WORKING_SIZE, Appearance
from ffseg.image.raster import window_of
from ffseg.io.files import write_bytes_atomic
from ffseg.io.images import prepare_worker
from ffseg.learning.drawn.clicks import Clicks
from ffseg.learning.drawn.sights import KINDS, Sight, sights
from ffseg.learning.examples import known_pixels, samples_by_default
from ffseg.learning.training import SampleSet
from ffseg.learning.training import grown as learned
from ffseg.metrics import IGNORED, INSIDE

VIEWS_PER_KIND, PIXELS_PER_VIEW = 160, 400
"""Looks at each kind of pictures, and pixels taken of each look."""

TREES = 110
FOREST_SETTINGS = {
    **SETTINGS,
    "learning_rate": 0.08,
    "num_leaves": 24,
    "min_data_in_leaf": 100,
    "feature_fraction": 0.35,
    "max_bin": 255,
}
"""Settings of LightGBM beside those that `ffseg learn` has."""

LEARNED_START = 4.0
"""Reduced pixels; the prior learns from smaller starts than it is asked with (`prior.MIN_START_RADIUS`)."""

BOXES = {"thing": 4, "animal": 4, "tissue": 2, "field": 2, "organ": 2, "nuclei": 2, "colony": 2}
"""Boxes that are drawn round one object, for each kind of pictures that shows objects and no ground: most round what looks
most unlike itself."""

MAX_BOX_FRACTION, LOOSENESS = 0.8, (-0.02, 0.2)
"""Part of a picture up to which a box is learned from, and by how much a loose box is larger on each side than the one round
the truth, in parts of the mean of its sides."""

CLICKED_VIEWS = 40
"""Looks at each kind with clicks on what the prior says; each gives half a dozen of what one start gives. A hundred grow no
better forest."""

FIRST_CLICKED = 50_000
"""Number of the first picture with clicks: what the prior says of those that it has learned from is too good."""

MODELS, TAUGHT, FIRST_TAUGHT, FIRST_ANSWERED = 4, 5, 30_000, 60_000
"""Models of each kind, as `ffseg learn` makes them, whose answers clicks correct in as many more looks; masks of each, and
numbers of the first picture with a mask and with an answer."""

CLICKS, PIXELS_PER_CLICK, CLICK_SIZES = (3, 9), 150, (0.005, 0.02)
"""Least number of clicks in a picture and one more than the most; pixels taken after each; radii in parts of its longer side."""

UNKNOWN = np.int8(-1)

BASE_FEATURES = tuple(name for name in ALL_FEATURES if name not in PLACE_FEATURES[:4])

FORESTS = {
    prior.MODEL.name: prior.FEATURE_NAMES,
    base.BASE.name: BASE_FEATURES,
    box.MODEL.name: box.FEATURE_NAMES,
    hints.MODEL.name: hints.FEATURE_NAMES,
}
"""Features of each forest, by the name of its file."""

SAME_ARITHMETIC = {
    "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX",
    "OPENBLAS_CORETYPE": "Nehalem",
    "OPENCV_CPU_DISABLE": "AVX,FP16,AVX2,FMA3,AVX512-SKX",
    "OPENCV_IPP": "disabled",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F",
}
"""What makes NumPy, its linear algebra, OpenCV and the C library compute alike whatever the processor can do."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Sampled pixels of one view: features, labels and weights."""

    rows: Floats
    inside: Mask
    weights: Array


def main() -> int:
    """Write all forests, or check those that are there; 1 if they are not of this code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--out", type=Path, default=prior.MODEL.parent, help="folder to write to, or to check")
    parser.add_argument("--looks", type=int, default=VIEWS_PER_KIND, metavar="N", help="looks at each kind of pictures")
    parser.add_argument("--check", action="store_true", help="write nothing; say whether the forests are of this code")
    options = parser.parse_args()
    if any(os.environ.get(name) != value for name, value in SAME_ARITHMETIC.items()):
        again = [sys.executable, "-m", "ffseg.learning.grow", *sys.argv[1:]]
        os.execve(sys.executable, again, os.environ | SAME_ARITHMETIC)  # noqa: S606 - this very program
    with ProcessPoolExecutor() as pool, TemporaryDirectory() as folder:
        if options.check:
            return check(options.out, pool)
        forests = grown(options.looks, pool, Path(folder))
        made_by = {"versions": versions(), "fingerprint": fingerprint(Path(folder), pool)}
    options.out.mkdir(parents=True, exist_ok=True)
    for name, forest in forests.items():
        write_bytes_atomic(options.out / name, to_bytes(replace(forest, about=forest.about | made_by)))
    return 0


def grown(looks: int, pool: Executor, folder: Path) -> dict[str, Model]:
    """All forests, by the names of their files, from so many looks at each kind.

    Those that clicks need are written into the folder.
    """
    few = max(1, looks * CLICKED_VIEWS // VIEWS_PER_KIND)
    about, about_clicks = (
        {"drawn": {"looks": count, "kinds": list(KINDS)}, "photographs": 0} for count in (looks, 2 * few)
    )
    seen = [one for found in pool.map(prior_samples, KINDS, repeat(looks)) for one in found]
    forests = {
        name: grow([part for look in seen for part in look[place]], FORESTS[name], about)
        for place, name in enumerate((prior.MODEL.name, base.BASE.name, box.MODEL.name))
    }
    for name in (prior.MODEL.name, base.BASE.name):
        write_bytes_atomic(folder / name, to_bytes(forests[name]))
    hinted = pool.map(hint_samples, KINDS, repeat(few), repeat(few), repeat(folder))
    clicked = [part for found in hinted for part in found]
    return forests | {hints.MODEL.name: grow(clicked, hints.FEATURE_NAMES, about_clicks)}


def versions() -> dict[str, str]:
    """Versions of the packages that the bytes depend on."""
    return {name: version(name) for name in ("numpy", "opencv-python-headless", "lightgbm")}


def fingerprint(folder: Path, pool: Executor) -> str:
    """A digest of what the first look at each kind teaches every forest; the forests in the folder are asked before clicks."""
    digest = blake2b(digest_size=16)
    looks = pool.map(prior_samples, KINDS, repeat(1))
    answered = chain([1], repeat(0))  # one kind tells whether models are learned as they were
    hinted = pool.map(hint_samples, KINDS, repeat(1), answered, repeat(folder))
    for (look,), clicked in zip(looks, hinted, strict=True):
        for one in chain(*look, clicked):
            for part in (one.rows, one.inside, one.weights):
                digest.update(part.tobytes())
    return digest.hexdigest()


def check(folder: Path, pool: Executor) -> int:
    """Print whether the forests in a folder are of this code; 0 if so, 1 if not, 2 where other packages may be the reason."""
    about = {name: load_model(folder / name, features).about for name, features in FORESTS.items()}
    here, found = versions(), fingerprint(folder, pool)
    others = [name for name, one in about.items() if one.get("fingerprint") != found]
    if not others:
        sys.stdout.write("all forests are of this code\n")
        return 0
    there = about[others[0]].get("versions")
    why = "grow them again" if there == here else f"they were grown with {there}, here are {here}"
    sys.stdout.write(f"not of this code: {', '.join(others)}; {why}\n")
    return 1 if there == here else 2


def prior_samples(kind: str, count: int) -> list[tuple[list[Samples], list[Samples], list[Samples]]]:
    """Samples for the prior, the base and the box, from several views of a kind of drawings."""
    prepare_worker()
    found = []
    for number, seen in enumerate(sights(kind, count)):
        rng = np.random.default_rng([*kind.encode(), number, 1])
        found.append(([for_prior(seen, rng)], [for_base(seen, rng)], for_box(kind, number, seen)))
    return found


def for_prior(seen: Sight, rng: np.random.Generator) -> Samples:
    """Samples of labelled pixels with the features of the prior."""
    found = prior.start_features(Appearance(seen.image), seen.disc(), LEARNED_START)
    known = known_pixels(seen.truth, found.factor)[::STRIDE, ::STRIDE]
    return sampled(prior.all_planes(found), known, rng)


def for_base(seen: Sight, rng: np.random.Generator) -> Samples:
    """Samples of labelled pixels with the features of the base."""
    found = features(Appearance(seen.image), seen.disc())
    planes = np.stack([found[name] for name in BASE_FEATURES])
    return sampled(planes, known_pixels(seen.truth, found.factor), rng)


def hint_samples(kind: str, count: int, answered: int, folder: Path) -> list[Samples]:
    """Samples for clicks, from looks at what the prior says, and at what models do, of drawings that neither has learned from.

    The prior and the base are those in the folder, which these are grown with, not those that are shipped.
    """
    prepare_worker()
    prior.MODEL, base.BASE = folder / prior.MODEL.name, folder / base.BASE.name
    models, found = models_of(kind, min(MODELS, answered)), list[Samples]()
    for number, seen in enumerate(sights(kind, count, FIRST_CLICKED)):
        found += for_clicks(seen, np.random.default_rng([*kind.encode(), number, 2]))
    for number, seen in enumerate(sights(kind, answered, FIRST_ANSWERED)):
        rng = np.random.default_rng([*kind.encode(), number, 3])
        found += for_clicks(seen, rng, models[number % len(models)])
    return found


def models_of(kind: str, count: int) -> list[Model]:
    """Models of a kind of drawings, as `ffseg learn` makes them."""
    taught = list(sights(kind, 2 * TAUGHT * count, FIRST_TAUGHT))[::2]  # two are at one picture
    known = [samples_by_default(one.image, one.truth) for one in taught]
    return [learned(SampleSet(known[first : first + TAUGHT])) for first in range(0, len(known), TAUGHT)]


def for_clicks(seen: Sight, rng: np.random.Generator, model: Model | None = None) -> list[Samples]:
    """Samples near each click of a simulated user but the first, where it may correct the state before it.

    What clicks show is guessed, as the forest that is to tell it grows from this. They correct what the prior says or, if
    one is given, what a model does.
    """
    shape, clicks, found = seen.truth.shape, Clicks((seen.start,)), list[Samples]()
    inside, outside = clicks.regions(shape)
    answer = None if model is None else partial(_answer, model, model.appearance(seen.image))
    base = None if answer is None else answer(inside)
    clicked = ClickedImage(Appearance(seen.image), inside, outside, base, 0.0, None, answer)
    own, say = prior.prior_view(clicked.appearance, clicked.inside), clicked.reduced_base
    state = first_state(clicked, own.cautious_odds if say is None else say, clicked.inside)
    for _ in range(int(rng.integers(*CLICKS))):
        mask = (clicked.enlarged(state.odds) > 0) & (clicked.enlarged(state.stays) >= HALF) & ~outside | inside
        before, clicks = clicks, clicks.next(mask, seen.truth, float(rng.uniform(*CLICK_SIZES)) * max(shape))
        if clicks == before:
            break
        within = len(clicks.inside) > len(before.inside)
        one = Click(*clicks.last(within), within)
        last = clicked.correction(state, clicked.disc(one), within, len(clicks.outside) == 1)
        inside, outside = clicks.regions(shape)
        if within:
            own, say = prior.prior_view(clicked.appearance, inside), clicked.base_from(inside)
        view = hints.hint_view(own, outside & ~inside)
        planes = hints.all_planes(view, last, say)
        known, near = known_pixels(seen.truth, view.seen.factor)[::STRIDE, ::STRIDE], clicked.near(last)
        found += [sampled(planes, np.where(near, known, UNKNOWN), rng, PIXELS_PER_CLICK)]
        odds, likelier, nearer = (
            planes[hints.FEATURE_NAMES.index(name)] for name in ("prior", "likelier", "inside_or_outside")
        )
        guess = np.clip(
            odds + rng.uniform() * likelier - rng.uniform(0, 2) * nearer + rng.normal(),
            -prior.MAX_LOG_ODDS,
            prior.MAX_LOG_ODDS,
        )
        state = next_state(
            clicked, state, *hints.near_and_elsewhere(guess.astype(np.float32), view, last), inside, last
        )
    return found


def _answer(model: Model, image: Appearance, start: Mask) -> Plane:
    """What a model says, in log odds, as clicks correct it."""
    return certain_odds(model_odds(model, image, start))


def for_box(kind: str, number: int, seen: Sight) -> list[Samples]:
    """Samples in boxes round an object, one tight and some loose; none in wide boxes."""
    rows, columns = (np.flatnonzero((seen.truth == INSIDE).any(axis=axis)) for axis in (1, 0))
    if kind not in BOXES or len(rows) * len(columns) > MAX_BOX_FRACTION * seen.truth.size:
        return []
    rng = np.random.default_rng([*kind.encode(), number, 2])
    mean_side, found = (len(rows) + len(columns)) / 2, []
    tight = np.array([columns[0], rows[0], columns[-1], rows[-1]], np.float64)
    for loose in range(BOXES[kind]):
        share = rng.uniform(*LOOSENESS, 4) if loose else np.zeros(4)
        left, top, right, bottom = (tight + np.array([-1, -1, 1, 1]) * share * mean_side).tolist()
        view = box.box_view(seen.image, window_of((left, top, right, bottom), seen.truth.shape))
        if view is not None:
            level, within = view.at(seen.truth), view.seen.inside[::STRIDE, ::STRIDE] == 0
            known = np.where(level == INSIDE, 1, np.where((level == IGNORED) | ~within, -1, 0)).astype(np.int8)
            found.append(sampled(box.all_planes(view), known, rng))
    return found


def sampled(planes: Plane, known: NDArray[np.int8], rng: np.random.Generator, most: int = PIXELS_PER_VIEW) -> Samples:
    """Some of the labelled pixels, from planes of shape (F, h, w), half of them inside.

    Both sides are weighed between alike and by their area.
    """
    known = known.ravel()
    sides = [np.flatnonzero(known == side) for side in (0, 1)]
    chosen = [rng.permutation(side)[: most // 2] for side in sides]
    share = len(sides[1]) / max(1, len(sides[0]) + len(sides[1]))
    weights = [
        np.full(len(one), (0.25 + 0.5 * part) / max(1, len(one)))
        for one, part in zip(chosen, (1 - share, share), strict=True)
    ]
    at = np.concatenate(chosen)
    rows = np.ascontiguousarray(planes.reshape(len(planes), -1)[:, at].T)
    return Samples(rows, known[at] > 0, np.concatenate(weights))


def grow(looks: Sequence[Samples], names: tuple[str, ...], about: dict[str, object]) -> Model:
    """A forest on these samples and features; every view has the same weight."""
    import lightgbm

    weights = np.concatenate([one.weights for one in looks])
    data = lightgbm.Dataset(
        np.concatenate([one.rows for one in looks]),
        np.concatenate([one.inside for one in looks]).astype(np.float32),
        weight=weights / weights.mean(),
        params=FOREST_SETTINGS,
    )
    return Model(boosted(data, TREES, names), None, WORKING_SIZE, about)


if __name__ == "__main__":
    sys.exit(main())
