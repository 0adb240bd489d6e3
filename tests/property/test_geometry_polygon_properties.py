"""Orientation and crossings against rationals and shapely, degenerate input included."""

from __future__ import annotations

from itertools import combinations, permutations

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from ffseg.geometry.freeform import FreeForm
from tests import naive
from tests import strategies as own
from tests.crossings import orientation, self_intersections, signed_area

FINE = 1e-6
"""Below the depth of any crossing of a polygon on the half grid (1/400 px and more)."""


@given(own.troubled_points(6), st.sampled_from([1e-60, 1.0, 1e60]))
def test_orientation_has_the_exact_sign(points: own.Points, scale: float) -> None:
    scaled = points * scale
    exact = naive.exact(scaled)
    triples = list(permutations(range(6), 3))
    signs = orientation(scaled, *np.array(triples).T)
    for (i, j, k), sign in zip(triples, signs.tolist(), strict=True):
        assert sign in (-1, 1)
        assert sign * naive.turn(exact[i], exact[j], exact[k]) >= 0


@given(own.half_grid_polygon())
def test_orientation_is_consistent_where_points_are_in_line(points: own.Points) -> None:
    size = len(points)
    triples = list(permutations(range(size), 3))
    found = orientation(points, *np.array(triples, dtype=np.int64).reshape(-1, 3).T)
    signs = dict(zip(triples, found.tolist(), strict=True))
    for i, j, k in combinations(range(size), 3):
        assert signs[i, j, k] == signs[j, k, i] == -signs[j, i, k]
    for i, j, k, m in combinations(range(size), 4):
        # the areas of the four triangles, signed in turn, sum to zero: in general position the signs differ
        assert len({signs[j, k, m], -signs[i, k, m], signs[i, j, m], -signs[i, j, k]}) == 2


@given(st.lists(own.troubled_points(8), min_size=1, max_size=2), st.integers(0, 2**32 - 1))
def test_crossings_of_polygons_in_general_position(polygons: list[own.Points], seed: int) -> None:
    rng = np.random.default_rng(seed)
    moved = [p * 10 + rng.uniform(-0.3, 0.3, p.shape) for p in polygons]
    expected = naive.proper_crossings([naive.exact(p) for p in moved])
    found = self_intersections(moved, tolerance=1e-13)
    assert {(c.first, c.second) for c in found} == expected
    backward = self_intersections([p[::-1] for p in moved], tolerance=1e-13)
    assert len(backward) == len(found)


@given(st.lists(own.half_grid_polygon(), min_size=1, max_size=2))
def test_valid_polygons_do_not_cross_and_proper_crossings_are_found(polygons: list[own.Points]) -> None:
    found = self_intersections(polygons, tolerance=FINE)
    rings = [shapely.Polygon(p) for p in polygons if len(p) >= 4]
    alone = all(ring.is_valid and ring.area > 0 for ring in rings) and len(rings) == len(polygons)
    if alone and (len(rings) == 1 or rings[0].touches(rings[1]) or rings[0].disjoint(rings[1])):
        assert found == []
    if naive.proper_crossings([naive.exact(p) for p in polygons]):
        assert found


@given(own.troubled_contour(scaled=False))
def test_a_troubled_contour_is_handled(made: tuple[own.Points, int]) -> None:
    points, degree = made
    for crossing in self_intersections([FreeForm(points * 20, degree)]):
        assert np.isfinite([crossing.x, crossing.y]).all()


@given(own.half_grid_polygon())
def test_polygon_area_is_exact_on_the_grid(points: own.Points) -> None:
    assert signed_area(points) == naive.signed_area(naive.exact(points), 1)
