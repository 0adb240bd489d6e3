"""Slow, obvious twins of the camera, pair and rendering parts; imports nothing from ffseg."""

import math
from collections import deque

import numpy as np


def unified_project(
    point: np.ndarray, xi: float, k: tuple[float, ...], skew: float, d: tuple[float, ...]
) -> tuple[float, float]:
    """Mei's model written out for one point."""
    norm = math.sqrt(sum(v * v for v in point))
    x, y, z = (v / norm for v in point)
    x, y = x / (z + xi), y / (z + xi)
    r2 = x * x + y * y
    radial = 1 + d[0] * r2 + d[1] * r2 * r2
    xd = x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x)
    yd = y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y
    fx, fy, cx, cy = k
    return fx * xd + skew * yd + cx, fy * yd + cy


def ocam_lift(
    column: float, row: float, coefficients: np.ndarray, center: tuple[float, float], affine: tuple[float, float, float]
) -> np.ndarray:
    """OCamCalib's cam2world for one pixel, in its own frame (x down the rows, z away from the scene)."""
    c, d, e = affine
    matrix = np.array([[c, d], [e, 1.0]])
    x, y = np.linalg.inv(matrix) @ [row - center[1], column - center[0]]
    r = math.hypot(x, y)
    z = sum(a * r**i for i, a in enumerate(coefficients))
    return np.array([x, y, z]) / math.sqrt(x * x + y * y + z * z)


def bilinear(image: np.ndarray, x: float, y: float) -> float:
    """One sample between four pixels."""
    x0, y0 = math.floor(x), math.floor(y)
    u, v = x - x0, y - y0
    part = image[y0 : y0 + 2, x0 : x0 + 2].astype(float)
    return part[0, 0] * (1 - u) * (1 - v) + part[0, 1] * u * (1 - v) + part[1, 0] * (1 - u) * v + part[1, 1] * u * v


def patch(image: np.ndarray, center: np.ndarray, warp: np.ndarray | list[float], radius: int) -> np.ndarray:
    warp = np.asarray(warp).reshape(2, 2)
    offsets = [(dx, dy) for dy in range(-radius, radius + 1) for dx in range(-radius, radius + 1)]
    return np.array([bilinear(image, *(np.asarray(center) + warp @ offset)) for offset in offsets])


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Zero-mean normalised cross-correlation."""
    a, b = a - a.mean(), b - b.mean()
    return float(a @ b / math.sqrt((a @ a) * (b @ b)))


def free_ground(labels: np.ndarray, center: tuple[float, float], robot_radius: float) -> np.ndarray:
    """Ground and marks (labels 0 to 99) joined by pixel sides to the robot's disc, by flooding."""
    height, width = labels.shape
    y, x = np.mgrid[:height, :width]
    reached = (x - center[0]) ** 2 + (y - center[1]) ** 2 <= robot_radius**2
    open_ground = (labels >= 0) & (labels < 100)
    queue = deque(zip(*np.nonzero(reached), strict=True))
    reached = reached.copy()
    while queue:
        row, column = queue.popleft()
        for r, c in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            if 0 <= r < height and 0 <= c < width and open_ground[r, c] and not reached[r, c]:
                reached[r, c] = True
                queue.append((r, c))
    return reached


def homogeneous(rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, position
    return matrix
