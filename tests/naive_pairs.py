"""Slow, obvious twins of interest points; imports nothing from ffseg."""

import numpy as np


def sobel(image: np.ndarray, x: int, y: int) -> tuple[int, int]:
    """Sobel gradient of one pixel; outside the image its border is repeated."""

    def at(dx: int, dy: int) -> int:
        return int(image[min(max(y + dy, 0), image.shape[0] - 1), min(max(x + dx, 0), image.shape[1] - 1)])

    across = sum(w * (at(1, d) - at(-1, d)) for d, w in ((-1, 1), (0, 2), (1, 1)))
    down = sum(w * (at(d, 1) - at(d, -1)) for d, w in ((-1, 1), (0, 2), (1, 1)))
    return across, down


def grown(mask: np.ndarray, by: int) -> np.ndarray:
    """True within a square of `by` pixels round every true pixel."""
    rows, columns = np.nonzero(mask)
    wide = np.zeros_like(mask)
    for row, column in zip(rows, columns, strict=True):
        wide[max(row - by, 0) : row + by + 1, max(column - by, 0) : column + by + 1] = True
    return wide


def harris(image: np.ndarray, x: int, y: int) -> float:
    """Response of one pixel: gradient products over 3x3 pixels."""
    xx = xy = yy = 0
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            gx, gy = sobel_anywhere(image, x + dx, y + dy)
            xx, xy, yy = xx + gx * gx, xy + gx * gy, yy + gy * gy
    return xx * yy - xy * xy - 0.04 * (xx + yy) ** 2


def sobel_anywhere(image: np.ndarray, x: int, y: int) -> tuple[int, int]:
    """As `sobel`, also for pixels outside the image: of the image with its border repeated."""
    return sobel(np.pad(image, 3, mode="edge"), x + 3, y + 3)


def corners(image: np.ndarray, mask: np.ndarray, most: int) -> list[tuple[int, int]]:
    """Peaks (x, y) of the Harris response inside a mask of the image, strongest first, without sub-pixel positions.

    Responses count within the mask's bounding box only.
    """
    rows, columns = np.nonzero(mask)
    box = [(x, y) for y in range(rows.min(), rows.max() + 1) for x in range(columns.min(), columns.max() + 1)]
    response = {place: harris(image, *place) for place in box}
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
    found = []
    for top in range(rows.min(), rows.max() + 1, 4):
        for left in range(columns.min(), columns.max() + 1, 4):
            best = (4 * 8) ** 2
            place = None
            for y in range(top, min(top + 4, rows.max() + 1)):
                for x in range(left, min(left + 4, columns.max() + 1)):
                    gx, gy = sobel(image, x, y)
                    if mask[y, x] and gx * gx + gy * gy > best:
                        best, place = gx * gx + gy * gy, (x, y)
            if place is not None:
                found.append(place)
    return found
