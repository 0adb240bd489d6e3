"""The native raster against its naive twin, against shapely at pixel centres and against the exact curve."""

from fractions import Fraction

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed
from ffseg.image.raster import rasterize
from ffseg.native import _core
from tests import naive
from tests import strategies as own

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
def test_curves_differ_from_the_exact_region_only_within_the_tolerance(
    made: tuple[own.Points, int], scale: float
) -> None:
    points, degree = made
    contour = FreeForm(points * scale + 7.0, degree)
    vertices = contour.flatten(1e-3)
    different = rasterize([contour], SHAPE, tolerance=0.05) != (naive.winding_image(vertices, *SHAPE) > 0)
    rows, columns = np.nonzero(different)
    curve = shapely.LineString([*vertices, vertices[0]])
    centres = shapely.points(np.stack([columns, rows], axis=-1).astype(float))
    assert (shapely.distance(curve, centres) <= 0.05 + 2e-3).all()


@given(st.integers(3, 40), st.integers(0, 2**32 - 1))
def test_star_polygons_agree_with_shapely_at_pixel_centres(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, count))
    points = (20, 15) + rng.uniform(2, 18, count)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    polygon = shapely.Polygon(points)
    if not polygon.is_valid or shapely.LinearRing(points).is_ccw is False:
        return
    y, x = np.indices((30, 40))
    expected = shapely.contains_xy(polygon, x.ravel(), y.ravel()).reshape(30, 40)
    np.testing.assert_array_equal(rasterize([FreeForm.polygon(points)], (30, 40)), expected)


@given(own.troubled_contour(scaled=False), own.troubled_contour(scaled=False))
def test_order_of_contours_does_not_matter(one: tuple[own.Points, int], two: tuple[own.Points, int]) -> None:
    contours = [FreeForm(points * 9 + 7, degree) for points, degree in (one, two)]
    np.testing.assert_array_equal(rasterize(contours, SHAPE), rasterize(contours[::-1], SHAPE))


@given(
    st.lists(own.half_grid_polygon(), min_size=1, max_size=3), own.troubled_points(9), st.sampled_from([1.0, 8.0, 1e3])
)
def test_steps_are_moved_to_where_contours_cross_them(
    polygons: list[own.Points], troubled: own.Points, scale: float
) -> None:
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
