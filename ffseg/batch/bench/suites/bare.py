"""The bare pipeline a batch is compared with: decode, edge map, encode, in one plain loop. Run by the suite ``batch``."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from ffseg.formats.images import read_image
from ffseg.formats.masks import encode_mask
from ffseg.image.edges import edge_map
from ffseg.image.reference import one_thread
from ffseg.parameters import Parameters


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
