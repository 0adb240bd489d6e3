"""Pictures of many things alike, among others."""

import numpy as np

from ffseg.image.free import distances
from tests.discs import disc_of

SHAPE, RADIUS = (160, 240), 10
disc = disc_of(SHAPE)


def cells(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Greenish cells among bluish ones in noise, and a mask of the greenish: 255 inside, 0 outside."""
    rng = np.random.default_rng(seed)
    image, truth = rng.normal(60, 8, (*SHAPE, 3)), np.zeros(SHAPE, np.uint8)
    places = [(x, y) for x in range(25, 240, 38) for y in range(25, 160, 36)]
    for number, place in enumerate(rng.permutation(places)):
        cell = disc(*(place + rng.uniform(-4, 4, 2)), RADIUS)
        image[cell] += (0, 70, 20) if number % 3 else (70, 10, 0)
        truth[cell] = 255 if number % 3 else 0
    return np.clip(image, 0, 255).astype(np.uint8), truth


def large(seed: int, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """25 such pictures beside one another, 1200 px wide, in further noise of this standard deviation, and their mask."""
    tiles = [[cells(100 * seed + 10 * row + column) for column in range(5)] for row in range(5)]
    image, truth = (np.vstack([np.hstack([tile[k] for tile in row]) for row in tiles]) for k in (0, 1))
    noisy = image + np.random.default_rng(seed).normal(0, noise, image.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8), truth


def deepest(truth: np.ndarray) -> list[int]:
    """The pixel deepest in a mask, x and y."""
    row, column = np.unravel_index(int(distances(truth > 0).argmax()), truth.shape)
    return [int(column), int(row)]
