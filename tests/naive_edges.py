"""Slow, obvious twins of the native edge map; imports nothing from ffseg."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def sobel(image: NDArray[np.uint8]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sobel sums of the strongest channel with replicated border, each (H, W)."""
    planes = image[..., None] if image.ndim == 2 else image
    padded = np.pad(planes.astype(np.int64), ((1, 1), (1, 1), (0, 0)), mode="edge")
    rows, columns = planes.shape[:2]

    def at(dy: int, dx: int) -> NDArray[np.int64]:
        return padded[1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns]

    gx = at(-1, 1) + 2 * at(0, 1) + at(1, 1) - at(-1, -1) - 2 * at(0, -1) - at(1, -1)
    gy = at(1, -1) + 2 * at(1, 0) + at(1, 1) - at(-1, -1) - 2 * at(-1, 0) - at(-1, 1)
    strongest = np.argmax(gx**2 + gy**2, axis=2)[..., None]
    return np.take_along_axis(gx, strongest, 2)[..., 0], np.take_along_axis(gy, strongest, 2)[..., 0]


def gradient(image: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Gradient magnitude in 1/32 grey level per pixel, rounded."""
    gx, gy = sobel(image)
    return np.floor(np.sqrt((gx**2 + gy**2).astype(np.float32)) * np.float32(4) + np.float32(0.5)).astype(np.int64)


def canny(image: NDArray[np.uint8], low: int, high: int, shortest: int) -> NDArray[np.bool_]:
    """Ridge pixels above ``low`` connected to one above ``high``, in chains of at least ``shortest`` pixels."""
    gx, gy = sobel(image)
    size = gradient(image)
    rows, columns = size.shape

    def value(x: int, y: int) -> int:
        return int(size[y, x]) if 0 <= x < columns and 0 <= y < rows else 0

    def ridge(x: int, y: int) -> bool:
        ax, ay = abs(int(gx[y, x])), abs(int(gy[y, x]))
        if ay * 32768 < ax * 13573:
            dx, dy = 1, 0
        elif ax * 32768 < ay * 13573:
            dx, dy = 0, 1
        else:
            dx, dy = (1 if (gx[y, x] > 0) == (gy[y, x] > 0) else -1), 1
        return value(x, y) > value(x - dx, y - dy) and value(x, y) >= value(x + dx, y + dy)

    ridges = {(x, y) for y in range(rows) for x in range(columns) if value(x, y) >= max(low, 1) and ridge(x, y)}
    edges = np.zeros((rows, columns), np.bool_)
    seen: set[tuple[int, int]] = set()
    for seed in sorted(ridges):
        if seed in seen or value(*seed) < max(high, 1):
            continue
        chain, front = {seed}, [seed]
        while front:
            x, y = front.pop()
            near = {(x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)} & ridges - chain
            chain |= near
            front += near
        seen |= chain
        if len(chain) >= shortest:
            for x, y in chain:
                edges[y, x] = True
    return edges
