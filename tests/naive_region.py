"""Slow, obvious twins of the region evidence. Imports nothing from ffseg."""

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]


def nine(image: NDArray[np.uint8], x: int, y: int) -> NDArray[np.int64]:
    """Sum of the colours of a pixel and its eight neighbours; beyond the border the pixel beside stands in."""
    height, width = image.shape[:2]
    rows = np.clip([y - 1, y, y + 1], 0, height - 1)
    columns = np.clip([x - 1, x, x + 1], 0, width - 1)
    total: NDArray[np.int64] = image[np.ix_(rows, columns)].astype(np.int64).sum(axis=(0, 1))
    return total


def pressure(
    image: NDArray[np.uint8], swept: Mask, place: tuple[int, int], weight: float, floor: float, every: int
) -> float:
    """Share of the balloon's pressure at a pixel (x, y) by two Gaussians of the colours of every so manieth pixel."""
    height, width, _ = image.shape
    grid = [(x, y) for y in range(0, height, every) for x in range(0, width, every)]
    colours = np.array([(nine(image, x, y) + 4) // 9 for x, y in grid], np.float64)
    inside = np.array([swept[y, x] for x, y in grid])
    here, odds = nine(image, *place) / 9, 0.0
    for part, sign in ((colours[inside], 1), (colours[~inside], -1)):
        covariance = np.cov(part.T, bias=True).reshape(part.shape[1], -1) + floor * np.eye(part.shape[1])
        step = here - part.mean(axis=0)
        odds -= sign * 0.5 * float(np.log(np.linalg.det(covariance)) + step @ np.linalg.inv(covariance) @ step)
    return float(np.clip(1 + weight * odds, 0, 1))
