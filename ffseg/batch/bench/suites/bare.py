"""What the suite ``batch`` compares a batch with: a plain loop of decode, edge map and encode; and reading unguarded."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

import numpy as np

from ffseg.batch.bench.measure import Sample, Timer
from ffseg.formats.images import read_image
from ffseg.formats.masks import encode_mask
from ffseg.image.edges import edge_map
from ffseg.image.reference import one_thread, reference_read
from ffseg.parameters import Parameters


TRIES = 5
"""Reads of each file; the fastest counts, so that waiting for a turn on a busy machine does not."""


def reading(paths: Sequence[Path], *, guarded: bool) -> Timer:
    """A timer of reading files, guarded or with ``cv2.imread``, in milliseconds an image."""
    read: Callable[[Path], object] = read_image if guarded else lambda path: reference_read(os.fspath(path))

    def sample() -> Sample:
        mean = sum(_fastest(path, read) for path in paths) * 1e3 / len(paths)
        return Sample(mean, mean)

    return sample


def _fastest(path: Path, read: Callable[[Path], object]) -> float:
    seconds = []
    for _ in range(TRIES):
        begin = perf_counter()
        read(path)
        seconds.append(perf_counter() - begin)
    return min(seconds)


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
