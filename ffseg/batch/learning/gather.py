"""Images with their masks and starts, read once."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ffseg.batch.discover import Source, discover
from ffseg.batch.inputs.truths import find_truths
from ffseg.batch.workers.sources import read_source
from ffseg.batch.workers.truth import read_truth
from ffseg.errors import ImageReadError, UsageError
from ffseg.formats.files import printable
from ffseg.formats.images import single_thread
from ffseg.formats.starts import Start, load_starts
from ffseg.image.raster import rasterize
from ffseg.metrics import INSIDE
from ffseg.parameters import Parameters
from ffseg.segmenters.starts import start_contours


@dataclass(frozen=True, slots=True, eq=False)
class Labelled:
    """An image with its mask.

    Attributes
    ----------
    name : str
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    truth : ndarray of uint8, shape (H, W)
        255 inside, 128 unknown, 0 outside.
    params : Parameters
        With its own start, if it has one.
    start : ndarray of bool, shape (H, W), or None
        The start region; None where neither a file nor the parameters name one.
    """

    name: str
    image: NDArray[np.uint8]
    truth: NDArray[np.uint8]
    params: Parameters
    start: NDArray[np.bool_] | None


@dataclass(frozen=True, slots=True, eq=False)
class Gathered:
    """What there is to learn from.

    Attributes
    ----------
    labelled : list of Labelled
    others : list of Source
        Images without a mask.
    starts : dict
        Start circles by name, of all images; empty without a file.
    """

    labelled: list[Labelled]
    others: list[Source]
    starts: dict[str, Start]


def gather(
    inputs: Sequence[str], truth: str, params: Parameters, starts: str = "", label: int | None = None
) -> Gathered:
    """Read the images that have a mask.

    Raises
    ------
    UsageError
        If an input or the folder is missing, an image or mask cannot be read, or no mask has a pixel inside.
    ParameterError
        If the starts file is wrong, or has no row for an image.
    """
    single_thread()
    sources = discover(inputs)
    truths = find_truths(sources, truth)
    used = {os.path.realpath(path) for path in truths.values()}
    sources = [one for one in sources if os.path.realpath(one.content) not in used and not one.problem]
    known = dict(load_starts(starts, [one.name for one in sources])) if starts else {}
    labelled = [_read(one, truths[one.name], params, known, label) for one in sources if one.name in truths]
    if labelled and not any((one.truth == INSIDE).any() for one in labelled):
        class_number = "" if label is None else f", and --truth-label {label} is in none of them"
        raise UsageError(f"--truth: no mask has a pixel inside{class_number}; 255 is inside, or the class you name")
    return Gathered(labelled, [one for one in sources if one.name not in truths], known)


def _read(source: Source, truth: str, params: Parameters, starts: dict[str, Start], label: int | None) -> Labelled:
    try:
        image = read_source(source)
        levels = read_truth(truth, (image.shape[0], image.shape[1]), label)
    except ImageReadError as error:
        raise UsageError(f"{printable(source.name)}: {error}") from error
    own = starts[source.name].placed(params) if source.name in starts else params
    return Labelled(source.name, image, levels, own, start_region(image.shape[:2], own))


def start_region(shape: tuple[int, ...], params: Parameters) -> NDArray[np.bool_] | None:
    """Pixels in the start that the parameters name; None where they name none."""
    init = params.init
    if init.center == "auto" and not init.circles and not init.boxes and not init.mask:
        return None
    return rasterize(start_contours((shape[0], shape[1]), params), (shape[0], shape[1]))
