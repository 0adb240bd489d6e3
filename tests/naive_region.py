"""Slow, obvious twins of the region evidence. Imports nothing from ffseg."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]


def near(mask: Mask, radius: float) -> Mask:
    """Pixels whose centre lies no farther than `radius` from that of a pixel of the mask."""
    height, width = mask.shape
    found = np.zeros_like(mask)
    for v in range(-height + 1, height):
        for u in range(-width + 1, width):
            if u * u + v * v <= radius * radius:
                rows, columns = slice(max(0, v), height + min(0, v)), slice(max(0, u), width + min(0, u))
                back = slice(max(0, -v), height + min(0, -v)), slice(max(0, -u), width + min(0, -u))
                found[rows, columns] |= mask[back]
    return found


def parts(mask: Mask, band: float) -> tuple[Mask, Mask, Mask]:
    """The region, its pixels near the rest, the pixels of the rest near it."""
    return mask, mask & near(~mask, band), ~mask & near(mask, band)


def moments(image: NDArray[np.uint8], mask: Mask) -> tuple[int, NDArray[np.float64], NDArray[np.float64]]:
    """Count, mean and covariance of the colours of a mask."""
    channels = 1 if image.ndim == 2 else image.shape[2]
    colours = image[mask].astype(np.float64).reshape(-1, channels)
    if not len(colours):
        return 0, np.zeros(channels), np.zeros((channels, channels))
    mean = colours.mean(axis=0)
    return len(colours), mean, (colours - mean).T @ (colours - mean) / len(colours)


def histogram(image: NDArray[np.uint8], mask: Mask, bins: int) -> NDArray[np.int64]:
    """Counts of the colours of a mask, `bins` equal intervals a channel."""
    planes = image[..., None] if image.ndim == 2 else image
    counts = np.zeros((bins,) * planes.shape[2], np.int64)
    for colour in planes[mask]:
        counts[tuple(int(value) * bins // 256 for value in colour)] += 1
    return counts


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
