"""The test's own look for crossings: what counts as one, and what does not."""

import numpy as np
import pytest

from ffseg.geometry.freeform import FreeForm
from tests.crossings import self_intersections

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
