"""The snake against its dense-matrix twin."""

import naive_snake as naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ffseg.native import _core

NO_POINTS = np.empty((0, 4))


@given(
    count=st.integers(5, 60),
    tension=st.floats(0, 1000),
    rigidity=st.floats(0, 1000),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_snake_without_forces_solves_its_system_as_a_dense_one(
    count: int, tension: float, rigidity: float, seed: int
) -> None:
    right = np.random.default_rng(seed).uniform(0, 60, (count, 2))
    matrix = naive.internal_matrix(count, tension, rigidity)
    options = _core.SnakeOptions()
    options.tension, options.rigidity, options.max_iterations, options.spacing = tension, rigidity, 1, 6.0
    plain = np.zeros((61, 61), np.uint8)
    snake = _core.Snake(right, plain.astype(np.uint16), plain, None, NO_POINTS, 0.08, options)
    assert snake.advance(1)
    found = snake.points()
    # Both are exact up to rounding times the condition number, which is at most 1 + 4 tension + 16 rigidity.
    condition = 1 + 4 * tension + 16 * rigidity
    assert np.abs(found - np.linalg.solve(matrix, right)).max() <= 1e-15 * 20 * condition * np.abs(right).max()


@pytest.mark.parametrize("seed", range(30))
def test_the_snake_moves_as_the_dense_one(seed: int) -> None:
    rng = np.random.default_rng([seed, 21])
    shape = (int(rng.integers(40, 70)), int(rng.integers(40, 70)))
    gradient, edges = ring_edge(rng, shape)
    domain = rng.random(shape) < (0.98 if seed % 3 == 0 else 2.0)
    altitudes = [(*rng.uniform(5, 60, 2), rng.choice([0.0, 0.5]), rng.uniform(2, 9)) for _ in range(seed % 4)]
    options = options_of(rng, shrinking=seed % 5 == 4)
    angle = np.arange(20) * (2 * np.pi / 20)
    radius = 0.45 * min(shape) if options.balloon < 0 else 6.0
    center = np.array(shape[::-1]) / 2 + rng.uniform(-2, 2, 2)
    start = center + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rows = np.array(altitudes).reshape(-1, 4)
    snake = _core.Snake(start, gradient, edges, domain.view(np.uint8), rows, 0.08, options)
    twin = naive.Snake(
        start,
        gradient.astype(float),
        naive.zones(edges, altitudes, 0.08),
        domain,
        options.tension,
        options.rigidity,
        options.balloon,
        options.attraction,
        options.spacing,
    )
    for _ in range(30):
        if not snake.advance(1):
            break
        twin.step()
        points = snake.points()
        assert points.shape == twin.points.shape
        # The solvers differ by rounding, which thirty steps along contracting forces do not multiply by 10^6.
        assert np.abs(points - twin.points).max() <= 1e-9


def options_of(rng: np.random.Generator, shrinking: bool) -> _core.SnakeOptions:
    options = _core.SnakeOptions()
    options.tension, options.rigidity = rng.uniform(0, 0.3, 2)
    options.balloon = rng.uniform(0.4, 3.0) * (-1 if shrinking else 1)
    options.attraction = rng.uniform(0, 4)
    options.spacing = rng.uniform(3, 9)
    options.tolerance, options.refine, options.max_iterations = 0.05, True, 2000
    return options


def ring_edge(rng: np.random.Generator, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """A wavy closed edge with noise on its gradient, and its thin edge pixels with a few gaps."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    angle = np.arctan2(y - shape[0] / 2, x - shape[1] / 2)
    boundary = 0.3 * min(shape) * (1 + 0.2 * np.cos(3 * angle + rng.uniform(0, 6)))
    distance = np.hypot(y - shape[0] / 2, x - shape[1] / 2) - boundary
    ridge = 900 * np.exp(-0.5 * (distance / 1.7) ** 2) + rng.uniform(0, 30, shape)
    edges = (np.abs(distance) < 0.6) & (rng.random(shape) < 0.97)
    return np.rint(ridge).astype(np.uint16), edges.astype(np.uint8) * np.uint8(255)
