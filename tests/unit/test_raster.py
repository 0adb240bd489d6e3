"""Rasterising by the pixel-centre rule: analytic cases and ties, the naive twin and the exact curve."""

import math
from fractions import Fraction

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed, unpacked
from ffseg.image.raster import rasterize
from ffseg.native import _core
from tests import naive
from tests import strategies as own
from tests.discs import disc_of


@pytest.mark.parametrize("degree", [3, 4, 5, 6])
def test_circle_is_the_disc_and_does_not_paint_its_boundary(degree: int) -> None:
    radius = math.sqrt(2530)  # no sum of two squares: every centre is at least 0.009 px off the circle
    circle = FreeForm.circle((100, 80), radius, 40, degree)  # off the true circle by less than 1e-4 px
    np.testing.assert_array_equal(rasterize([circle], (160, 200), 1e-3), disc_of((160, 200))(100, 80, radius))


def test_contours_of_several_degrees_go_together() -> None:
    contours = [FreeForm.circle((20 + 40 * d, 30), 15, 12, d) for d in range(1, 7)]
    alone = np.any([rasterize([c], (60, 300)) for c in contours], axis=0)
    np.testing.assert_array_equal(rasterize(contours, (60, 300)), alone)


def test_no_contours_and_empty_shapes() -> None:
    assert not rasterize([], (4, 5)).any()
    assert rasterize([FreeForm.box(0, 0, 9, 9)], (0, 7)).shape == (0, 7)
    assert rasterize([FreeForm.box(0, 0, 9, 9)], (7, 0)).shape == (7, 0)


@pytest.mark.parametrize("scale", [1e3, 1e6, 1e9, 1e30, 1e100])
@pytest.mark.parametrize("degree", range(1, 7))
def test_contours_far_larger_than_the_image(scale: float, degree: int) -> None:
    wide = FreeForm.circle((0, 0), 0.9 * scale, 9, degree)
    assert rasterize([wide], (30, 40)).all()
    assert not rasterize([wide.reversed()], (30, 40)).any()
    # the right half plane: an edge at x = 17.5 whose ends are far away
    half = FreeForm.polygon([(17.5, -scale), (scale, -scale), (scale, scale), (17.5, scale)]).elevated(degree)
    mask = rasterize([half], (30, 40))
    assert mask[:, 18:].all()
    assert not mask[:, :18].any()


def test_crossings_at_centres_are_decided_exactly() -> None:
    sizes = [n for n in range(2, 200) if any(n * (k / n) > k for k in range(n))]
    assert sizes  # there float64 puts the crossing just right of the centre it meets
    y, x = np.indices((200, 200))
    for n in sizes[:: max(1, len(sizes) // 10)]:
        upper = rasterize([FreeForm.polygon([(0, 0), (n, 0), (n, n)])], (200, 200))
        np.testing.assert_array_equal(upper, (x >= y) & (x < n))


def test_refuses_coordinates_beyond_all_use_and_tolerances_too_small() -> None:
    for bad in (1e101, -1e101):
        with pytest.raises(ValueError, match="too far away"):
            rasterize([FreeForm.box(0, 0, bad, 1)], (4, 4))
    for bad in (0.0, -1.0, math.nan, 1e-7):
        with pytest.raises(ValueError, match="tolerance"):
            rasterize([FreeForm.box(0, 0, 1, 1)], (4, 4), bad)


def test_native_border_refuses_bad_offsets_and_values() -> None:
    mask = np.zeros((4, 4), np.uint8)

    def call(points: list[list[float]], offsets: list[int], degrees: list[int]) -> None:
        _core.rasterize(np.array(points, float).reshape(-1, 2), np.array(offsets), np.array(degrees, int), 0.01, mask)

    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    call(square, [0, 4], [1])
    bad_offsets = [([0], [1]), ([1, 4], [1]), ([0, 5], [1]), ([0, 4, 2, 4], [1, 1, 1]), ([0, 0, 4], [1, 1])]
    for offsets, degrees in [*bad_offsets, *(([0, 4], [degree]) for degree in (0, 3, 7))]:
        with pytest.raises(ValueError, match=r"offsets|contour"):
            call(square, offsets, degrees)
    with pytest.raises(ValueError, match="finite"):
        call([[0, 0], [math.nan, 0], [1, 1]], [0, 3], [1])


def test_areas_of_many_contours_are_those_of_each_and_their_moments_summed() -> None:
    rng = np.random.default_rng(4)
    for degree in (1, 3, 6):
        contours = [FreeForm(rng.normal(500, 90, (patches * degree, 2)), degree) for patches in (1, 2, 60, 700)]
        together = unpacked(*packed(contours), degree)
        assert [one.signed_area for one in together] == [one.signed_area for one in contours]
        for one in contours[:3]:  # the last would have millions of chords
            fine = FreeForm.polygon(one.flatten(1e-5))
            assert one.signed_area == pytest.approx(fine.signed_area, abs=1e-4 * one.length)


def test_steps_along_the_axes_are_those_of_the_control_polygon() -> None:
    contours = [FreeForm.box(2, 1, 9, 5), FreeForm([(0, 0), (3, 4), (6, 0)], 3)]
    assert _core.steps_along_axes(*packed(contours)) == [22.0, 20.0]


def test_areas_need_whole_patches_and_a_square_matrix() -> None:
    points, ends = np.zeros((4, 2)), np.array([0, 4])
    with pytest.raises(ValueError, match="control points"):
        _core.signed_areas(points, ends, np.zeros((4, 4)))
    with pytest.raises(ValueError, match="rows and columns"):
        _core.signed_areas(points, ends, np.zeros((4, 3)))


SHAPE = (14, 15)


@given(st.lists(own.half_grid_polygon(), min_size=0, max_size=3))
def test_polygons_on_the_half_grid_agree_exactly(polygons: list[own.Points]) -> None:
    expected = naive.raster([naive.exact(p) for p in polygons], *SHAPE)
    np.testing.assert_array_equal(rasterize([FreeForm.polygon(p) for p in polygons], SHAPE), expected)


@given(own.troubled_points(9), st.sampled_from([8.0, 1e3, 1e7, 1e15, 1e40]), st.floats(-3, 18))
def test_troubled_polygons_agree_exactly_at_any_scale(points: own.Points, scale: float, shift: float) -> None:
    polygon = points * scale + shift
    expected = naive.raster([naive.exact(polygon)], *SHAPE)
    np.testing.assert_array_equal(rasterize([FreeForm.polygon(polygon)], SHAPE), expected)


@given(own.troubled_contour(scaled=False), st.sampled_from([4.0, 40.0]))
def test_curves_differ_from_the_exact_region_within_the_tolerance(made: tuple[own.Points, int], scale: float) -> None:
    points, degree = made
    contour = FreeForm(points * scale + 7.0, degree)
    vertices = contour.flatten(1e-3)
    different = rasterize([contour], SHAPE, tolerance=0.05) != (naive.winding_image(vertices, *SHAPE) > 0)
    rows, columns = np.nonzero(different)
    curve = shapely.LineString([*vertices, vertices[0]])
    centres = shapely.points(np.stack([columns, rows], axis=-1).astype(float))
    assert (shapely.distance(curve, centres) <= 0.05 + 2e-3).all()


@given(own.troubled_contour(scaled=False), own.troubled_contour(scaled=False))
def test_order_of_contours_does_not_matter(one: tuple[own.Points, int], two: tuple[own.Points, int]) -> None:
    contours = [FreeForm(points * 9 + 7, degree) for points, degree in (one, two)]
    np.testing.assert_array_equal(rasterize(contours, SHAPE), rasterize(contours[::-1], SHAPE))


@given(st.lists(own.half_grid_polygon(), min_size=1, max_size=3), own.troubled_points(9), st.sampled_from([1, 8, 1e3]))
def test_steps_move_where_contours_cross_them(polygons: list[own.Points], troubled: own.Points, scale: float) -> None:
    polygons = [*polygons, troubled * scale + 5.0]
    contours = [FreeForm.polygon(p) for p in polygons]
    rows, columns = np.indices((9, 9)).reshape(2, -1) - 1.0
    steps = np.concatenate([np.stack([columns + 0.5, rows], axis=1), np.stack([rows, columns + 0.5], axis=1)])
    degrees = np.ones(len(contours), np.int64)
    found = _core.crossings(steps, *packed(contours), degrees, 0.01)
    exact = [naive.exact(p) for p in polygons]
    for (x, y), step in zip(found, steps, strict=True):
        middle, margins = tuple(map(Fraction, step)), (0.02 - 1e-9, 0.02 + 1e-9)  # a crossing may lie on the margin
        expected = [naive.crossed_step(exact, middle, Fraction(margin)) for margin in margins]
        assert min(abs(x - a) + abs(y - b) for a, b in expected) < 1e-8
