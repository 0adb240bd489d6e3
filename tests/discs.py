"""Discs to be found, and how well they were."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ffseg.image.edges import EdgeMap, edge_map
from ffseg.parameters import Parameters
from tests.masks import write_image

Mask = NDArray[np.bool_]


def disc_of(shape: tuple[int, int]) -> Callable[[float, float, float], Mask]:
    """What draws a disc by x, y and radius, shape (H, W)."""
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return lambda x, y, radius: (columns - x) ** 2 + (rows - y) ** 2 <= radius**2


def bright_disc(shape: tuple[int, int], at: tuple[float, float], radius: float, level: int = 180) -> NDArray[np.uint8]:
    """A disc of this level on ground of 60, with an antialiased edge one pixel wide."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    inside = np.clip(radius - np.hypot(x - at[0], y - at[1]) + 0.5, 0, 1)
    return np.rint(60 + (level - 60) * inside).astype(np.uint8)


def edges_of(image: NDArray[np.uint8], domain: NDArray[np.uint8] | None = None) -> EdgeMap:
    return edge_map(image, Parameters().edges, domain)


def overlap(one: Mask, other: Mask) -> float:
    return float((one & other).sum() / (one | other).sum())


LEFT, RIGHT = (30, 40), (90, 40)
"""Centres of `two_discs`, of radius 20."""


def two_discs(folder: Path, *names: str) -> None:
    disc = disc_of((80, 120))
    image = np.where(disc(*LEFT, 19.99) | disc(*RIGHT, 19.99), 180, 60).astype(np.uint8)
    for name in names:
        write_image(folder / name, image)


def write_case(folder: Path, name: str = "disc.png") -> None:
    y, x = np.mgrid[:90, :120]
    inside = np.hypot(x - 60, y - 45) < 30
    write_image(folder / name, np.where(inside, 180, 60).astype(np.uint8))
    write_image(folder / "truth" / name, inside)
