"""Slow, obvious twins of the geometry and the raster. Imports nothing from ffseg.

Points are pairs of Fractions (or floats); patches are lists of points. Everything is exact when given Fractions.
"""

from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from math import comb, floor

import numpy as np

Number = Fraction
Point = tuple[Number, Number]
Patch = list[Point]


def exact(points: Sequence[Sequence[float]]) -> Patch:
    """The same points as Fractions: every float is one exactly."""
    return [(Fraction(float(x)), Fraction(float(y))) for x, y in points]


def patches_of(control_points: Sequence[Point], degree: int) -> list[Patch]:
    """Patches of a closed contour by Definition 1."""
    looped = [*control_points, control_points[0]]
    return [list(looped[i : i + degree + 1]) for i in range(0, len(control_points), degree)]


def bezier_point(patch: Patch, t: Number) -> Point:
    """Algorithm 1, the printed recursion."""
    if len(patch) == 1:
        return patch[0]
    a, b = bezier_point(patch[:-1], t), bezier_point(patch[1:], t)
    return ((1 - t) * a[0] + t * b[0], (1 - t) * a[1] + t * b[1])


def times(a: Sequence[Number], b: Sequence[Number]) -> list[Number]:
    """Product of two polynomials, lowest power first."""
    product = [Fraction(0)] * (len(a) + len(b) - 1)
    for i, left in enumerate(a):
        for j, right in enumerate(b):
            product[i + j] += left * right
    return product


def lagrange(degree: int, i: int) -> list[Number]:
    """The polynomial, lowest power first, that is 1 at i/d and 0 at every other k/d."""
    basis = [Fraction(1)]
    for k in range(degree + 1):
        if k != i:
            basis = times(basis, [Fraction(-k, i - k), Fraction(degree, i - k)])
    return basis


@cache
def interpolation_inverse(degree: int) -> list[list[Number]]:
    """V^-1 of Eq. 6: Lagrange polynomials rewritten in the Bernstein basis (no matrix is inverted)."""
    columns = [lagrange(degree, j) for j in range(degree + 1)]
    return [
        [sum((Fraction(comb(i, k), comb(degree, k)) * a[k] for k in range(i + 1)), start=Fraction(0)) for a in columns]
        for i in range(degree + 1)
    ]


def interpolate(samples: Patch) -> Patch:
    rows = interpolation_inverse(len(samples) - 1)
    x = [sum((w * p[0] for w, p in zip(row, samples, strict=True)), start=Fraction(0)) for row in rows]
    y = [sum((w * p[1] for w, p in zip(row, samples, strict=True)), start=Fraction(0)) for row in rows]
    return list(zip(x, y, strict=True))


def halves(patch: Patch) -> tuple[Patch, Patch]:
    """Algorithm 2 in rationals: 2d + 1 samples and two interpolations."""
    degree = len(patch) - 1
    samples = [bezier_point(patch, Fraction(i, 2 * degree)) for i in range(2 * degree + 1)]
    return interpolate(samples[: degree + 1]), interpolate(samples[degree:])


def power_form(values: Sequence[Number]) -> list[Number]:
    """Coefficients, lowest power first, of the polynomial with these Bernstein coefficients."""
    degree = len(values) - 1
    total = [Fraction(0)] * (degree + 1)
    for i, value in enumerate(values):
        for k in range(degree - i + 1):
            total[i + k] += value * comb(degree, i) * comb(degree - i, k) * (-1) ** k
    return total


def signed_area(control_points: Sequence[Point], degree: int) -> Number:
    """Integral of (x dy - y dx) / 2 by multiplying out the polynomials."""
    total = Fraction(0)
    for patch in patches_of(control_points, degree):
        x, y = power_form([p[0] for p in patch]), power_form([p[1] for p in patch])
        for i in range(degree + 1):
            for j in range(1, degree + 1):
                total += (x[i] * y[j] - y[i] * x[j]) * Fraction(j, i + j)
    return total / 2


def crossing_sign(a: Point, b: Point, p: Point) -> int:
    """+1 or -1 when the edge crosses the ray from `p` to +x downward (y growing) or upward, else 0.

    Half-open: the edge owns its end of smaller y only; a point on the edge is not to its left.
    """
    if a[1] <= p[1] < b[1]:
        low, high, sign = a, b, 1
    elif b[1] <= p[1] < a[1]:
        low, high, sign = b, a, -1
    else:
        return 0
    side = (high[0] - low[0]) * (p[1] - low[1]) - (p[0] - low[0]) * (high[1] - low[1])
    return sign if side > 0 else 0


def winding(polygons: Sequence[Sequence[Point]], p: Point) -> int:
    """Winding number of all the polygons together round `p`."""
    return sum(crossing_sign(poly[i - 1], poly[i], p) for poly in polygons for i in range(len(poly)))


def raster(polygons: Sequence[Sequence[Point]], height: int, width: int) -> list[list[bool]]:
    """The pixel-centre rule: winding number > 0 at integer coordinates."""
    return [[winding(polygons, (Fraction(x), Fraction(y))) > 0 for x in range(width)] for y in range(height)]


def winding_image(vertices: np.ndarray, height: int, width: int) -> np.ndarray:
    """Winding numbers of one polygon at integer coordinates in plain floats: right but within rounding of an edge."""
    y, x = np.indices((height, width))
    total = np.zeros((height, width), dtype=int)
    for (ax, ay), (bx, by) in zip(np.roll(vertices, 1, axis=0), vertices, strict=True):
        if ay == by:
            continue
        crossed = (min(ay, by) <= y) & (y < max(ay, by))
        total += np.where(crossed & (ax + (y - ay) * (bx - ax) / (by - ay) > x), 1 if ay < by else -1, 0)
    return total


def crossings(polygons: Sequence[Sequence[Point]], row: Number) -> list[Number]:
    """Where the edges cross a row; an edge owns its end of smaller y only."""
    found = []
    for poly in polygons:
        for i in range(len(poly)):
            (ax, ay), (bx, by) = sorted((poly[i - 1], poly[i]), key=lambda p: p[1])
            if ay <= row < by:
                found.append(ax + (bx - ax) * (row - ay) / (by - ay))
    return found


def crossed_step(polygons: Sequence[Sequence[Point]], step: Point, margin: Number) -> Point:
    """A step from a pixel centre to the next along x or y, by its middle, moved to the mean of the crossings near it."""
    if step[0] % 1 == 0:
        y, x = crossed_step([[(b, a) for a, b in poly] for poly in polygons], step[::-1], margin)
        return x, y
    cell = step[0] - Fraction(1, 2)
    near = [x for x in crossings(polygons, step[1]) if cell <= floor(x + margin) and floor(x - margin) <= cell]
    mean = sum(near) / len(near) if near else step[0]
    return max(cell + margin, min(mean, cell + 1 - margin)), step[1]


def turn(a: Point, b: Point, c: Point) -> Number:
    """Twice the signed area of a triangle."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
