"""Small things in large pictures: ``python -m tests.campaigns.large_pictures [--images 12] [--first 0]``.

Pictures of stained nuclei and of leaves among stones, put beside one another, once, four and sixteen times; one thing of each is
meant. Prints the mean IoU from its deepest place and from any in it, none with a radius; after one, three and six clicks in the
middle of the largest error; and of all things: those that look alike from the deepest place, and what a model of the first
picture's mask tells of the others. Where there are twelve things, also of twelve from the deepest place in
each, and from any.
"""

from math import nan
from pathlib import Path
from statistics import mean
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

import ffseg
from ffseg.arrays import Image
from ffseg.evidence.forest import to_bytes
from ffseg.image.parts import connected_parts
from ffseg.learning.examples import samples_by_default, size_of_things
from ffseg.learning.training import SampleSet, learn
from ffseg.metrics import INSIDE, iou
from ffseg.starts.pockets import MIN_PIXELS
from tests.campaigns import harness
from tests.campaigns.all_things import KINDS, LEARNED, Drawn, after_clicks
from tests.many_things import deepest

MOST_SIDE = 4
PLACES = 12


def mosaic(kind: str, seed: int, side: int) -> Drawn:
    """So many pictures a side, beside one another."""
    tiles = [[KINDS[kind](seed + side * row + column) for column in range(side)] for row in range(side)]
    image, truth = (np.vstack([np.hstack([tile[k] for tile in row]) for row in tiles]) for k in (0, 1))
    return image, truth


def _overlaps(drawn: Drawn, seed: int) -> list[float]:
    (image, every), rng = drawn, np.random.default_rng(seed)
    parts = connected_parts(every == INSIDE)
    things = np.flatnonzero(parts.areas >= MIN_PIXELS)
    one = parts.labels == rng.choice(things)
    truth = np.where(one, np.uint8(INSIDE), np.uint8(0))
    deep, anywhere = _places(one, rng)
    alike = ffseg.segment(image, {"init.circles": [deep], "region.islands": "all"})
    found: list[NDArray[np.bool_]] = [ffseg.segment(image, {"init.center": at}).mask for at in (deep, anywhere)]
    clicked = after_clicks((image, truth), ffseg.load_params(), np.zeros(one.shape, np.bool_))
    return [
        *(iou(mask, truth) for mask in found),
        *clicked,
        iou(alike.mask, every),
        *_of_several(image, parts.labels, things, rng),
    ]


def _of_several(
    image: Image, labels: NDArray[np.int32], things: NDArray[np.intp], rng: np.random.Generator
) -> list[float]:
    """IoU of several of the things from the deepest place in each, and from any; nan if there are fewer."""
    if things.size < PLACES:
        return [nan, nan]
    chosen = rng.choice(things, PLACES, replace=False)
    truth = np.where(np.isin(labels, chosen), np.uint8(INSIDE), np.uint8(0))
    pairs = [_places(labels == thing, rng) for thing in chosen]
    masks = (ffseg.segment(image, {"init.circles": list(places)}).mask for places in zip(*pairs, strict=True))
    return [iou(mask, truth) for mask in masks]


def _places(thing: NDArray[np.bool_], rng: np.random.Generator) -> tuple[list[int], list[int]]:
    """The deepest pixel of a thing, and any, x and y."""
    row, column = rng.choice(np.argwhere(thing))
    return deepest(thing), [int(column), int(row)]


def _by_model(drawn: list[Drawn]) -> float:
    """Mean IoU of all things in all pictures but the first, by a model of that one's mask."""
    image, truth = drawn[0]
    known = SampleSet([samples_by_default(image, truth, size_of_things([truth]))])
    with TemporaryDirectory() as folder:
        path = Path(folder) / "one.ffmodel"
        path.write_bytes(to_bytes(learn(known)))
        params = ffseg.load_params(None, {"edges.model": str(path)})
        return mean(iou(ffseg.segment(one, params).mask, every) for one, every in drawn[1:])


def main(
    images: Annotated[int, typer.Option(min=2)] = 12, first: Annotated[int, typer.Option(metavar="SEED")] = 0
) -> None:
    """Print the table."""
    print(
        "| kind | pixels | deepest place | any place | after 1 click | 3 | 6 | all alike "
        "| several, deepest | several, any | by a model |",
        "| --- " * 11 + "|",
        sep="\n",
    )
    for kind in LEARNED:
        for side in (1, 2, MOST_SIDE):
            drawn = [mosaic(kind, first + MOST_SIDE**2 * number, side) for number in range(images)]
            rows = [_overlaps(one, number) for number, one in enumerate(drawn)]
            columns = (f"{mean(column):.3f}" for column in zip(*rows, strict=True))
            height, width = drawn[0][1].shape
            print(f"| {kind} | {width}x{height} |", " | ".join(columns), f"| {_by_model(drawn):.3f} |")


if __name__ == "__main__":
    harness.as_command(main)
