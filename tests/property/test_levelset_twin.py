"""Fast marching and the climb of edges against their naive twins."""

import naive_baselines as naive
import numpy as np
import pytest
from numpy.typing import NDArray

from ffseg.geometry.freeform import FreeForm
from ffseg.image.edges import EdgeMap
from ffseg.image.raster import rasterize
from ffseg.methods import levelset
from ffseg.native import _core
from ffseg.parameters import load_params
from ffseg.scene import Scene

TIME_TOLERANCE = 1e-9
"""The twins do the same sums in another order of terms: a few units in the last place of times up to 1e4."""


def speed_map(seed: int) -> NDArray[np.float64]:
    """A random speed map: smooth, rough, two-valued with many ties, with slow walls, or over many decades."""
    rng = np.random.default_rng([seed, 12])
    shape = (int(rng.integers(1, 28)), int(rng.integers(1, 28)))
    kind = seed % 5
    if kind == 0:
        y, x = np.mgrid[: shape[0], : shape[1]]
        return 0.55 + 0.4 * np.sin(x / 3.0 + rng.uniform(0, 6)) * np.cos(y / 4.0)
    if kind == 1:
        return rng.uniform(0.0, 1.0, shape)
    if kind == 2:
        return np.where(rng.random(shape) < 0.2, 0.25, 1.0)
    if kind == 3:
        return np.where(rng.random(shape) < 0.3, 0.0, 1.0)
    return 10.0 ** rng.uniform(-6, 3, shape) if seed % 2 else 10.0 ** rng.uniform(-12, 3, shape)


@pytest.mark.parametrize("block", range(4))
def test_march_accepts_as_the_naive_heap_does(block: int) -> None:
    for seed in range(50 * block, 50 * block + 50):
        speed = speed_map(seed)
        rng = np.random.default_rng([seed, 13])
        inside = rng.random(speed.shape) < rng.choice([0.02, 0.3])
        inside.flat[rng.integers(inside.size)] = True
        domain = rng.random(speed.shape) < rng.choice([0.85, 2.0])
        stop = float(rng.choice([0.0, 0.05]))
        times, order, on_contour = naive.fast_march(speed, stop, inside, domain)
        found_times, found_order, found_contour, initial = _core.fast_march(
            speed, stop, inside.view(np.uint8), domain.view(np.uint8)
        )
        expected = np.full(speed.shape, np.inf)
        for node, time in times.items():
            expected[node] = time
        assert found_order.tolist() == [y * speed.shape[1] + x for y, x in order], seed
        assert sorted(found_contour.tolist()) == sorted(y * speed.shape[1] + x for y, x in on_contour), seed
        finite = np.isfinite(expected)
        assert (np.isfinite(found_times.reshape(speed.shape)) == finite).all(), seed
        gap = np.abs(found_times.reshape(speed.shape)[finite] - expected[finite])
        assert gap.max(initial=0.0) <= TIME_TOLERANCE * max(1.0, expected[finite].max(initial=0.0)), seed
        assert initial <= len(order), seed


@pytest.mark.parametrize("seed", range(40))
def test_mask_is_the_climbed_region(seed: int) -> None:
    rng = np.random.default_rng([seed, 14])
    shape = (int(rng.integers(12, 40)), int(rng.integers(12, 40)))
    gradient = smooth_gradient(rng, shape)
    settle, low = int(rng.integers(0, 5)), 32 * 4
    start = FreeForm.circle((shape[1] // 2, shape[0] // 2), 2.4, 8, 1)
    inside = rasterize((start,), shape)
    edge_map = EdgeMap(gradient, np.zeros(shape, np.uint8), None, (2.0, low / 32))
    params = load_params(None, {"levelset.settle": settle, "levelset.min_area": 0.0})
    outcome = levelset.run(Scene(np.empty(shape, np.uint8), params, edges=edge_map, starts=(start,)))
    speed = np.where(gradient >= low, 0.0, 1.0 / (1.0 + (gradient / 32.0) ** 2))
    times, order, on_contour = naive.fast_march(speed, 0.0, inside, np.ones(shape, bool))
    region = naive.climb(set(times), gradient.astype(np.int64), on_contour, low, settle)
    expected = np.zeros(shape, bool)
    for node in region:
        expected[node] = True
    assert outcome.contours is not None
    assert (rasterize(outcome.contours, shape) == expected).all()
    assert (outcome.stats.iterations, outcome.stats.final_points) == (len(order), len(on_contour))


def smooth_gradient(rng: np.random.Generator, shape: tuple[int, int]) -> NDArray[np.uint16]:
    """Ridges of a few pixels' width with noise on them."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    distance = np.hypot(x - shape[1] // 2, y - shape[0] // 2) - rng.uniform(6, 11)
    ridge = 40.0 * np.exp(-0.5 * (distance / 1.5) ** 2) * (rng.random(shape) < 0.97)
    return np.rint(32.0 * np.clip(ridge + rng.normal(0, 0.8, shape), 0, 500)).astype(np.uint16)
