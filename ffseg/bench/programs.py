"""Programs that the suites of processes measure: ``python -m ffseg.bench.programs PROGRAM ARGUMENT...``."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from ffseg.image.reference import one_thread
from ffseg.parameters import Parameters


def bare(images: str, masks: str, out: str) -> None:
    """A plain loop: read every image of a folder, make its edge map, write one of the masks of an ``.npy`` file."""
    import numpy as np

    from ffseg.image.edges import edge_map
    from ffseg.io.images import read_image
    from ffseg.io.masks import encode_mask

    ready, edges, folder = np.load(masks), Parameters().edges, Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    with one_thread():
        for index, path in enumerate(sorted(Path(images).iterdir())):
            edge_map(read_image(path), edges)
            (folder / f"{path.stem}.png").write_bytes(encode_mask(ready[index % len(ready)]))


def shards(images: str, out: str) -> None:
    """Run two shards with a worker each at the same time."""
    command = (sys.executable, "-m", "ffseg", "run", images, "--jobs", "1", "--quiet", "--out", out, "--shard")
    runs = [subprocess.Popen([*command, part]) for part in ("1/2", "2/2")]  # noqa: S603 - our own command
    sys.exit(max(run.wait() for run in runs))


PROGRAMS: dict[str, Callable[..., None]] = {"bare": bare, "shards": shards}

if __name__ == "__main__":
    PROGRAMS[sys.argv[1]](*sys.argv[2:])
