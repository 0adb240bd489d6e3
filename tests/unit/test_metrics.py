"""Overlap and boundary distances on cases that can be counted by hand."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from ffseg import metrics
from ffseg.native import _core


def truth_of(mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
    return mask.astype(np.uint8) * np.uint8(255)


def box(x0: int, y0: int, x1: int, y1: int, shape: tuple[int, int] = (40, 50)) -> NDArray[np.bool_]:
    mask = np.zeros(shape, bool)
    mask[y0:y1, x0:x1] = True
    return mask


def test_equal_regions() -> None:
    mask = box(10, 10, 30, 25)
    assert metrics.scores(mask, truth_of(mask)) == metrics.Scores(1.0, 0.0, 0.0, 1.0)


def test_a_shifted_box() -> None:
    found = metrics.scores(box(13, 10, 33, 25), truth_of(box(10, 10, 30, 25)))
    assert found.iou == pytest.approx(17 * 15 / (23 * 15))
    # Of the 70 sides 30 are upright and 3 px off (their ends nearer to the other's level sides); 40 are level, of
    # which 34 coincide and 6 lie 1, 2 and 3 px beyond the other's corner, less where an upright side is nearer.
    assert found.boundary_max == pytest.approx(3.0)
    assert 3.0 * 30 / 70 * 0.8 < found.boundary_mean < 3.0 * 36 / 70


def test_a_grown_box_lies_a_pixel_off() -> None:
    found = metrics.scores(box(9, 9, 31, 26), truth_of(box(10, 10, 30, 25)))
    # Of the 78 sides of the grown box all but the two at each corner lie opposite a side of the truth.
    assert found.boundary_max == pytest.approx(math.sqrt(2))
    assert found.boundary_mean == pytest.approx(((70 + 8 * math.sqrt(2)) / 78 + 1) / 2)
    assert found.boundary_f == 1.0


def test_boundary_f_counts_what_is_within_two_pixels() -> None:
    truth = box(10, 10, 30, 25)
    found = metrics.scores(truth | box(40, 30, 44, 34), truth_of(truth))
    # 70 sides found right, 16 of the stray box wrong; all 70 of the truth are found.
    assert found.boundary_f == pytest.approx(2 * (70 / 86) / (70 / 86 + 1))


def test_ignored_pixels_do_not_count() -> None:
    truth = truth_of(box(10, 10, 30, 25))
    truth[:, 30:] = metrics.IGNORED
    found = metrics.scores(box(10, 10, 45, 25), truth)
    assert (found.iou, found.boundary_max, found.boundary_f) == (1.0, 0.0, 1.0)
    assert metrics.scores(box(10, 10, 45, 25), truth_of(box(10, 10, 30, 25))).iou < 0.6


def test_a_truth_whose_boundary_is_ignored_tells_no_distance() -> None:
    truth = truth_of(box(10, 10, 30, 25))
    truth[box(8, 8, 32, 27) & ~box(11, 11, 29, 24)] = metrics.IGNORED
    for region in (box(10, 10, 30, 25), box(5, 5, 35, 30)):
        found = metrics.scores(region, truth)
        assert [math.isnan(one) for one in (found.boundary_mean, found.boundary_max, found.boundary_f)] == [True] * 3


def test_the_image_border_is_no_boundary() -> None:
    assert len(metrics.boundary(np.ones((5, 7), bool), np.ones((5, 7), bool))) == 0


def test_empty_regions() -> None:
    none, some = np.zeros((40, 50), bool), box(10, 10, 30, 25)
    assert metrics.scores(none, truth_of(~none)).boundary_f == 0.0
    for same in (none, ~none):
        assert (metrics.scores(same, truth_of(same)).iou, metrics.scores(same, truth_of(same)).boundary_f) == (1.0, 1.0)
    found = metrics.scores(none, truth_of(some))
    assert (found.iou, found.boundary_f) == (0.0, 0.0)
    assert math.isnan(found.boundary_mean)
    assert math.isnan(found.boundary_max)


def test_sizes_must_agree() -> None:
    with pytest.raises(ValueError, match="shape"):
        metrics.scores(np.zeros((3, 4), bool), np.zeros((4, 3), np.uint8))


@pytest.mark.parametrize("seed", range(20))
def test_nearest_distances_are_those_of_all_pairs(seed: int) -> None:
    rng = np.random.default_rng([seed, 31])
    scale, shift = rng.choice([0.01, 1.0, 300.0, 1e6]), rng.choice([0.0, 500.0])
    points = rng.normal(0, scale, (int(rng.integers(0, 60)), 2)) + shift
    others = rng.normal(0, scale * rng.choice([0.1, 1, 10]), (int(rng.integers(1, 60)), 2))
    expected = np.sqrt(((points[:, None] - others[None]) ** 2).sum(axis=2)).min(axis=1) if len(points) else []
    assert _core.nearest_distances(points, others) == pytest.approx(np.asarray(expected), rel=1e-14)


def test_nearest_distances_without_others_are_infinite() -> None:
    assert np.isinf(_core.nearest_distances(np.zeros((2, 2)), np.empty((0, 2)))).all()
    with pytest.raises(ValueError, match="finite"):
        _core.nearest_distances(np.array([[np.nan, 0.0]]), np.zeros((1, 2)))
