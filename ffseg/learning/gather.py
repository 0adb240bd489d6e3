"""Images with their masks and starts, read once."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import mean

import numpy as np

from ffseg.arrays import Image, Mask
from ffseg.batch.plan.beside import find_domains, find_truths
from ffseg.batch.plan.discover import discover
from ffseg.batch.plan.sources import InputImage
from ffseg.batch.workers.pictures import read_source, read_truth
from ffseg.enlargement import smaller, smaller_mask, smaller_masks
from ffseg.errors import ImageReadError, SegmentationError, UsageError
from ffseg.image.checked import require_size
from ffseg.image.raster import rasterize
from ffseg.image.resized import copy_of, resized
from ffseg.io.files import printable
from ffseg.io.images import prepare_worker
from ffseg.io.masks import NO_MASKS, Masks, named_masks
from ffseg.io.starts import Start, finds_starts, load_starts
from ffseg.learning.examples import MIN_KNOWN, unknown_side
from ffseg.metrics import IGNORED, INSIDE, OUTSIDE
from ffseg.parameters import Parameters
from ffseg.starts.initial import start_contours

MAX_SIDE = 2000
"""Pixels of the longer side of what is learned from, at most: a photograph from a camera is seen at a fifth of that
(`WORKING_SIZE`), and takes nine times the room and the time of its copy to be measured on."""

MAX_NAMED = 4
"""Images that a message names."""


@dataclass(frozen=True, slots=True, eq=False)
class LabelledImage:
    """An image with its mask, or a copy of both.

    Attributes
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    truth : ndarray of uint8, shape (H, W)
        255 inside, 128 unknown, 0 outside.
    params : Parameters
        With its own start, if it has one.
    start : ndarray of bool, shape (H, W), or None
        The start region; None where neither a file nor the parameters name one.
    masks : Masks
        Where the contour may go, start and may not be, as far as the parameters say.
    fixed : frozenset of str
        Keys of the parameters that the image's row of the starts file sets.
    factor : int
        Pixels of the image a side that are one of the copy.
    """

    name: str
    image: Image
    truth: Image
    params: Parameters
    start: Mask | None
    masks: Masks = NO_MASKS
    fixed: frozenset[str] = frozenset()
    factor: int = 1


SIDES = {"inside": INSIDE, "outside": OUTSIDE}
"""Levels of masks that say something."""


@dataclass(frozen=True, slots=True, eq=False)
class TrainingSet:
    """Images with masks to learn from.

    Attributes
    ----------
    others : list of Source
        Images without a mask.
    starts : dict
        Start circles by name, of all images; empty without a file.
    masks : Masks
        Those that hold for all images.
    passed_over : tuple of str
        Images that cannot be learned from, each with what is wrong with it or its mask.
    """

    labelled: list[LabelledImage]
    others: list[InputImage]
    starts: dict[str, Start]
    masks: Masks = NO_MASKS
    passed_over: tuple[str, ...] = ()


def gather(
    inputs: Sequence[str],
    truth: str,
    params: Parameters,
    starts: str = "",
    label: int | None = None,
    *,
    longest: int | None = None,
) -> TrainingSet:
    """Read the images that have a mask; of those with a longer side of more than `longest` pixels, if given, a copy is kept.

    Raises
    ------
    UsageError
        If an input or the folder is missing, or nothing can be learned from any image: each, or its mask, cannot be read, has
        another size than the other, or shows one side only.
    ParameterError
        If the starts file is wrong, or has no row for an image.
    """
    prepare_worker()
    sources = discover(inputs)
    truths = find_truths(sources, truth)
    used = {os.path.realpath(path) for path in truths.values()}
    sources = [one for one in sources if os.path.realpath(one.content) not in used and not one.problem]
    known = dict(load_starts(starts, [one.name for one in sources], partial=finds_starts(params))) if starts else {}
    masks, chosen = named_masks(params), [one for one in sources if one.name in truths]
    _require_own_masks(chosen)
    domains = find_domains(chosen, params.domain.masks) if params.domain.masks else {}
    labelled, refused = list[LabelledImage](), list[UsageError]()
    for source in chosen:
        own = masks.within(domains.get(source.name, ""))
        try:
            one = _read(source, truths[source.name], params, own, label, known.get(source.name))
            labelled.append(one if longest is None else reduced(one, longest))
        except UsageError as error:
            refused.append(error)
    if refused and not labelled:
        raise refused[0]
    others = [one for one in sources if one.name not in truths]
    return TrainingSet(labelled, others, known, masks, tuple(map(str, refused)))


def _require_own_masks(sources: Sequence[InputImage]) -> None:
    """Refuse images of the same name, as from two folders: one mask would be used for both."""
    by_name: dict[str, InputImage] = {}
    for one in sources:
        other = by_name.setdefault(one.name, one)
        if other is not one:
            shown = f"{printable(other.display_path)} and {printable(one.display_path)}"
            raise UsageError(f"{shown} are both called {printable(one.name)}; give the folder above them as the input")


def _read(
    source: InputImage, truth: str, params: Parameters, masks: Masks, label: int | None, start: Start | None
) -> LabelledImage:
    try:
        image = read_source(source, levels=params.input.range)
        params = params if start is None else start.placed(params, image.shape)
        levels = read_truth(truth, (image.shape[0], image.shape[1]), label)
        for key, mask in (("domain.mask", masks.domain), ("init.background_mask", masks.background)):
            if mask is not None:
                require_size(key, mask, image.shape, "it must have the image's size")
        begun = start_region(image.shape[:2], params, masks.start)
        lacking = [side for side, level in SIDES.items() if not (levels == level).any()]
        if lacking:
            raise SegmentationError(unknown_side(lacking[0], label))
    except (ImageReadError, SegmentationError) as error:
        raise UsageError(f"{printable(source.name)}: {error}") from error
    return LabelledImage(
        source.name, image, levels, params, begun, masks, frozenset() if start is None else start.fixed
    )


def reduced(one: LabelledImage, longest: int) -> LabelledImage:
    """A copy with a longer side of at most so many pixels, or the image itself.

    A pixel of the copy is known if any of its pixels is, and lies on the side that most of these lie on.
    """
    image, factor = copy_of(one.image, longest)
    if factor == 1:
        return one
    shape = (image.shape[0], image.shape[1])
    inside, outside = (resized((one.truth == level).astype(np.float32), shape) for level in (INSIDE, OUTSIDE))
    truth = np.where(inside + outside <= 0, IGNORED, np.where(inside >= outside, INSIDE, OUTSIDE)).astype(np.uint8)
    params, masks = smaller(one.params, factor), smaller_masks(one.masks, shape)
    start = None if one.start is None else smaller_mask(one.start.view(np.uint8) * np.uint8(255), shape) > 0
    return replace(one, image=image, truth=truth, params=params, start=start, masks=masks, factor=factor)


def start_region(shape: tuple[int, ...], params: Parameters, mask: Image | None = None) -> Mask | None:
    """Pixels of the start named by the parameters or a mask; None if there is none."""
    init = params.init
    if init.center == "auto" and not init.circles and not init.boxes and mask is None:
        return None
    return rasterize(start_contours((shape[0], shape[1]), params, mask), (shape[0], shape[1]))


def starts_off(labelled: Sequence[LabelledImage]) -> list[str]:
    """Names of the images whose start lies wholly outside their mask; a model finds starts of its own.

    Raises
    ------
    UsageError
        If that is all of them: nothing grows into a region from without.
    """
    names = []
    for one in labelled:
        if one.start is None and one.params.edges.model is not None:
            continue
        shape = (one.image.shape[0], one.image.shape[1])
        start = rasterize(start_contours(shape, one.params), shape) if one.start is None else one.start
        if not (start & (one.truth != OUTSIDE)).any():
            names.append(printable(one.name))
    if names and len(names) == len(labelled):
        raise UsageError(
            f"the start lies outside the mask of {'the image' if len(names) == 1 else 'all images'} "
            f"({some_names(names)}); say where the region is with --starts FILE or --set 'init.center=[x, y]'"
        )
    return names


def known_share(labelled: Sequence[LabelledImage]) -> float:
    """Fraction of the pixels that the masks label, mean over the images."""
    return float(mean(np.count_nonzero(one.truth != IGNORED) / one.truth.size for one in labelled))


def few_known(share: float) -> list[str]:
    """Message for figures that count few pixels only, as of scribbles."""
    if share >= MIN_KNOWN:
        return []
    return [f"the masks know {share:.1%} of the pixels; the figures of IoU count no others"]


def some_names(names: Sequence[str]) -> str:
    """Some of the names, and the number of the others."""
    more = f" and {len(names) - MAX_NAMED} more" if len(names) > MAX_NAMED else ""
    return ", ".join(names[:MAX_NAMED]) + more
