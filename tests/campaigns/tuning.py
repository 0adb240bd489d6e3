"""What ``ffseg tune`` makes of a few masks, beside the defaults and the one setting that is best on the images it has not seen.

Run ``python -m tests.campaigns.tuning [--data DATA] [--sets a,b] [--masks 3] [--draws 3] [--budget 25]``.
DATA (or FFSEG_DATA) holds the folders of `real_images.SETS`. Tuning has to beat the defaults. The best setting is looked for
among all that tuning would try (or the first ``--settings`` of them), the defaults included, by its mean on the rest itself: no
tuning can know it. Where the rest is an image or two, that is the best of many by chance; the one setting that is best on all
images shows how far a choice could go.
"""

import argparse
import sys
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from statistics import mean

import numpy as np

from ffseg.io.images import single_thread
from ffseg.learning.gather import Labelled
from ffseg.learning.space import LIGHTS, MOST_SETTINGS, Setting, levels, settings
from ffseg.learning.tune import Bench, tune
from ffseg.parameters import load_params
from tests.campaigns.learning import start_of
from tests.campaigns.real_images import SETS, Photograph, load
from tests.real_data import data_folder

SHARE_OF_BEST, MOST_LOST = 0.95, 0.01
"""Wanted: this part of the mean of the best setting, and no more than this below the defaults."""


def main() -> int:
    """Run the campaign; 0 also when the images are absent, 1 where a goal is missed."""
    options = _options()
    single_thread()
    everything = list(load(options.data, list(SETS)))
    missed = 0
    for folder in options.sets.split(","):
        photographs = [one for one in everything if one.folder == folder]
        if not photographs:
            print(f"skipped: {folder} is not in {options.data}; name the folder with --data or FFSEG_DATA")
            continue
        missed += tuned_set([labelled_of(one) for one in photographs], folder, options)
    return 1 if missed else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--data", type=Path, default=data_folder(), help="image sets")
    parser.add_argument("--sets", default=",".join(SETS), help="folders separated by commas")
    parser.add_argument("--masks", type=int, default=3, help="masks to tune on")
    parser.add_argument("--draws", type=int, default=3, help="random choices of masks")
    parser.add_argument("--budget", type=float, default=25.0, help="seconds of each tuning, as of the command")
    parser.add_argument(
        "--settings", type=int, default=MOST_SETTINGS, help="settings among which the best is looked for"
    )
    return parser.parse_args()


def labelled_of(photograph: Photograph) -> Labelled:
    """What ``ffseg tune`` would have read of it."""
    params = photograph.placed(load_params())
    return Labelled(photograph.name, photograph.image, photograph.truth, params, start_of(photograph))


def tuned_set(labelled: Sequence[Labelled], folder: str, options: argparse.Namespace) -> int:
    """Say the figures of one set; how many goals were missed."""
    bench, count = Bench(labelled), len(labelled)
    tried: list[Setting] = [{}, *levels(labelled[0].params), *islice(settings(), options.settings)]
    table = np.array([[bench.overlap(number, setting) for number in range(count)] for setting in tried])
    usual = [number for number, one in enumerate(tried) if one.get("edges.levels", LIGHTS[0][0]) == LIGHTS[0][0]]
    rng, rows = np.random.default_rng(1), []
    for _ in range(options.draws):
        drawn = sorted(rng.choice(count, min(options.masks, count - 1), replace=False).tolist())
        rest = [number for number in range(count) if number not in drawn]
        found = tune([labelled[number] for number in drawn], options.budget, lambda _: None)
        own = mean(bench.overlap(number, found.setting) for number in rest)
        best = int(table[:, rest].mean(axis=1).argmax())
        means = table[:, rest].mean(axis=1)
        rows.append((float(means[0]), own, float(means[best]), float(means[usual].max())))
        print(
            f"  {folder} {drawn}: {found.tried} settings in {found.seconds:.0f} s, {found.setting or 'kept'}; best {tried[best]}"
        )
    plain, own, best_mean, usual_mean = (mean(column) for column in zip(*rows, strict=True))
    goals = {
        f"{SHARE_OF_BEST:.0%} of the best": own >= SHARE_OF_BEST * best_mean,
        "the default": own >= plain - MOST_LOST,
    }
    said = ", ".join(f"{name} {'reached' if met else 'MISSED'}" for name, met in goals.items())
    print(
        f"{folder}, {options.masks} masks: default {plain:.3f}, tuned {own:.3f}, best setting {best_mean:.3f}: {said}"
    )
    fixed = table.mean(axis=1).max()
    print(
        f"  the same setting for all choices: at most {fixed:.3f}; best without `edges.levels`, `.highlights`: {usual_mean:.3f}"
    )
    return sum(not met for met in goals.values())


if __name__ == "__main__":
    sys.exit(main())
