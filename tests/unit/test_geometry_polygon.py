"""Crossings of contours: the tolerance, touching and running along."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ffseg.geometry.freeform import FreeForm
from tests.crossings import Crossing, self_intersections, signed_area

SQUARE = FreeForm.box(0, 0, 10, 10)


def places(found: list[Crossing]) -> list[tuple[float, float, tuple[int, int], tuple[int, int]]]:
    return [(round(c.x, 6), round(c.y, 6), c.first, c.second) for c in found]


def test_area_of_a_polygon_far_away() -> None:
    triangle = np.array([(0.0, 0.0), (3.0, 0.0), (0.0, 4.0)])
    assert signed_area(triangle) == 6.0
    assert signed_area(triangle[::-1] + 2.0**40) == -6.0
    assert signed_area(triangle[:2]) == signed_area(triangle[:0]) == 0.0


def test_bow_tie_crosses_once() -> None:
    bow_tie = np.array([(0.0, 0.0), (10.0, 10.0), (10.0, 0.0), (0.0, 10.0)])
    assert places(self_intersections([bow_tie])) == [(5, 5, (0, 0), (0, 2))]


def test_crossings_name_contour_and_patch() -> None:
    found = self_intersections([FreeForm.circle((50, 50), 5, 6, 3), SQUARE, FreeForm.box(5, 5, 15, 15)])
    assert places(found) == [(10, 5, (1, 1), (2, 0)), (5, 10, (1, 2), (2, 3))]


@pytest.mark.parametrize(
    "other",
    [
        SQUARE,
        SQUARE.reversed(),
        FreeForm.box(10, 0, 20, 10),
        FreeForm.box(10, 10, 20, 20),
        FreeForm.box(10, 3, 20, 6),
        FreeForm.box(2, 2, 10, 8),
        FreeForm.polygon([(10, 5), (20, 0), (20, 10)]),
        FreeForm.polygon([(10, 5), (2, 2), (2, 8)]),
        FreeForm.box(20, 20, 30, 30),
        FreeForm.box(2, 2, 8, 8),
    ],
)
def test_touching_running_along_and_nesting_do_not_count(other: FreeForm) -> None:
    assert self_intersections([SQUARE, other]) == []
    assert self_intersections([other, SQUARE]) == []


def test_passing_through_a_vertex_counts_once() -> None:
    diamond = np.array([(5.0, 0.0), (10.0, 5.0), (5.0, 10.0), (0.0, 5.0)])
    through_corner = np.array([(10.0, 5.0), (15.0, 0.0), (15.0, 20.0), (5.0, 5.0)])
    assert len(self_intersections([diamond, through_corner])) == 2
    wedge = np.array([(5.0, 5.0), (20.0, 4.0), (20.0, 5.0), (10.0, 5.0), (20.0, 7.0)])
    assert len(self_intersections([diamond, wedge])) == 2


def test_doubling_back_does_not_count() -> None:
    spike = np.array([(0.0, 0.0), (5.0, 5.0), (10.0, 0.0), (5.0, 5.0), (5.0, 10.0)])
    assert self_intersections([spike]) == []
    assert self_intersections([spike[::-1]]) == []
    assert self_intersections([np.array([(0.0, 0.0), (9.0, 3.0), (3.0, 1.0)])]) == []


@pytest.mark.parametrize(("depth", "count"), [(0.004, 0), (0.011, 2), (1.0, 2)])
def test_the_tolerance_is_the_depth_of_the_overlap(depth: float, count: int) -> None:
    assert len(self_intersections([SQUARE, FreeForm.box(10 - depth, 2, 20, 8)])) == count
    assert len(self_intersections([SQUARE, FreeForm.box(10 - depth, 2, 20, 8)], tolerance=2.5)) == 0


@pytest.mark.parametrize(("size", "count"), [(0.002, 0), (0.1, 1)])
def test_small_loops_do_not_count(size: float, count: int) -> None:
    loop = np.array(
        [(0.0, 0.0), (5.0 + size, 0.0), (5.0 + size, size), (5.0, size), (5.0, -size), (9.0, -5.0), (0.0, -5)]
    )
    assert len(self_intersections([loop])) == count


def test_loop_inside_one_cubic_patch() -> None:
    loop = FreeForm([[0, 0], [8, 6], [-7, 6], [1, 0], [1, -3], [0, -3]], 3)
    (crossing,) = self_intersections([loop])
    assert crossing.first == crossing.second == (0, 0)
    dense = loop.evaluate(np.linspace(0, 0.5, 20_001))
    assert np.hypot(*(dense - (crossing.x, crossing.y)).T).min() < 0.01


def test_two_circles_cross_twice_and_apart_or_nested_never() -> None:
    def circle(x: float, radius: float) -> FreeForm:
        return FreeForm.circle((x, 0), radius, 16, 3)

    found = self_intersections([circle(0, 10), circle(12, 10)])
    np.testing.assert_allclose([(c.x, abs(c.y)) for c in found], [(6, 8)] * 2, atol=0.02)
    assert self_intersections([circle(0, 10), circle(20.1, 10), circle(0, 9.9).reversed()]) == []


def test_single_points_and_no_contours() -> None:
    assert self_intersections([]) == []
    assert self_intersections([FreeForm(np.ones((6, 2)), 3), FreeForm.polygon([(1, 1)]), SQUARE]) == []


def test_refuses() -> None:
    with pytest.raises(ValueError, match="positive tolerance"):
        self_intersections([SQUARE], tolerance=0.0)
    with pytest.raises(ValueError, match="finite"):
        self_intersections([np.array([(0.0, math.nan), (1.0, 0.0), (1.0, 1.0)])])
