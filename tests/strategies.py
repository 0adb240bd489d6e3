"""Hypothesis strategies biased to trouble: repeated points, collinear runs, loops, cusps, tiny and huge scales."""

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

Points = NDArray[np.float64]

degrees = st.integers(1, 6)
dyadic = st.integers(-(2**17), 2**17).map(lambda k: k / 256.0)
"""Coordinates on a 1/256 px grid within +-512 px: exact under several halvings."""


@st.composite
def dyadic_patch(draw: st.DrawFn, degree: int | None = None) -> Points:
    """Control points, shape (d + 1, 2), on the 1/256 px grid."""
    d = draw(degrees) if degree is None else degree
    return np.array(draw(st.lists(st.tuples(dyadic, dyadic), min_size=d + 1, max_size=d + 1)))


@st.composite
def troubled_points(draw: st.DrawFn, count: int) -> Points:
    """`count` points of about unit size, often repeated, nearly repeated, collinear or turning back."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    points = rng.uniform(-1.0, 1.0, (count, 2))
    kind = draw(st.sampled_from(["free", "repeated", "nearly", "collinear", "axis", "back", "grid", "point"]))
    chosen = rng.integers(0, count, count)
    if kind == "repeated":
        points[::2] = points[chosen][::2]
    elif kind == "nearly":
        points[::2] = points[chosen][::2] + rng.normal(0, 1e-12, (len(points[::2]), 2))
    elif kind == "collinear":
        points[:, 1] = 0.5 * points[:, 0] + 0.25
    elif kind == "axis":
        points[:, rng.integers(0, 2)] = 0.5
    elif kind == "back":
        points[count // 2 :] = points[: count - count // 2][::-1]
    elif kind == "grid":
        points = np.round(points * 4.0) / 4.0
    elif kind == "point":
        points[:] = points[0]
    return points


@st.composite
def troubled_contour(draw: st.DrawFn, scaled: bool = True) -> tuple[Points, int]:
    """Control points (N * d, 2) and degree of a closed contour, at scales from 1e-9 to 1e9 and far from the origin."""
    degree = draw(degrees)
    points = draw(troubled_points(degree * draw(st.integers(1, 7))))
    if not scaled:
        return points, degree
    scale = draw(st.sampled_from([1e-9, 1.0, 100.0, 1e9]))
    shift = draw(st.sampled_from([0.0, 1.0, 1e4])) * scale
    return points * scale + shift, degree


@st.composite
def half_grid_polygon(draw: st.DrawFn, limit: int = 12) -> Points:
    """Polygon on a half-pixel grid: vertices, edges and crossings on pixel centres are common."""
    coordinate = st.integers(-4, 2 * limit + 4).map(lambda k: k / 2.0)
    points = draw(st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=12))
    return np.array(points)
