"""Winding numbers of curves against exact polygons and fine flattenings."""

from itertools import permutations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.orientation import signs_of_turns
from tests import naive
from tests import strategies as own

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
