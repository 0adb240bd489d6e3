"""What lies under the joints of a contour, against the same said naively."""

import numpy as np
import pytest

from ffseg.native import _core

MARGIN, SHAPE = 3, (30, 40)


def naive_within(x: float, y: float, domain: np.ndarray | None) -> bool:
    height, width = SHAPE
    if not (MARGIN <= x <= width - 1 - MARGIN and MARGIN <= y <= height - 1 - MARGIN):
        return True
    near = [(round(y + dy), round(x + dx)) for dy in (-MARGIN, 0, MARGIN) for dx in (-MARGIN, 0, MARGIN)]
    return domain is not None and any(domain[at] == 0 for at in near)


@pytest.fixture
def joints() -> np.ndarray:
    return np.random.default_rng(2).uniform(-4, 44, (300, 2))


@pytest.mark.parametrize("bounded", [False, True])
def test_gradients_under_joints_and_the_share_at_the_border(joints: np.ndarray, bounded: bool) -> None:
    rng = np.random.default_rng(3)
    gradient = rng.integers(0, 9000, SHAPE).astype(np.uint16)
    domain = (rng.random(SHAPE) < 0.97).astype(np.uint8) if bounded else None
    at = [(round(x), round(y)) for x, y in joints]
    expected = [gradient[y - 1 : y + 2, x - 1 : x + 2].max() for x, y in at if not naive_within(x, y, domain)]
    assert _core.gradients_at(joints, gradient, domain, MARGIN).tolist() == expected != []
    near = [naive_within(x, y, domain) for x, y in joints]
    along = whole = 0.0
    for begin, end in ((0, 7), (7, 300)):
        for i in range(begin, end):
            k = i + 1 if i + 1 < end else begin
            length = float(np.hypot(*(joints[k] - joints[i])))
            whole, along = whole + length, along + length * (near[i] and near[k])
    share = _core.share_within(joints, np.array([0, 7, 300]), SHAPE, domain, MARGIN)
    assert share == pytest.approx(along / whole, rel=1e-12)
    assert _core.share_within(np.empty((0, 2)), np.array([0]), SHAPE, domain, MARGIN) == 0.0


def test_what_does_not_fit_is_refused() -> None:
    points, plane = np.zeros((2, 2)), np.zeros(SHAPE, np.uint16)
    with pytest.raises(ValueError, match="margin"):
        _core.gradients_at(points, plane, None, 0)
    with pytest.raises(ValueError, match="differ in size"):
        _core.gradients_at(points, plane, np.ones((2, 2), np.uint8), 3)
