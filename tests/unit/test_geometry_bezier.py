"""Bernstein basis, interpolation, splitting: analytic values."""

import numpy as np
import pytest

from ffseg.geometry import bezier
from tests import naive

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
    assert bezier.chord_count(parabola, 0.5 / 100) == 10
    assert bezier.chord_count(parabola, 0.4999 / 100) == 11


def test_evaluate_broadcasts_over_stacks() -> None:
    patch = np.arange(24.0).reshape(3, 4, 2)
    assert bezier.evaluate(patch, 0.5).shape == (3, 2)
    assert bezier.evaluate(patch[:, None], np.zeros(5)).shape == (3, 5, 2)
    assert bezier.evaluate(patch[0], np.zeros((2, 5))).shape == (2, 5, 2)
