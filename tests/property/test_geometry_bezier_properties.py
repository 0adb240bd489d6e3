"""Patches and contours against their naive twins, exactly where the numbers are dyadic."""

from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ffseg.geometry import bezier
from ffseg.geometry.freeform import FreeForm
from tests import naive
from tests import strategies as own


def size(points: np.ndarray) -> float:
    return float(np.abs(points).max(initial=1e-300))


@given(own.dyadic_patch())
def test_halving_is_exact_on_the_dyadic_grid(patch: own.Points) -> None:
    left, right = bezier.split(patch)
    expected = naive.halves(naive.exact(patch))
    assert naive.exact(left) == expected[0]
    assert naive.exact(right) == expected[1]


@given(own.dyadic_patch(degree=3))
def test_halving_three_times_is_exact(patch: own.Points) -> None:
    piece, twin = patch, naive.exact(patch)
    for side in (0, 1, 0):
        piece, twin = bezier.split(piece)[side], naive.halves(twin)[side]
    assert naive.exact(piece) == twin


@given(own.dyadic_patch(), st.integers(0, 16))
def test_evaluation_is_exact_at_dyadic_parameters(patch: own.Points, k: int) -> None:
    # 18 + 8 bits of coordinate and 4 bits a level fit the 53 of a float64 for d <= 6
    point = bezier.evaluate(patch, k / 16)
    assert naive.exact([point])[0] == naive.bezier_point(naive.exact(patch), Fraction(k, 16))


@given(own.dyadic_patch())
def test_interpolation_agrees_with_lagrange(samples: own.Points) -> None:
    expected = [[float(x), float(y)] for x, y in naive.interpolate(naive.exact(samples))]
    np.testing.assert_allclose(bezier.interpolate(samples), expected, rtol=0, atol=100 * 2e-16 * size(samples))


@given(own.dyadic_patch(), st.floats(0, 1))
def test_split_anywhere_and_elevation_keep_the_curve(patch: own.Points, t: float) -> None:
    bound = 40 * 2e-16 * size(patch)
    left, right = bezier.split(patch, t)
    for u in (0.0, 0.3, 1.0):
        np.testing.assert_allclose(bezier.evaluate(left, u), bezier.evaluate(patch, t * u), rtol=0, atol=bound)
        np.testing.assert_allclose(
            bezier.evaluate(right, u), bezier.evaluate(patch, t + (1 - t) * u), rtol=0, atol=bound
        )
        np.testing.assert_allclose(
            bezier.evaluate(bezier.elevate(patch), u), bezier.evaluate(patch, u), rtol=0, atol=bound
        )


@given(own.dyadic_patch(), st.floats(0, 1))
def test_the_curve_lies_in_the_box_of_its_control_points(patch: own.Points, t: float) -> None:
    # each of at most 6 levels of de Casteljau rounds three times
    slack = 20 * 2e-16 * size(patch)
    point = bezier.evaluate(patch, t)
    assert (point >= patch.min(axis=0) - slack).all()
    assert (point <= patch.max(axis=0) + slack).all()


@given(own.troubled_contour())
def test_area_agrees_with_multiplied_out_polynomials(made: tuple[own.Points, int]) -> None:
    points, degree = made
    expected = float(naive.signed_area(naive.exact(points), degree))
    extent = size(points - points[0])
    rounding = 2e-16 * (50 * extent**2 + 4 * len(points) * extent * size(points - points[0]))
    assert abs(FreeForm(points, degree).signed_area - expected) <= rounding * len(points)


@given(own.troubled_contour())
def test_reversal_changes_the_area_sign_and_keeps_the_curve(made: tuple[own.Points, int]) -> None:
    contour = FreeForm(*made)
    back = contour.reversed()
    scale = size(contour.control_points)
    assert abs(back.signed_area + contour.signed_area) <= 1e-14 * len(made[0]) * scale**2
    t = np.linspace(0, 1, 17)
    np.testing.assert_allclose(back.evaluate(t), contour.evaluate(1 - t), rtol=0, atol=1e-13 * scale)
    np.testing.assert_array_equal(back.reversed().control_points, contour.control_points)


@given(own.troubled_contour())
def test_bounding_box_holds_the_curve_and_touches_it(made: tuple[own.Points, int]) -> None:
    contour = FreeForm(*made)
    box = contour.bounding_box
    dense = bezier.evaluate(contour.patches[:, None], np.linspace(0, 1, 401)).reshape(-1, 2)
    slack = 1e-12 * size(contour.control_points)
    assert (dense >= box[0] - slack).all()
    assert (dense <= box[1] + slack).all()
    # a dense sample misses an extreme by at most h^2 |B''| / 8, h = 1/400
    bend = contour.degree**2 * np.abs(np.diff(contour.patches, n=2, axis=1)).max(initial=0.0)
    np.testing.assert_allclose([dense.min(axis=0), dense.max(axis=0)], box, rtol=0, atol=slack + bend / 8 / 400**2)


@given(own.troubled_contour(scaled=False), st.sampled_from([1e-1, 1e-2, 1e-4]))
def test_flattening_stays_within_its_tolerance(made: tuple[own.Points, int], tolerance: float) -> None:
    contour = FreeForm(*made)
    vertices, owner = contour.flatten_indexed(tolerance)
    assert (np.diff(owner) >= 0).all()
    patches = contour.patches
    counts = np.bincount(owner, minlength=len(patches))
    for u in (0.25, 0.5, 0.75):
        step = np.arange(len(vertices)) - np.repeat(np.cumsum(counts) - counts, counts)
        on_curve = bezier.evaluate(patches[owner], (step + u) / counts[owner])
        on_chord = (1 - u) * vertices + u * np.roll(vertices, -1, axis=0)
        assert np.hypot(*(on_curve - on_chord).T).max() <= tolerance * (1 + 1e-9)


@given(own.troubled_contour(), st.integers(0, 5))
def test_elevation_of_a_contour_keeps_area_and_curve(made: tuple[own.Points, int], more: int) -> None:
    contour = FreeForm(*made)
    raised = contour.elevated(min(6, contour.degree + more))
    scale = size(contour.control_points)
    t = np.linspace(0, 1, 13)
    np.testing.assert_allclose(raised.evaluate(t), contour.evaluate(t), rtol=0, atol=1e-13 * scale)
