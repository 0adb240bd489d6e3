"""Learn the forest that ``ffseg learn`` corrects (``ffseg/evidence/base.ffmodel``), from the pictures that teach the prior.

Run ``python -m tests.campaigns.learn_base --data DATA --out FILE [--without SET] [--drawn 300]``. It sees what a learned
forest sees, but no place in the image and no open ground; ``tests/campaigns/learn_prior.py`` says what the pictures are.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ffseg.evidence.features import NAMES, PLACE
from ffseg.evidence.forest import Model, to_bytes
from ffseg.io.files import write_bytes_atomic
from ffseg.io.images import single_thread
from ffseg.learning.training import known_pixels
from tests.campaigns import learn_prior
from tests.campaigns.learn_prior import DRAWN, Samples, looked, picked
from tests.campaigns.places.drawn import Sight
from tests.campaigns.real_images import SETS, Photograph, load
from tests.real_data import data_folder

SEEN = tuple(name for name in NAMES if name not in PLACE[:4])


def main() -> int:
    """Learn the base; 0 also when the images are absent."""
    options = _options()
    single_thread()
    chosen = [one for one in load(options.data, list(SETS)) if one.folder != options.without]
    if not chosen:
        print(f"skipped: none of the sets is in {options.data}; name the folder with --data or FFSEG_DATA")
        return 0
    about = f"without {options.without}" if options.without else "all"
    write_bytes_atomic(options.out, to_bytes(grow(chosen, about, options.drawn)))
    return 0


def grow(photographs: Sequence[Photograph], about: str, drawn: int = DRAWN) -> Model:
    """The base that those images and drawn pictures give."""
    looks = learn_prior.drawn_samples(drawn, samples)
    return learn_prior.grow(photographs, looks, about, samples, SEEN)


def samples(seen: Sight, rng: np.random.Generator, pixels: int) -> Samples:
    """Some pixels that are known, half of them inside."""
    found = looked(seen, NAMES)
    planes = found.planes[[NAMES.index(name) for name in SEEN]]
    return picked(planes, known_pixels(seen.truth, found.factor), rng, pixels)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--data", type=Path, default=data_folder())
    parser.add_argument("--out", type=Path, required=True, help="the model file to write")
    parser.add_argument("--drawn", type=int, default=DRAWN, metavar="N", help="looks at each kind of drawn pictures")
    parser.add_argument("--without", choices=SETS, help="leave a set out")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
