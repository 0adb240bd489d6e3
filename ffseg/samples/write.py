"""Write the sample images and their truths into a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ffseg.errors import ImageReadError, OutputError
from ffseg.io.files import SKIP_FILE, make_folder, printable, read_bytes, write_bytes_atomic
from ffseg.rendering.pairs import CAMERA_YAML, PlanarPose, poses_csv, render_pair
from ffseg.rendering.raycast import Rendering
from ffseg.samples.drive import DRIVE_CAMERA, drive
from ffseg.samples.png import encode
from ffseg.samples.scenes import SCENES

PAIR_SEED = 4
"""Of the first rendered pair: two boxes and three marks, each enclosed by itself. The next pairs have the next seeds."""
SKIP_TEXT = b"This folder is left out when ffseg walks a folder above it; name it to run it.\n"


def sample_files(pairs: int = 1, *, driven: bool = False) -> dict[str, bytes]:
    """Contents of every sample file by its path.

    Parameters
    ----------
    pairs : int
        Rendered pairs: ``pair/``, then ``pair-2/`` and so on.
    driven : bool
        The files of `drive_files` below ``drive/``, too.

    Returns
    -------
    dict of str to bytes
        ``NAME.png``, ``truth/NAME.png`` (a folder left out by walks which begin above it) and the files of
        `pair_files` below each pair's folder.
    """
    files = {f"truth/{SKIP_FILE}": SKIP_TEXT}
    for name, draw in SCENES.items():
        scene = draw()
        files[f"{name}.png"] = encode(scene.image)
        files[f"truth/{name}.png"] = encode(scene.truth)
    for index in range(pairs):
        folder = f"pair-{index + 1}" if index else "pair"
        files |= {f"{folder}/{name}": content for name, content in pair_files(PAIR_SEED + index).items()}
    if driven:
        files |= {f"drive/{name}": content for name, content in drive_files().items()}
    return files


def pair_files(seed: int) -> dict[str, bytes]:
    """Files of a rendered pair: images in order, true free space, labels, camera and poses.

    Labels: 0 ground, 1 and up marks, 100 and up boxes, 200 and up walls, 255 outside the mirror. The three folders hold
    a file that keeps them out of walks which begin above.
    """
    pair = render_pair(seed)
    views = (pair.previous, pair.current)
    labels = {f"labels/{name}": np.where(view.labels < 0, 255, view.labels) for name, view in _named(views)}
    files = {name: encode(picture.astype(np.uint8)) for name, picture in labels.items()}
    return _seen(pair.poses, views, CAMERA_YAML) | files | {f"labels/{SKIP_FILE}": SKIP_TEXT}


def drive_files() -> dict[str, bytes]:
    """Files of a drive: as those of a pair, without labels."""
    driven = drive()
    return _seen(driven.poses, driven.views, DRIVE_CAMERA)


def _seen(poses: Sequence[PlanarPose], views: Sequence[Rendering], camera: str) -> dict[str, bytes]:
    names = [name for name, _ in _named(views)]
    files = {"camera.yaml": camera.encode(), "poses.csv": poses_csv(poses, names).encode(), SKIP_FILE: SKIP_TEXT}
    files |= {name: encode(view.image) for name, view in _named(views)}
    files |= {f"truth/{name}": encode(view.truth.astype(np.uint8) * np.uint8(255)) for name, view in _named(views)}
    return files | {f"truth/{SKIP_FILE}": SKIP_TEXT}


def _named(views: Sequence[Rendering]) -> list[tuple[str, Rendering]]:
    return [(f"{number:04}.png", view) for number, view in enumerate(views, start=1)]


def write_samples(folder: Path, pairs: int = 1, *, driven: bool = False) -> list[Path]:
    """Write every sample file under `folder`.

    Parameters
    ----------
    pairs : int
        Rendered pairs.
    driven : bool
        A drive, too.

    Raises
    ------
    OutputError
        If a file cannot be written, or one of its name holds something else: then nothing is written.
    """
    files = {folder / name: content for name, content in sample_files(pairs, driven=driven).items()}
    missing = [path for path, content in files.items() if not _is_there(path, content)]
    for path in missing:
        make_folder(path.parent)
        write_bytes_atomic(path, files[path])
    return list(files)


def _is_there(path: Path, content: bytes) -> bool:
    """Whether a sample file is there already.

    Raises
    ------
    OutputError
        If another file is, perhaps somebody's own.
    """
    try:
        same = read_bytes(path, len(content)) == content
    except ImageReadError as error:
        if error.reason in ("missing", "bad-name"):
            return False
        same = False
    if not same:
        raise OutputError(f"{printable(path)} is there and is no such sample; choose another folder or remove it")
    return True
