"""Slow, obvious twins of the native edge map; imports nothing from ffseg."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

UNIT = 32
"""Stored units per grey level."""


def weights(sigma: float) -> list[int]:
    """Gaussian weights in 1/65536 for twice the pixel itself and for the sums of two pixels 1, 2, ... away."""
    heights = [1.0]
    least = math.sqrt(2 * math.pi) * sigma / (255 * UNIT)
    while (height := math.exp(-0.5 * (len(heights) / sigma) * (len(heights) / sigma))) > least:  # ** overflows
        heights.append(height)
    total = 2 * sum(heights) - 1
    sides = [round(65536 * height / total) for height in heights[1:]]
    return [32768 - sum(sides), *sides]


def _pass(rows: NDArray[np.int64], parts: list[int]) -> NDArray[np.int64]:
    """Weigh over the first axis, replicated at both ends; every product is rounded down, half of that is given back."""
    radius, count = len(parts) - 1, len(rows)
    padded = np.concatenate([np.repeat(rows[:1], radius, 0), rows, np.repeat(rows[-1:], radius, 0)])
    total = np.full_like(rows, len(parts) // 2)
    for k, part in enumerate(parts):
        total += (padded[radius - k : radius - k + count] + padded[radius + k : radius + k + count]) * part // 65536
    return total


def smoothed(image: NDArray[np.uint8], sigma: float) -> NDArray[np.int64]:
    """Smoothed planes in 1/32 grey level, shape (H, W, C): first along rows, in 1/128, then over them."""
    planes = (image[..., None] if image.ndim == 2 else image).astype(np.int64) * 128
    across = _pass(planes.swapaxes(0, 1), weights(sigma)).swapaxes(0, 1)
    return (_pass(across, weights(sigma)) + 2) // 4


def sobel(planes: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Sobel sums of the strongest plane with replicated border, each (H, W)."""
    padded = np.pad(planes, ((1, 1), (1, 1), (0, 0)), mode="edge")
    rows, columns = planes.shape[:2]

    def at(dy: int, dx: int) -> NDArray[Any]:
        return padded[1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns]

    gx = at(-1, 1) + 2 * at(0, 1) + at(1, 1) - at(-1, -1) - 2 * at(0, -1) - at(1, -1)
    gy = at(1, -1) + 2 * at(1, 0) + at(1, 1) - at(-1, -1) - 2 * at(-1, 0) - at(-1, 1)
    strongest = np.argmax(gx**2 + gy**2, axis=2)[..., None]
    return np.take_along_axis(gx, strongest, 2)[..., 0], np.take_along_axis(gy, strongest, 2)[..., 0]


def gradient_and_ridges(image: NDArray[np.uint8], sigma: float) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Gradient magnitude in 1/32 grey level per pixel, and where it is a maximum along its direction."""
    gx, gy = sobel(smoothed(image, sigma))
    size = (np.sqrt((gx**2 + gy**2).astype(np.float32)).astype(np.int64) + 4) // 8
    rows, columns = size.shape

    def value(x: int, y: int) -> int:
        return int(size[y, x]) if 0 <= x < columns and 0 <= y < rows else 0

    def ridge(x: int, y: int) -> bool:
        ax, ay = abs(int(gx[y, x])), abs(int(gy[y, x]))
        if ay * 65536 <= ax * 27146:  # tan(22.5 degrees)
            dx, dy = 1, 0
        elif ax * 65536 <= ay * 27146:
            dx, dy = 0, 1
        else:
            dx, dy = (1 if (gx[y, x] > 0) == (gy[y, x] > 0) else -1), 1
        return value(x, y) > value(x - dx, y - dy) and value(x, y) >= value(x + dx, y + dy)

    return size, np.array([[ridge(x, y) for x in range(columns)] for y in range(rows)])


def exact_gradient(image: NDArray[np.uint8], sigma: float) -> NDArray[np.float64]:
    """The same gradient in floating point and with a kernel that is not cut, in grey levels per pixel."""
    radius = math.ceil(8 * sigma) + 1
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    planes = (image[..., None] if image.ndim == 2 else image).astype(np.float64)
    for axis in (0, 1):
        margin = [(radius, radius) if i == axis else (0, 0) for i in range(3)]
        padded = np.pad(planes, margin, mode="edge")
        planes = np.apply_along_axis(np.convolve, axis, padded, kernel, mode="valid")
    return np.hypot(*sobel(planes)) / 8


def linked(size: NDArray[np.int64], ridges: NDArray[np.bool_], low: int, high: int, shortest: int) -> NDArray[np.bool_]:
    """Ridge pixels above ``low`` connected to one above ``high``, in chains of at least ``shortest`` pixels."""
    weak = {(int(x), int(y)) for y, x in zip(*np.nonzero(ridges & (size >= max(low, 1))), strict=True)}
    edges = np.zeros(size.shape, np.bool_)
    seen: set[tuple[int, int]] = set()
    for seed in sorted(weak):
        if seed in seen or size[seed[1], seed[0]] < max(high, 1):
            continue
        chain, front = {seed}, [seed]
        while front:
            x, y = front.pop()
            near = {(x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)} & weak - chain
            chain |= near
            front += near
        seen |= chain
        if len(chain) >= shortest:
            for x, y in chain:
                edges[y, x] = True
    return edges
