"""Slow, obvious twins of the pixel features and of the forest. Imports nothing from ffseg."""

import heapq
import math

import numpy as np

HIGHEST = 4095


def reduced_lab(image: np.ndarray, factor: int) -> np.ndarray:
    """L, a, b of the means of blocks, by the formulas of CIE 1976."""
    image = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    height, width = (-(-side // factor) for side in image.shape[:2])
    out = np.empty((3, height, width))
    xyz = np.array([[0.433953, 0.376219, 0.189828], [0.212671, 0.71516, 0.072169], [0.0177576, 0.1094769, 0.8727655]])
    for y in range(height):
        for x in range(width):
            block = image[y * factor : (y + 1) * factor, x * factor : (x + 1) * factor, 2::-1]
            rgb = block.reshape(-1, 3).mean(0) / 255
            light = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
            white = xyz @ light
            f = [np.cbrt(v) if v > 216 / 24389 else (24389 / 27 * v + 16) / 116 for v in white]
            out[:, y, x] = 116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])
    return out


def blur(plane: np.ndarray, sigma: float) -> np.ndarray:
    """The sum over a square window, border pixels repeated."""
    radius = max(1, math.ceil(3 * sigma))
    weights = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    weights /= weights.sum()
    wide = np.pad(plane.astype(np.float64), radius, mode="edge")
    out = np.empty(plane.shape)
    for y, x in np.ndindex(plane.shape):
        out[y, x] = weights @ wide[y : y + 2 * radius + 1, x : x + 2 * radius + 1] @ weights
    return out


def slopes(plane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    wide = np.pad(plane, 1, mode="edge")
    gx, gy = np.empty(plane.shape), np.empty(plane.shape)
    kernel = np.array([[1, 0, -1], [2, 0, -2], [1, 0, -1]]) / -8
    for y, x in np.ndindex(plane.shape):
        window = wide[y : y + 3, x : x + 3]
        gx[y, x], gy[y, x] = (window * kernel).sum(), (window * kernel.T).sum()
    return gx, gy


def eigenvalues(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> list[np.ndarray]:
    """Of symmetric matrices (a, b; b, c), the larger first."""
    values = np.linalg.eigvalsh(np.stack([np.stack([a, b], -1), np.stack([b, c], -1)], -2))
    return [values[..., 1], values[..., 0]]


def texture(lab: np.ndarray, sigma: float) -> np.ndarray:
    smooth = [blur(plane, sigma) for plane in lab]
    (gx, gy), *colours = [slopes(plane) for plane in smooth]
    light = gx**2 + gy**2
    colour = sum(x**2 + y**2 for x, y in colours)
    tensor = eigenvalues(*(blur(product, 2 * sigma) for product in (gx * gx, gx * gy, gy * gy)))
    return np.stack([*smooth, np.sqrt(light), np.sqrt(colour), np.sqrt(light + colour), *tensor])


def relative(lab: np.ndarray, inside: np.ndarray, floor: float) -> np.ndarray:
    """L, a, b less their means inside, and their length in deviations."""
    within = lab[:, inside > 0]
    apart = lab - within.mean(1)[:, None, None]
    scaled = apart / (within.std(1) + floor)[:, None, None]
    return np.stack([*apart, np.sqrt((scaled**2).sum(0))])


def likelihood(lab: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Logarithm of the ratio of two histograms, each smoothed by 1 2 1 twice along each axis."""
    shape = (24, 20, 20)
    lows, spans = (0, -50, -50), (100, 100, 100)
    bins = tuple(
        np.clip(np.trunc((plane - low) / span * count), 0, count - 1).astype(int)
        for plane, low, span, count in zip(lab, lows, spans, shape, strict=True)
    )
    shares = []
    for chosen in (inside > 0, np.ones(inside.shape, bool)):
        counts = np.zeros(shape)
        np.add.at(counts, tuple(b[chosen] for b in bins), 1)
        for axis in (0, 0, 1, 1, 2, 2):
            w = np.moveaxis(np.pad(counts, [(1, 1) if a == axis else (0, 0) for a in range(3)], mode="edge"), axis, 0)
            counts = np.moveaxis((w[:-2] + 2 * w[1:-1] + w[2:]) / 4, 0, axis)
        shares.append(counts / max(counts.sum(), 1))
    return np.log((shares[0] + 1e-6) / (shares[1] + 1e-6))[bins]


def steps_of(heights: np.ndarray, step: float) -> np.ndarray:
    scaled = heights.astype(np.float32) * np.float32(1 / step) + np.float32(0.5)
    return np.clip(np.floor(np.nan_to_num(scaled, nan=0.0)), 0, HIGHEST).astype(int)


def ways(costs: np.ndarray, inside: np.ndarray, *, diagonals: bool) -> np.ndarray:
    """Dijkstra with a heap: the barrier (four neighbours), or ten times the length (eight)."""
    height, width = costs.shape
    best = np.where(inside > 0, 0, np.iinfo(np.int64).max)
    heap = [(0, y, x) for y, x in np.argwhere(inside > 0)]
    while heap:
        cost, y, x = heapq.heappop(heap)
        if cost > best[y, x]:
            continue
        for dy, dx in [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1)][: 8 if diagonals else 4]:
            v, u = y + dy, x + dx
            if not (0 <= v < height and 0 <= u < width):
                continue
            length = cost + (costs[y, x] + costs[v, u]) * (7 if dx and dy else 5)
            reached = length if diagonals else max(cost, costs[v, u])
            if reached < best[v, u]:
                best[v, u] = reached
                heapq.heappush(heap, (reached, v, u))
    return best


def barrier(heights: np.ndarray, inside: np.ndarray, step: float) -> np.ndarray:
    levels = steps_of(heights, step)
    low = ways(levels, inside, diagonals=False)
    within = sorted(levels[inside > 0])
    unit = within[len(within) // 2]
    kinds = np.trunc(10 * np.log(2.0 * low + 1)).astype(int)
    reached, same, alike = (np.empty(low.shape) for _ in range(3))
    for at in np.ndindex(low.shape):
        reached[at], same[at] = (low <= low[at]).mean(), (low == low[at]).mean()
        alike[at] = (kinds == kinds[at]).mean()
    return np.stack([low * step, np.log((low + 0.5) / (unit + 0.5)), reached, same, alike])


def geodesic(heights: np.ndarray, inside: np.ndarray, step: float, least: int) -> np.ndarray:
    return ways(steps_of(heights, step) + least, inside, diagonals=True) * step / 10


def forest(arrays: dict[str, np.ndarray], pixel: np.ndarray) -> float:
    """The sum of the leaves one pixel reaches, from the root of each tree down."""
    total = np.float32(0)
    for root in arrays["root"]:
        node = int(root)
        while node >= 0:
            below = pixel[arrays["feature"][node]] <= arrays["threshold"][node]
            node = int(arrays["left"][node] if below else arrays["right"][node])
        total += np.float32(arrays["value"][-1 - node])
    return float(total)


def neighbours(lab: np.ndarray, kept: float, contrast: float) -> np.ndarray:
    """The matrix of Grady's random walker with priors: its solution of ``kept`` times the values is what diffusion seeks."""
    _, height, width = lab.shape
    system = kept * np.eye(height * width)
    for y, x in np.ndindex(height, width):
        for other in ((y, x + 1), (y + 1, x)):
            if other[0] < height and other[1] < width:
                apart = lab[:, y, x].astype(np.float64) - lab[:, other[0], other[1]]
                weight = math.exp(-float(apart @ apart) / (2 * contrast**2))
                one, two = y * width + x, other[0] * width + other[1]
                system[[one, two], [one, two]] += weight
                system[[one, two], [two, one]] -= weight
    return system
