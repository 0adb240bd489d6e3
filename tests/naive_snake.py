"""Slow, obvious twin of the parametric snake, with a dense matrix. Imports nothing from ffseg."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

HOMOGENEOUS, EDGE, STRONG_EDGE, SWEPT = range(4)


def internal_matrix(count: int, tension: float, rigidity: float) -> NDArray[np.float64]:
    """I + A of a closed chain, from difference operators."""
    second = np.roll(np.eye(count), 1, axis=0) - 2 * np.eye(count) + np.roll(np.eye(count), -1, axis=0)
    matrix: NDArray[np.float64] = np.eye(count) - tension * second + rigidity * second @ second
    return matrix


def zones(
    edges: NDArray[np.uint8], altitudes: list[tuple[float, float, float, float]], epsilon: float
) -> NDArray[np.int64]:
    """Pixels within two of an edge pixel in both axes; low points clear them in their discs, high ones keep them."""
    height, width = edges.shape
    near = np.zeros(edges.shape, bool)
    for y, x in np.argwhere(edges > 0):
        near[max(0, y - 2) : y + 3, max(0, x - 2) : x + 3] = True
    yy, xx = np.mgrid[:height, :width]
    close = {True: np.zeros(edges.shape, bool), False: np.zeros(edges.shape, bool)}
    for x, y, altitude, radius in altitudes:
        close[altitude < epsilon] |= (xx - x) ** 2 + (yy - y) ** 2 <= radius**2
    zone = np.where(near, EDGE, HOMOGENEOUS)
    zone[near & close[True]] = HOMOGENEOUS
    zone[near & close[False]] = STRONG_EDGE
    return zone


@dataclass
class Snake:
    """One snake on a gradient map; `step` is one iteration."""

    points: Points
    gradient: NDArray[np.float64]
    zone: NDArray[np.int64]
    domain: NDArray[np.bool_]
    options: Any

    def step(self) -> None:
        """Force, dense solve, domain, sweep, refinement."""
        old = np.array([self.clamp(p) for p in self.points])
        tangents = np.roll(old, -1, axis=0) - np.roll(old, 1, axis=0)
        normals = np.stack([tangents[:, 1], -tangents[:, 0]], axis=1) / np.hypot(*tangents.T)[:, None]
        pushed = old + np.array([self.force(p, n) for p, n in zip(old, normals, strict=True)])
        solved = np.linalg.solve(internal_matrix(len(old), self.options.tension, self.options.rigidity), pushed)
        new = np.array([self.inside(a, self.clamp(self.near(a, b))) for a, b in zip(old, solved, strict=True)])
        for i in range(len(old)):
            j = (i + 1) % len(old)
            self.sweep(old[i], old[j], new[i], new[j])
        self.points = self.refined(new)

    def clamp(self, p: Points) -> Points:
        limit = np.array(self.gradient.shape[::-1]) - 0.5 - 1e-6
        return np.minimum(np.maximum(p, -0.5 + 1e-6), limit)

    def pixel(self, p: Points) -> tuple[int, int]:
        """Row and column of the pixel a point lies in."""
        return math.floor(p[1] + 0.5), math.floor(p[0] + 0.5)

    def force(self, p: Points, normal: Points) -> Points:
        """Balloon in homogeneous parts, attraction to the ridge in edge zones."""
        zone = self.zone[self.pixel(p)]
        if zone in (HOMOGENEOUS, SWEPT):
            way = math.copysign(1.0, self.options.balloon) * normal
            return self.free_way(p, way) * way
        level, slope = self.slope(p)
        if level <= 0:
            return np.zeros(2)
        gain = self.options.attraction * (2 if zone == STRONG_EDGE else 1)
        return float(np.clip(gain * (slope @ normal) / level, -1.0, 1.0)) * normal

    def free_way(self, p: Points, way: Points) -> float:
        """To the first edge zone, and 1.5 px short of what was swept."""
        wanted = abs(self.options.balloon)
        reach = 0.5
        while reach < wanted + 1.5:
            zone = self.zone[self.pixel(self.clamp(p + reach * way))]
            if zone == SWEPT and reach >= 1.5:
                return min(wanted, reach - 1.5)
            if zone in (EDGE, STRONG_EDGE) and reach < wanted:
                return reach
            reach += 0.5
        return wanted

    def slope(self, p: Points) -> tuple[float, Points]:
        """Value and slope of the gradient map, bilinear between pixels."""
        height, width = self.gradient.shape
        x, y = min(max(p[0], 0.0), width - 1.0), min(max(p[1], 0.0), height - 1.0)
        padded = np.pad(self.gradient, 2, mode="edge")
        level, slope = 0.0, np.zeros(2)
        for v in (0, 1):
            for u in (0, 1):
                r, c = int(y) + v + 2, int(x) + u + 2
                weight = (1 - abs(int(x) + u - x)) * (1 - abs(int(y) + v - y))
                level += weight * padded[r, c]
                slope[0] += weight * (padded[r, c + 1] - padded[r, c - 1]) / 2
                slope[1] += weight * (padded[r + 1, c] - padded[r - 1, c]) / 2
        return level, slope

    def near(self, a: Points, b: Points) -> Points:
        """At most 64 px from a."""
        length = float(np.hypot(*(b - a)))
        return a + (64.0 / length) * (b - a) if length > 64.0 else b

    def inside(self, a: Points, b: Points) -> Points:
        """The last of the places 0.5 px apart on the way up to which all lie in the domain."""
        length, last, done = float(np.hypot(*(b - a))), a, 0.5
        while done < length:
            p = a + (done / length) * (b - a)
            if not self.domain[self.pixel(p)]:
                return last
            last, done = p, done + 0.5
        return b if self.domain[self.pixel(b)] else last

    def sweep(self, a: Points, b: Points, c: Points, d: Points) -> None:
        """Mark homogeneous pixels between the stretches ab and cd."""
        moved = max(float((c - a) @ (c - a)), float((d - b) @ (d - b)))
        if moved < 0.05 * 0.05:
            return
        ahead = 1 + int(math.sqrt(moved))
        along = 1 + int(math.sqrt(max(float((b - a) @ (b - a)), float((d - c) @ (d - c)))))
        for i in range(along):
            start, end = a + i / along * (b - a), c + i / along * (d - c)
            for k in range(1, ahead + 1):
                at = self.pixel(start + k / ahead * (end - start))
                if self.zone[at] == HOMOGENEOUS:
                    self.zone[at] = SWEPT

    def refined(self, points: Points) -> Points:
        """Drop points nearer than a third of the spacing to the one kept before; halve longer stretches."""
        kept: list[Points] = []
        for i, p in enumerate(points):
            if kept and np.hypot(*(p - kept[-1])) < self.options.spacing / 3:
                continue
            kept.append(p)
            follower = points[(i + 1) % len(points)]
            if np.hypot(*(follower - p)) > self.options.spacing:
                kept.append((p + follower) / 2)
        return np.array(kept)
