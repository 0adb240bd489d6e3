"""Repairs of the free form's curves: uneven samples, gaps in diagonal edges, folds and crossings of settled contours."""

from math import pi

import numpy as np
import pytest

from ffseg.geometry.freeform import FreeForm
from tests.crossings import self_intersections
from tests.evolutions import SHAPE, areas, contours, evolution


def test_samples_that_have_drawn_together_near_edges_are_laid_out_evenly() -> None:
    angles = np.concatenate([[i, i + 0.06, i + 0.12] for i in range(12)]) * 2 * pi / 12
    start = FreeForm.from_samples(np.stack([90 + 20 * np.cos(angles), 70 + 20 * np.sin(angles)], axis=1), 3)
    edges = np.zeros(SHAPE, np.uint8)
    turn = np.linspace(0, 2 * pi, 1000)
    edges[np.rint(70 + 28 * np.sin(turn)).astype(int), np.rint(90 + 28 * np.cos(turn)).astype(int)] = 255
    made = evolution([start], edges, refine=True, balloon=0.5)
    made.advance(1)
    (after,) = contours(made)
    assert after.num_patches == 12
    samples = after.evaluate(np.arange(37) / 36)
    steps = np.hypot(*np.diff(samples, axis=0).T).reshape(12, 3)
    assert (steps.max(axis=1) < 2 * steps.min(axis=1)).all()  # 15 times before; three times is let be


def test_a_curve_does_not_pass_between_two_pixels_of_a_diagonal_edge() -> None:
    """An edge that goes on diagonally is closed there: samples whose curve would lie across it stay where they are."""
    edges = np.zeros(SHAPE, np.uint8)
    edges[[60, 61], [100, 101]] = 255
    along, across = np.array([1.0, -1.0]) / np.sqrt(2), np.array([1.0, 1.0]) / np.sqrt(2)
    # After the move the side runs between the two pixels; no place looked at lies on their common corner.
    middle = np.array([100.5, 60.5]) + 0.3 * across + 0.2 * along
    corners = np.array([middle + 30 * (u * along) + 60 * v * across for u, v in ((-1, 0), (1, 0), (1, 1), (-1, 1))])
    steps = np.linspace(0, 1, 4)[:-1, None]
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    start = FreeForm(np.concatenate([a + steps * (b - a) for a, b in sides]), 3)
    made = evolution([start], edges, balloon=0.3)
    made.advance(1)
    places = np.arange(12) / 12
    moved = np.hypot(*(contours(made)[0].evaluate(places) - start.evaluate(places)).T)
    assert moved[[1, 2]] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert moved[4:12] == pytest.approx([0.3] * 8, abs=1e-6)


def test_displacements_that_cross_do_not_turn_the_contour_round() -> None:
    """A small hole whose samples would all run through its middle to a line beside it."""
    x = np.arange(SHAPE[1], dtype=float)
    gradient = np.tile(np.rint(640 * np.exp(-0.5 * ((x - 91.5) / 4) ** 2)).astype(np.uint16), (SHAPE[0], 1))
    start = FreeForm.circle((90, 70), 3, 8, 3)
    hole = FreeForm(start.control_points[::-1].copy(), 3)
    made = evolution([hole], settle=6.0, topology=False)
    before = np.diff(hole.evaluate(np.arange(25) / 24), axis=0)
    made.settle(gradient)
    after = np.diff(contours(made)[0].evaluate(np.arange(25) / 24), axis=0)
    assert ((before * after).sum(axis=1) > 0).all()


def test_contours_that_overlap_a_little_once_settled_are_drawn_apart() -> None:
    starts = [FreeForm.circle((60, 70), 20, 20, 3), FreeForm.circle((99.2, 70), 20, 20, 3)]
    made = evolution(starts)
    made.settle(np.zeros(SHAPE, np.uint16))
    assert self_intersections(contours(made)) == []
    assert areas(made) == pytest.approx([pi * 20**2] * 2, rel=0.02)
