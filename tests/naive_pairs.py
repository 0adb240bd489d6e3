"""Slow, obvious twins of interest points; imports nothing from ffseg."""

import numpy as np
from naive_edges import sobel


def grown(mask: np.ndarray, by: int) -> np.ndarray:
    """True within a square of `by` pixels round every true pixel."""
    rows, columns = np.nonzero(mask)
    wide = np.zeros_like(mask)
    for row, column in zip(rows, columns, strict=True):
        wide[max(row - by, 0) : row + by + 1, max(column - by, 0) : column + by + 1] = True
    return wide


def gradients(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sobel gradients of the image with its border repeated three times."""
    return sobel(np.pad(image, 3, mode="edge")[..., None].astype(np.int64))


def harris(gx: np.ndarray, gy: np.ndarray, x: int, y: int) -> float:
    """Response of one pixel: gradient products over 3x3 pixels."""
    near = np.s_[y + 2 : y + 5, x + 2 : x + 5]
    xx, xy, yy = (int((a[near] * b[near]).sum()) for a, b in ((gx, gx), (gx, gy), (gy, gy)))
    return xx * yy - xy * xy - 0.04 * (xx + yy) ** 2


def corners(image: np.ndarray, mask: np.ndarray, most: int) -> list[tuple[int, int]]:
    """Peaks (x, y) of the Harris response inside a mask of the image, strongest first, without sub-pixel positions.

    Responses count within the mask's bounding box only.
    """
    rows, columns = np.nonzero(mask)
    box = [(x, y) for y in range(rows.min(), rows.max() + 1) for x in range(columns.min(), columns.max() + 1)]
    gx, gy = gradients(image)
    response = {place: harris(gx, gy, *place) for place in box}
    strongest = max(response[x, y] for x, y in box if mask[y, x])
    peaks = []
    for x, y in box:
        around = [response.get((x + dx, y + dy), -np.inf) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
        if mask[y, x] and response[x, y] == max(around) and response[x, y] > 0.01 * max(strongest, 0.0):
            peaks.append((-response[x, y], y, x))
    return [(x, y) for _, y, x in sorted(peaks)[:most]]


def outline(image: np.ndarray, mask: np.ndarray) -> list[tuple[int, int]]:
    """Strongest gradient above four grey levels of every 4x4 cell of the mask's bounding box, cells row by row."""
    rows, columns = np.nonzero(mask)
    strength = sum(part[3:-3, 3:-3] ** 2 for part in gradients(image))
    found = []
    for top in range(rows.min(), rows.max() + 1, 4):
        for left in range(columns.min(), columns.max() + 1, 4):
            best = (4 * 8) ** 2
            place = None
            for y in range(top, min(top + 4, rows.max() + 1)):
                for x in range(left, min(left + 4, columns.max() + 1)):
                    if mask[y, x] and strength[y, x] > best:
                        best, place = strength[y, x], (x, y)
            if place is not None:
                found.append(place)
    return found
