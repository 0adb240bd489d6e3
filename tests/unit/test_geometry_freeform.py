"""The contour value: analytic values and its border."""

import copy
import math
import pickle

import numpy as np
import pytest
from numpy.typing import ArrayLike

from ffseg.geometry.freeform import FreeForm

UNIT_SQUARE = FreeForm.box(0, 0, 1, 1)


def test_box_has_positive_area_and_reversal_changes_the_sign() -> None:
    assert UNIT_SQUARE.signed_area == 1.0
    assert UNIT_SQUARE.reversed().signed_area == -1.0
    np.testing.assert_array_equal(UNIT_SQUARE.reversed().control_points[0], UNIT_SQUARE.control_points[0])
    assert FreeForm.box(5, 7, 2, 3).signed_area == 12.0


def test_area_of_parabola_segment_is_two_thirds() -> None:
    segment = FreeForm([[0, 0], [1, 2], [2, 0], [1, 0]], 2)  # the chord back is a straight patch
    assert segment.signed_area == -4.0 / 3.0


def test_area_far_away_keeps_its_digits() -> None:
    near = FreeForm.circle((0, 0), 1.0, 8, 3)
    shift = 2.0**30
    far = near.affine(np.eye(2), (shift, -shift))
    snapped = far.affine(np.eye(2), (-shift, shift))
    assert far.signed_area == pytest.approx(snapped.signed_area, rel=1e-15)


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


def test_circle_area_and_length_approach_the_true_ones_with_the_degree() -> None:
    circle = FreeForm.circle((0, 0), 40, 13, 6)
    assert circle.signed_area == pytest.approx(math.pi * 1600, rel=1e-10)
    assert circle.length == pytest.approx(math.tau * 40, rel=1e-10)


def test_bounding_box_of_a_cubic_bulge() -> None:
    arch = FreeForm([[0, 0], [0, 4], [4, 4], [4, 0], [3, 0], [1, 0]], 3)
    np.testing.assert_allclose(arch.bounding_box, [[0, 0], [4, 3]], atol=1e-15)
    np.testing.assert_array_equal(arch.control_box, [[0, 0], [4, 4]])


def test_bounding_box_of_a_loop_inside_one_patch() -> None:
    loop = FreeForm([[0, 0], [8, 6], [-7, 6]], 3)
    t = np.linspace(0, 1, 100_001)
    dense = loop.evaluate(t)
    np.testing.assert_allclose(loop.bounding_box, [dense.min(axis=0), dense.max(axis=0)], atol=1e-8)


def test_one_patch_and_single_point_contours_are_legal() -> None:
    drop = FreeForm([[0, 0], [3, 1], [1, 3]], 3)
    assert drop.num_patches == 1
    assert drop.patches.shape == (1, 4, 2)
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


@pytest.mark.parametrize("bad", [(0.0, 13, 3), (-1.0, 13, 3), (math.nan, 13, 3), (1.0, 2, 1)])
def test_circle_refuses(bad: tuple[float, int, int]) -> None:
    with pytest.raises(ValueError, match=r"radius|samples"):
        FreeForm.circle((0, 0), *bad)


def test_evaluate_refuses_parameters_outside() -> None:
    for t in (-0.1, 1.1, math.nan):
        with pytest.raises(ValueError, match=r"outside \[0, 1\]"):
            UNIT_SQUARE.evaluate(t)


def test_flatten_refuses_a_tolerance_that_is_not_positive() -> None:
    for tolerance in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="positive tolerance"):
            UNIT_SQUARE.flatten(tolerance)


def test_the_value_owns_read_only_points() -> None:
    points = np.zeros((3, 2))
    contour = FreeForm(points, 3)
    points[0] = 9.0
    assert contour.control_points[0, 0] == 0.0
    sent = pickle.loads(pickle.dumps(contour))  # as between worker processes
    for value in (contour, sent, copy.deepcopy(contour), contour.reversed()):
        with pytest.raises(ValueError, match="read-only"):
            value.control_points[0] = 1.0


def test_elevation_refuses_to_go_down_or_beyond_six() -> None:
    with pytest.raises(ValueError, match="below"):
        FreeForm.circle((0, 0), 1, 3, 3).elevated(2)
    with pytest.raises(ValueError, match="1 to 6"):
        FreeForm.circle((0, 0), 1, 3, 6).elevated()
