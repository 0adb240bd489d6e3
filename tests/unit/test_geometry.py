"""Patches and contours: analytic values, the naive twins, winding numbers, the grouping of holes, crossings."""

import copy
import math
import pickle
from collections.abc import Callable
from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from ffseg.geometry import bezier
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.orientation import signs_of_turns
from ffseg.geometry.regions import group_regions, oriented
from tests import naive
from tests import strategies as own
from tests.crossings import self_intersections

DEGREES = range(1, bezier.MAX_DEGREE + 1)


def test_cubic_matrices_are_the_textbook_ones() -> None:
    expected = np.array([[27, 0, 0, 0], [8, 12, 6, 1], [1, 6, 12, 8], [0, 0, 0, 27]]) / 27
    inverse = np.array([[6, 0, 0, 0], [-5, 18, -9, 2], [2, -9, 18, -5], [0, 0, 0, 6]]) / 6
    np.testing.assert_array_equal(bezier.interpolation_matrix(3), expected)
    np.testing.assert_array_equal(bezier.interpolation_inverse(3), inverse)


@pytest.mark.parametrize("degree", DEGREES)
def test_inverse_entries_are_rounded_once(degree: int) -> None:
    expected = [[float(value) for value in row] for row in naive.interpolation_inverse(degree)]
    np.testing.assert_array_equal(bezier.interpolation_inverse(degree), expected)


def test_matrices_are_computed_once_and_read_only() -> None:
    assert bezier.interpolation_inverse(4) is bezier.interpolation_inverse(4)
    with pytest.raises(ValueError, match="read-only"):
        bezier.interpolation_inverse(4)[0, 0] = 2.0


@pytest.mark.parametrize("bad", [0, 7, -1, 2.0, True, None])
def test_refuses_other_degrees(bad: object) -> None:
    with pytest.raises(ValueError, match="whole number from 1 to 6"):
        bezier.check_degree(bad)


def test_chord_count_of_a_parabola_is_tight() -> None:
    parabola = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 2.0]])  # y = x^2 / 2: chords over n steps are off by 1/(2 n^2)
    assert (bezier.chord_count(parabola, 0.5 / 100), bezier.chord_count(parabola, 0.4999 / 100)) == (10, 11)


def test_evaluate_broadcasts_over_stacks() -> None:
    patch = np.arange(24.0).reshape(3, 4, 2)
    assert bezier.evaluate(patch, 0.5).shape == (3, 2)
    assert bezier.evaluate(patch[:, None], np.zeros(5)).shape == (3, 5, 2)
    assert bezier.evaluate(patch[0], np.zeros((2, 5))).shape == (2, 5, 2)


UNIT_SQUARE = FreeForm.box(0, 0, 1, 1)


def test_a_box_of_what_is_no_number_is_refused() -> None:
    for at in np.ndindex(4):
        with pytest.raises(ValueError, match="every coordinate must be finite"):
            FreeForm.box(*np.where(np.arange(4) == at, np.nan, np.arange(4.0)))


def test_box_has_positive_area_and_reversal_changes_the_sign() -> None:
    assert (UNIT_SQUARE.signed_area, UNIT_SQUARE.reversed().signed_area) == (1.0, -1.0)
    np.testing.assert_array_equal(UNIT_SQUARE.reversed().control_points[0], UNIT_SQUARE.control_points[0])
    assert FreeForm.box(5, 7, 2, 3).signed_area == 12.0


def test_area_far_away_keeps_its_digits() -> None:
    shift = 2.0**30
    far = FreeForm.circle((0, 0), 1.0, 8, 3).affine(np.eye(2), (shift, -shift))
    snapped = far.affine(np.eye(2), (-shift, shift))
    assert far.signed_area == pytest.approx(snapped.signed_area, rel=1e-15)


@pytest.mark.parametrize(
    ("matrix", "offset"), [([[1, 2]], (0, 0)), ([1, 2], (0, 0)), (np.eye(2), 3), (np.eye(2), [[1, 1]])]
)
def test_a_map_of_another_shape_is_refused(matrix: list, offset: list) -> None:
    """Of one row a curve on a line was made."""
    with pytest.raises(ValueError, match=r"a map needs \(2, 2\) and \(2,\)"):
        UNIT_SQUARE.affine(matrix, offset)


@pytest.mark.parametrize("degree", range(1, 7))
def test_circle_meets_the_circle_at_every_sample(degree: int) -> None:
    circle = FreeForm.circle((400, 300), 40, 13, degree)
    t = np.arange(13 * degree) / (13 * degree)
    radii = np.hypot(*(circle.evaluate(t) - (400, 300)).T)
    # V^-1 amplifies the rounding of coordinates near 440 by up to 30
    np.testing.assert_allclose(radii, 40, rtol=0, atol=30 * 440 * 2.2e-16)
    assert circle.control_points.shape == (13 * degree, 2)
    assert circle.signed_area > 0
    np.testing.assert_array_equal(circle.control_points[0], [440, 300])


def test_circle_of_degree_6_has_the_true_area_and_length() -> None:
    disc = circle(0, 0, 40, 6)
    assert disc.signed_area == pytest.approx(math.pi * 1600, rel=1e-10)
    assert disc.length == pytest.approx(math.tau * 40, rel=1e-10)


def test_bounding_box_of_a_cubic_bulge() -> None:
    arch = FreeForm([[0, 0], [0, 4], [4, 4], [4, 0], [3, 0], [1, 0]], 3)
    np.testing.assert_allclose(arch.bounding_box, [[0, 0], [4, 3]], atol=1e-15)
    np.testing.assert_array_equal(arch.control_box, [[0, 0], [4, 4]])


def test_one_patch_and_single_point_contours_are_legal() -> None:
    drop = FreeForm([[0, 0], [3, 1], [1, 3]], 3)
    assert (drop.num_patches, drop.patches.shape) == (1, (1, 4, 2))
    point = FreeForm([[2, 5]], 1)
    assert (point.signed_area, point.length) == (0.0, 0.0)
    np.testing.assert_array_equal(point.bounding_box, [[2, 5], [2, 5]])
    np.testing.assert_array_equal(point.flatten(), [[2, 5]])


@pytest.mark.parametrize(
    ("points", "degree", "words"),
    [
        ([[0, 0], [1, 0], [0, 1], [1, 1]], 3, r"shape \(4, 2\)"),
        (np.zeros((0, 2)), 1, "N >= 1"),
        (np.zeros((3, 3)), 1, r"shape \(3, 3\)"),
        (np.zeros(6), 1, r"shape \(6,\)"),
        ([[0, 0], [math.nan, 0], [0, 1]], 3, "finite"),
        ([[0, 0], [math.inf, 0], [0, 1]], 1, "finite"),
        (np.zeros((7, 2)), 7, "1 to 6"),
    ],
)
def test_the_border_refuses(points: ArrayLike, degree: int, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        FreeForm(points, degree)


@pytest.mark.parametrize(
    ("call", "values", "words"),
    [
        (lambda radius: FreeForm.circle((0, 0), radius, 13, 3), (0.0, -1.0, math.nan), "radius"),
        (lambda samples: FreeForm.circle((0, 0), 1.0, samples, 1), (2,), "samples"),
        (UNIT_SQUARE.evaluate, (-0.1, 1.1, math.nan), r"outside \[0, 1\]"),
        (UNIT_SQUARE.flatten, (0.0, -1.0, math.nan), "positive tolerance"),
        (FreeForm.circle((0, 0), 1, 3, 3).elevated, (2,), "below"),
        (FreeForm.circle((0, 0), 1, 3, 6).elevated, (7,), "1 to 6"),
    ],
)
def test_values_out_of_range_are_refused(call: Callable[..., object], values: tuple[float, ...], words: str) -> None:
    for value in values:
        with pytest.raises(ValueError, match=words):
            call(value)


def test_the_value_owns_read_only_points() -> None:
    points = np.zeros((3, 2))
    contour = FreeForm(points, 3)
    points[0] = 9.0
    assert contour.control_points[0, 0] == 0.0
    sent = pickle.loads(pickle.dumps(contour))  # as between worker processes
    for value in (contour, sent, copy.deepcopy(contour), contour.reversed()):
        with pytest.raises(ValueError, match="read-only"):
            value.control_points[0] = 1.0


def size(points: np.ndarray) -> float:
    return float(np.abs(points).max(initial=1e-300))


@given(own.dyadic_patch(), st.lists(st.integers(0, 1), min_size=1, max_size=3))
def test_halving_is_exact_on_the_dyadic_grid(patch: own.Points, sides: list[int]) -> None:
    piece, twin = patch, naive.exact(patch)
    for side in sides:
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
def test_split_anywhere_keeps_the_curve(patch: own.Points, t: float) -> None:
    bound = 40 * 2e-16 * size(patch)
    left, right = bezier.split(patch, t)
    u = np.array([0.0, 0.3, 1.0])
    for part, place in ((left, t * u), (right, t + (1 - t) * u)):
        np.testing.assert_allclose(bezier.evaluate(part, u), bezier.evaluate(patch, place), rtol=0, atol=bound)


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


SHAPE = (9, 10)


def grid() -> np.ndarray:
    y, x = np.indices(SHAPE)
    return np.stack([x, y], axis=-1)


@given(own.troubled_points(6), st.sampled_from([1e-60, 1.0, 1e60]))
def test_turns_have_the_exact_sign(points: own.Points, scale: float) -> None:
    scaled = points * scale
    triples = np.array(list(permutations(range(6), 3))).T
    signs = signs_of_turns(*scaled[triples])
    for sign, (i, j, k) in zip(signs.tolist(), triples.T.tolist(), strict=True):
        turn = naive.turn(*(naive.exact(scaled)[at] for at in (i, j, k)))
        assert sign == (turn > 0) - (turn < 0)


@given(own.half_grid_polygon())
def test_degree_one_agrees_with_the_exact_polygon(points: own.Points) -> None:
    exact = [naive.exact(points)]
    expected = [[naive.winding(exact, (x, y)) for x in range(SHAPE[1])] for y in range(SHAPE[0])]
    np.testing.assert_array_equal(FreeForm.polygon(points).winding(grid()), expected)


@given(own.troubled_contour(scaled=False), st.sampled_from([4.0, 40.0]))
def test_curves_agree_with_their_fine_flattening_off_the_curve(made: tuple[own.Points, int], scale: float) -> None:
    points, degree = made
    contour = FreeForm(points * scale + 4.0, degree)
    vertices = contour.flatten(1e-3)
    dense = contour.evaluate(np.linspace(0, 1, 5001))
    near = np.hypot(*(dense - grid()[..., None, :]).transpose(3, 0, 1, 2)).min(axis=-1)
    clear = near > 2e-3 + np.hypot(*np.diff(dense, axis=0).T).max()
    found = contour.winding(grid())
    np.testing.assert_array_equal(found[clear], naive.winding_image(vertices, *SHAPE)[clear])


@given(own.troubled_contour(), st.floats(0, 1))
def test_points_on_the_curve_and_far_away_end(made: tuple[own.Points, int], t: float) -> None:
    contour = FreeForm(*made)
    on_curve = contour.evaluate([t, 0.0, 1.0])
    assert np.abs(contour.winding(on_curve)).max() <= contour.num_patches * contour.degree
    low, high = contour.control_box
    outside = [low - (high - low) - 1.0, high + (high - low) + 1.0]
    assert (contour.winding(outside) == 0).all()


def circle(x: float, y: float, radius: float, degree: int = 3) -> FreeForm:
    return FreeForm.circle((x, y), radius, 12, degree)


def test_winding_of_a_circle_close_to_its_curve() -> None:
    ring = circle(0, 0, 10, 6)  # within 1e-9 px of the true circle
    angle = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    assert (ring.winding(unit * (10 - 1e-6)) == 1).all()
    assert (ring.winding(unit * (10 + 1e-6)) == 0).all()
    assert (ring.reversed().winding(unit * 9.9) == -1).all()


def test_winding_keeps_the_shape_of_the_points() -> None:
    ring = circle(0, 0, 10)
    assert (ring.winding([0.0, 0.0]).shape, ring.winding(np.zeros((2, 3, 2))).shape) == ((), (2, 3))
    assert ring.winding(np.zeros((0, 2))).shape == (0,)


def test_winding_on_a_box_is_half_open_like_the_raster() -> None:
    x, y = np.moveaxis(grid(), -1, 0)
    inside = FreeForm.box(0, 0, 4, 3).elevated(3).winding(grid()) == 1
    np.testing.assert_array_equal(inside, (x < 4) & (y < 3))


def test_holes_go_to_the_smallest_outer_round_them() -> None:
    sea, lake, island = circle(50, 50, 40), circle(50, 50, 25).reversed(), circle(50, 50, 15)
    pond, far = circle(50, 50, 5).reversed(), circle(200, 50, 20)
    regions = group_regions([pond, sea, far, lake, island])
    assert [r.outer for r in regions] == [sea, far, island]
    assert ([r.holes for r in regions], regions[0].contours) == ([(lake,), (), (pond,)], (sea, lake))
    assert regions[0].area == sea.signed_area + lake.signed_area


def test_lost_and_empty_contours_are_dropped() -> None:
    stray = circle(0, 0, 5).reversed()
    flat = FreeForm.polygon([(0, 0), (5, 0)])
    assert (group_regions([stray, flat]), group_regions([])) == ((), ())


def test_a_hole_that_touches_its_outer_stays_with_it() -> None:
    outer, hole = FreeForm.box(0, 0, 10, 10), FreeForm.box(0, 0, 5, 5).reversed()
    edge = FreeForm.box(-1e-9, 2, 4, 6).reversed()
    (region,) = group_regions([hole, outer, edge])
    assert region.holes == (hole, edge)


def test_holes_of_different_degrees_are_asked_at_their_own_points() -> None:
    rng = np.random.default_rng(5)
    middles = [(x, y) for x in (40, 120, 200) for y in (40, 120)]
    holes = [
        (FreeForm.circle(rng.uniform(-9, 9, 2) + middle, 8, 7 + degree, degree).reversed(), middle)
        for middle in middles
        for degree in range(1, 7)
    ]
    mixed = [holes[index] for index in rng.permutation(len(holes))]
    regions = group_regions([*(hole for hole, _ in mixed), *(circle(*middle, 30) for middle in middles)])
    for middle, region in zip(middles, regions, strict=True):
        assert region.holes == tuple(hole for hole, near in mixed if near == middle)


def test_contours_that_run_the_wrong_way_are_turned() -> None:
    outer, hole, island = circle(50, 50, 40), circle(50, 50, 20).reversed(), circle(50, 50, 5)
    right = (outer, hole, island, circle(150, 50, 10))
    assert oriented(right) == right  # the very same
    for wrong in ([contour.reversed() for contour in right], [*right[:3], right[3].reversed()]):
        found = oriented(wrong)
        assert np.sign([contour.signed_area for contour in found]).tolist() == [1, -1, 1, 1]
        for one, other in zip(found, right, strict=True):
            np.testing.assert_array_equal(np.sort(one.control_points, axis=0), np.sort(other.control_points, axis=0))
    assert oriented([]) == ()
    flat = FreeForm.polygon([(0, 0), (5, 0)])
    assert oriented([flat]) == (flat,)


SQUARE = FreeForm.box(0, 0, 10, 10)
CROSSING = {
    "bow tie": [FreeForm.polygon([(0, 0), (10, 10), (10, 0), (0, 10)])],
    "lens": [FreeForm.circle((0, 0), 10, 16, 3), FreeForm.circle((12, 0), 10, 16, 3)],
    "inside twice": [SQUARE, FreeForm.box(2, 2, 8, 8)],
    "loop of a patch": [FreeForm([[0, 0], [8, 6], [-7, 6], [1, 0], [1, -3], [0, -3]], 3)],
    "hole across its outer": [SQUARE, FreeForm.box(5, 2, 15, 8).reversed()],
    "holes across each other": [SQUARE, FreeForm.box(1, 1, 6, 6).reversed(), FreeForm.box(4, 4, 9, 9).reversed()],
    "just deep enough": [SQUARE, FreeForm.box(9.985, 2, 20, 8)],
}
CLEAR = {
    "side by side": [SQUARE, FreeForm.box(10, 3, 20, 6)],
    "corner to corner": [SQUARE, FreeForm.box(10, 10, 20, 20)],
    "vertex on an edge": [SQUARE, FreeForm.polygon([(10, 5), (20, 0), (20, 10)])],
    "hole and island": [SQUARE, FreeForm.box(2, 2, 8, 8).reversed(), FreeForm.box(4, 4, 6, 6)],
    "hole that touches": [SQUARE, FreeForm.box(2, 2, 10, 8).reversed()],
    "spike": [FreeForm.polygon([(0, 0), (5, 5), (10, 0), (5, 5), (5, 10)])],
    "hole alone": [SQUARE.reversed()],
    "too thin": [SQUARE, FreeForm.box(9.996, 2, 20, 8)],
    "point": [FreeForm(np.ones((6, 2)), 3), FreeForm.polygon([(1, 1)]), SQUARE],
    "nothing": [],
}


@pytest.mark.parametrize("contours", CROSSING.values(), ids=CROSSING)
def test_crossings_are_seen(contours: list[FreeForm]) -> None:
    assert self_intersections(contours) != []


@pytest.mark.parametrize("contours", CLEAR.values(), ids=CLEAR)
def test_touching_running_along_and_nesting_are_none(contours: list[FreeForm]) -> None:
    assert self_intersections(contours) == []
