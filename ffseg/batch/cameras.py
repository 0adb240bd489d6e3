"""Masks of the cameras' own parts in folders of frames: one for each folder, or one for all images."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Image
from ffseg.batch.plan.sources import InputImage
from ffseg.batch.workers.pictures import read_source
from ffseg.errors import ImageReadError, SegmentationError, UsageError
from ffseg.image.own import own_image
from ffseg.io.files import make_folder, printable, write_bytes_atomic
from ffseg.io.masks import encode_mask

MASK = ".png"


@dataclass(frozen=True, slots=True)
class CameraImages:
    """Images of one camera, and the mask to be written of them."""

    out: str
    images: tuple[InputImage, ...]
    """In the order of the inputs."""


@dataclass(frozen=True, slots=True)
class OwnImage:
    """What was found in a camera's images."""

    out: str
    """The mask that was written; empty if there is none."""
    images: int
    looked: int
    """How many there are, and how many could be looked at."""
    own: float
    """Share of the mask that is 0."""
    problems: tuple[str, ...]
    """Images that cannot be read, and why there is no mask."""


def names_a_mask(out: str) -> bool:
    """Whether that is the name of a mask; else it is one of a folder."""
    return out.lower().endswith(MASK)


def cameras(sources: Sequence[InputImage], out: str) -> list[CameraImages]:
    """Images sorted by camera: all are of one if `out` names a PNG file, else those of a folder, named after it.

    Raises
    ------
    UsageError
        If `out` is a folder and an image lies in none, so that no mask could be named after it.
    """
    if names_a_mask(out):
        return [CameraImages(out, tuple(sources))]
    folders: dict[str, list[InputImage]] = {}
    for source in sources:
        folder = os.path.dirname(source.name)
        if not folder:
            raise UsageError(
                f"{printable(source.display_path)} lies in no folder below the input, and masks in {printable(out)} are named "
                f"after folders; for one mask of all images name a file: --out {printable(out.rstrip('/'))}{MASK}"
            )
        folders.setdefault(folder, []).append(source)
    return [CameraImages(os.path.join(out, folder) + MASK, tuple(images)) for folder, images in folders.items()]


def write_own_image(camera: CameraImages, most: int) -> OwnImage:
    """Look at up to `most` evenly spaced images of a camera, and write a mask that is 0 on its own image."""
    images, unread = len(camera.images), list[str]()
    places = np.rint(np.linspace(0, images - 1, min(most, images))).astype(int)
    try:
        own = own_image(_read([camera.images[place] for place in places], unread))
    except SegmentationError as error:
        problems = (*unread, f"no mask {printable(camera.out)}: {error}")
        return OwnImage("", images, len(places) - len(unread), 0.0, problems)
    make_folder(os.path.dirname(camera.out) or ".")
    write_bytes_atomic(camera.out, encode_mask(~own))
    return OwnImage(camera.out, images, len(places) - len(unread), float(own.mean()), tuple(unread))


def _read(sources: Sequence[InputImage], unread: list[str]) -> Iterator[Image]:
    """The images that can be read, of one size; what is wrong with others is added to `unread`."""
    shape: tuple[int, ...] | None = None
    for source in sources:
        try:
            image = read_source(source)
        except ImageReadError as error:
            unread.append(str(error))
            continue
        if image.shape[:2] != (shape or image.shape[:2]):
            raise SegmentationError(
                f"{printable(source.display_path)} has another size than the images before it; take those of one camera, or "
                "sort them into a folder each and name a folder with --out"
            )
        shape = image.shape[:2]
        yield image
