"""What the suite ``batch`` compares a batch with: a plain loop of decode, edge map and encode; and reading unguarded."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ffseg.bench.measure import Sample, Timer, timed
from ffseg.image.edges import edge_map
from ffseg.image.reference import one_thread, reference_read
from ffseg.io.images import read_image
from ffseg.io.masks import encode_mask
from ffseg.parameters import Parameters

TRIES = 5
"""Reads of each file in either way; of wall time the fastest counts, which waited least for a turn on a busy machine."""


def reading(paths: Sequence[Path]) -> tuple[Timer, Timer]:
    """Timers of reading files guarded and with ``cv2.imread``, in milliseconds an image.

    Both are measured when the first is asked, call by call in turns, so that a busy machine slows both alike; the second
    gives what was measured then.
    """
    plain = [Sample(0.0, 0.0)]

    def first() -> Sample:
        pairs = [_in_turns(path) for path in paths]
        guarded, plain[0] = (_mean(samples) for samples in zip(*pairs, strict=True))
        return guarded

    return first, lambda: plain[0]


def _in_turns(path: Path) -> tuple[Sample, Sample]:
    def unguarded() -> bool:
        return reference_read(os.fspath(path))

    timers = (timed(lambda: read_image(path)), timed(unguarded))
    guarded, plain = zip(*((timers[0](), timers[1]()) for _ in range(TRIES)), strict=True)
    return _fastest(guarded), _fastest(plain)


def _fastest(samples: Sequence[Sample]) -> Sample:
    return Sample(min(sample.value for sample in samples), sum(sample.robust for sample in samples) / len(samples))


def _mean(samples: Sequence[Sample]) -> Sample:
    count = len(samples)
    return Sample(sum(sample.value for sample in samples) / count, sum(sample.robust for sample in samples) / count)


def main(images: Path, masks: Path, out: Path) -> None:
    """Read every image of a folder, make its edge map, and write one of the given masks in its place.

    Parameters
    ----------
    images : Path
        Folder of image files.
    masks : Path
        An ``.npy`` file of masks, bool, shape (n, H, W), taken in turns: what there is to encode.
    out : Path
        Folder for the masks; made if absent.
    """
    ready, edges = np.load(masks), Parameters().edges
    out.mkdir(parents=True, exist_ok=True)
    with one_thread():
        for index, path in enumerate(sorted(images.iterdir())):
            edge_map(read_image(path), edges)
            (out / f"{path.stem}.png").write_bytes(encode_mask(ready[index % len(ready)]))


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:]))
