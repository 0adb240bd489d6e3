"""Models of many things: ``python -m tests.campaigns.all_things [--images 8] [--masks 1,3]``.

Draws pictures of stained nuclei, of leaves among stones, and of ellipses of any look among others, learns from the first masks,
which show all things of the kind, and prints the mean IoU on the others: of all parts that the model tells, of the start's alone,
and after one, three and six clicks, each in the middle of the largest error. Without a model, of all images: after as many
clicks, each on a thing of its own or one of all that look alike (``region.islands: all``), and from a place in each thing, as
detectors give them.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import mean
from tempfile import TemporaryDirectory
from typing import Annotated

import cv2
import numpy as np
import typer
from numpy.typing import NDArray

import ffseg
from ffseg.evidence.forest import to_bytes
from ffseg.image.parts import connected_parts
from ffseg.learning.drawn.clicks import Clicks
from ffseg.learning.examples import samples_by_default, size_of_things
from ffseg.learning.training import SampleSet, learn
from ffseg.metrics import INSIDE, iou
from ffseg.parameters import Parameters, click_radius
from ffseg.starts.pockets import MIN_PIXELS, discs
from tests.campaigns import harness

Drawn = tuple[NDArray[np.uint8], NDArray[np.uint8]]
CLICKS = (1, 3, 6)


def _ellipse(rng: np.random.Generator, shape: tuple[int, int], longer: float, shorter: float) -> NDArray[np.bool_]:
    found = np.zeros(shape, np.uint8)
    middle = (rng.uniform(0, shape[1]), rng.uniform(0, shape[0]))
    cv2.ellipse(found, (middle, (2 * longer, 2 * shorter), rng.uniform(0, 180)), 1, -1)
    return found > 0


def _texture(rng: np.random.Generator, shape: tuple[int, int], sigma: float) -> NDArray[np.float32]:
    """Smooth noise of a standard deviation of about a quarter."""
    return np.asarray(cv2.GaussianBlur(rng.normal(0, sigma, shape).astype(np.float32), (0, 0), sigma))


def nuclei(seed: int) -> Drawn:
    """25 to 60 nuclei, bright on a ground lit unevenly, with the noise of few photons."""
    rng, shape = np.random.default_rng(seed), (520, 696)
    light, truth = np.zeros(shape, np.float32), np.zeros(shape, np.uint8)
    ground = cv2.resize(rng.random((3, 4)).astype(np.float32), shape[::-1], interpolation=cv2.INTER_CUBIC)
    for _ in range(int(rng.integers(25, 60))):
        longer = rng.uniform(9, 20)
        one = _ellipse(rng, shape, longer, longer * rng.uniform(0.6, 1))
        level = rng.uniform(30, 120) * (1 + 0.6 * _texture(rng, shape, 2.5))
        light, truth = np.where(one, np.maximum(light, level), light), np.where(one, np.uint8(255), truth)
    seen = np.clip(cv2.GaussianBlur(light, (0, 0), 1.5) + 20 + 12 * ground, 0, None)
    noisy = rng.poisson(seen) + rng.normal(0, 3, shape)
    return np.clip(noisy, 0, 255).astype(np.uint8), truth


def leaves(seed: int) -> Drawn:
    """2 to 13 green leaves of many sizes, and grey stones, on soil."""
    rng, shape = np.random.default_rng(1000 + seed), (480, 640)
    image = (
        np.array([60, 90, 110]) + 50 * _texture(rng, shape, 6)[..., None] + 20 * _texture(rng, shape, 1.5)[..., None]
    )
    truth = np.zeros(shape, np.uint8)
    for kind, count in (("stone", int(rng.integers(4, 9))), ("leaf", int(rng.integers(2, 14)))):
        for _ in range(count):
            longer, leaf = rng.uniform(25, 110), kind == "leaf"
            one = _ellipse(rng, shape, longer, longer * rng.uniform(0.3, 0.6 if leaf else 0.9))
            colour = np.array([40, 140, 60] if leaf else [120, 120, 120]) * rng.uniform(0.6, 1.4)
            image[one] = (colour + 25 * _texture(rng, shape, 2.5)[..., None])[one]
            truth[one] = 255 if leaf else 0
    noisy = cv2.GaussianBlur(image, (0, 0), 0.8) * rng.uniform(0.7, 1.2) + rng.normal(0, 4, image.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8), truth


def _unlike(rng: np.random.Generator, shape: tuple[int, ...], *others: NDArray[np.float64]) -> NDArray[np.float64]:
    """A colour, or grey level, that differs from others by more than 35 in a channel."""
    while True:
        colour = rng.uniform(30, 225, shape)
        if all(np.abs(colour - other).max() > 35 for other in others):
            return colour


def ellipses(seed: int) -> Drawn:
    """Ellipses of one look, in most pictures among those of another, on textured ground in uneven light."""
    rng = np.random.default_rng(2000 + seed)
    shape, channels = (int(rng.integers(360, 700)), int(rng.integers(480, 900))), 1 if rng.random() < 0.4 else 3

    def textured(colour: NDArray[np.float64], amplitude: float, sigma: float) -> NDArray[np.float64]:
        return np.asarray(colour + 4 * amplitude * _texture(rng, shape, sigma)[..., None])

    ground = _unlike(rng, (channels,))
    thing = _unlike(rng, (channels,), ground)
    other = _unlike(rng, (channels,), ground, thing)
    image = textured(ground, rng.uniform(0, 25), rng.uniform(1.5, 8))
    size, shorter = rng.uniform(7, 45), rng.uniform(0.3, 1)
    count = int(np.clip(rng.uniform(0.08, 0.3) * shape[0] * shape[1] / (np.pi * size**2), 5, 120))
    looks = [(colour, rng.uniform(0, 25), rng.uniform(1.5, 4)) for colour in (other, thing)]
    kinds = [0] * (count // 2 * (rng.random() < 0.6)) + [1] * count
    truth, taken = np.zeros(shape, np.uint8), np.zeros(shape, np.bool_)
    for kind in kinds:
        longer = size * rng.uniform(0.6, 1.4)
        one = _ellipse(rng, shape, longer, longer * rng.uniform(shorter, 1))
        if np.count_nonzero(one & taken) <= 0.15 * np.count_nonzero(one):
            colour, amplitude, sigma = looks[kind]
            image[one] = textured(colour * rng.uniform(0.85, 1.15), amplitude, sigma)[one]
            truth[one] = 255 * kind
            taken |= one
    light = cv2.resize(rng.uniform(0.75, 1.25, (3, 4)), shape[::-1], interpolation=cv2.INTER_CUBIC)
    seen = cv2.GaussianBlur(image * light[..., None], (0, 0), rng.uniform(0.5, 1.6)).reshape(image.shape)
    noisy = seen + rng.normal(0, rng.uniform(1, 9), image.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8).squeeze(), truth


LEARNED = "nuclei", "leaves"
"""Kinds of which all pictures show the same things."""

KINDS: dict[str, Callable[[int], Drawn]] = {"nuclei": nuclei, "leaves": leaves, "ellipses": ellipses}


def _overlaps(drawn: Drawn, params: Parameters) -> list[float]:
    """The IoU of all parts, of the start's, and after clicks."""
    image, truth = drawn
    alone = replace(params, region=replace(params.region, islands=False))
    mask = ffseg.segment(image, params).mask
    return [iou(mask, truth), iou(ffseg.segment(image, alone).mask, truth), *after_clicks(drawn, params, mask)]


def after_clicks(drawn: Drawn, params: Parameters, mask: NDArray[np.bool_]) -> list[float]:
    """The IoU after clicks, of which each lies in the middle of the largest error; the first of those of a mask."""
    (image, truth), clicks, found = drawn, Clicks(), list[float]()
    for number in range(1, max(CLICKS) + 1):
        clicks = clicks.next(mask, truth, click_radius(truth.shape))
        init = replace(params.init, circles=clicks.inside, background=clicks.outside)
        mask = ffseg.segment(image, replace(params, init=init)).mask
        found += [iou(mask, truth)] if number in CLICKS else []
    return found


def _from_places(drawn: Drawn) -> float:
    """The IoU from the deepest place of each thing, none with a radius."""
    image, truth = drawn
    components = connected_parts(truth == INSIDE)
    large = np.flatnonzero(components.areas >= MIN_PIXELS)
    places = [[x, y] for x, y, _ in discs(truth == INSIDE, components, large, np.inf)]
    return iou(ffseg.segment(image, {"init.circles": places}).mask, truth)


def _means(rows: list[list[float]]) -> str:
    return " | ".join(f"{mean(column):.3f}" for column in zip(*rows, strict=True)) + " |"


def main(
    images: Annotated[int, typer.Option(min=2)] = 8, masks: Annotated[str, typer.Option(metavar="LIST")] = "1,3"
) -> None:
    """Print the table."""
    print("| kind | masks | all parts | the start's | after 1 click | 3 | 6 |", "| --- " * 7 + "|", sep="\n")
    with TemporaryDirectory() as folder:
        for kind, draw in KINDS.items():
            drawn = [draw(seed) for seed in range(images)]
            for name, islands in (("none", True), ("none, all alike", "all")):
                params = ffseg.load_params(None, {"region.islands": islands})
                rows = [after_clicks(one, params, np.zeros(one[1].shape, np.bool_)) for one in drawn]
                print(f"| {kind} | {name} | | |", _means(rows))
            print(f"| {kind} | none, a place in each | {mean(map(_from_places, drawn)):.3f} | | | | |")
            for count in map(int, masks.split(",") if kind in LEARNED else ()):
                path = Path(folder) / f"{kind}{count}.ffmodel"
                size = size_of_things([truth for _, truth in drawn[:count]])
                known = SampleSet([samples_by_default(*one, size) for one in drawn[:count]])
                path.write_bytes(to_bytes(learn(known)))
                params = ffseg.load_params(None, {"edges.model": str(path)})
                print(f"| {kind} | {count} |", _means([_overlaps(one, params) for one in drawn[count:]]))


if __name__ == "__main__":
    harness.as_command(main)
