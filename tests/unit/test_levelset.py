"""The fast-marching level set on analytic cases, and against its naive twin."""

from functools import partial

import naive_baselines as naive
import numpy as np
import pytest
from numpy.typing import NDArray

import ffseg
from ffseg.geometry.freeform import FreeForm
from ffseg.image.edges import EdgeMap
from ffseg.image.raster import rasterize
from ffseg.methods import levelset
from ffseg.native import _core
from ffseg.parameter_files import load_params
from ffseg.parameters import Parameters
from ffseg.scene import Scene
from tests.discs import bright_disc, edges_of

SHAPE = (120, 160)
disc_image = partial(bright_disc, SHAPE)


def evolved(edges: EdgeMap, starts: tuple[FreeForm, ...], params: Parameters, **more: object) -> tuple:
    outcome = levelset.run(Scene(np.empty(SHAPE, np.uint8), params, edges=edges, starts=starts, **more))
    return outcome.contours, outcome.stats


def circle(center: tuple[float, float], radius: float) -> FreeForm:
    return FreeForm.circle(center, radius, 13, 3)


def test_constant_speed_gives_the_distance() -> None:
    inside = np.zeros((121, 121), np.uint8)
    inside[60, 60] = 1
    times, order, _, initial = _core.fast_march(np.full(inside.shape, 0.5), 0.0, inside, None)
    y, x = np.mgrid[:121, :121]
    distance = np.hypot(x - 60, y - 60)
    # First-order upwind from a point source: the error grows like h log(distance / h), about 1 px at 80 px, and the
    # scheme never runs ahead of the distance. Along the axes it is exact.
    late = times.reshape(inside.shape) * 0.5 - distance
    assert late.min() >= -1e-9
    assert late.max() <= 1.7
    assert np.abs(late[60]).max() <= 1e-9
    assert (len(order), initial) == (121 * 121 - 1, 4)


def test_outline_lies_on_the_edge_to_sub_pixels() -> None:
    (outline,), stats = evolved(edges_of(disc_image((80.2, 59.7), 45.4)), (circle((80, 60), 12),), Parameters())
    radius = np.hypot(*(outline.control_points - (80.2, 59.7)).T)
    # The gradient of a blurred disc peaks inside its edge by sigma^2 / (2 radius) = 0.025 px. Where the ridge runs
    # along a grid line, the crossing is taken at the nearer node instead.
    assert np.abs(radius - 45.4).max() <= 0.25
    assert abs(radius.mean() - 45.4) <= 0.05
    assert outline.signed_area == pytest.approx(np.pi * 45.4**2, rel=0.003)
    assert (stats.stop_reason, stats.iterations > 4000) == ("converged", True)


def test_without_settling_the_front_stands_before_the_edge() -> None:
    params = load_params(None, {"levelset.settle": 0})
    (outline,), stats = evolved(edges_of(disc_image((80, 60), 45)), (circle((80, 60), 12),), params)
    radius = np.hypot(*(outline.control_points - (80, 60)).T)
    assert 39 < radius.min() <= radius.max() < 44
    assert stats.final_points > 200


def test_holes_have_negative_area() -> None:
    image = disc_image((80, 60), 50)
    image[55:66, 95:108] = 60
    contours, _ = evolved(edges_of(image), (circle((70, 60), 8),), Parameters())
    areas = sorted(c.signed_area for c in contours)
    assert len(areas) == 2
    assert areas[0] == pytest.approx(-11 * 13, rel=0.1)
    assert areas[1] == pytest.approx(np.pi * 50**2, rel=0.01)


def test_two_fronts_merge_into_one() -> None:
    edges = edges_of(disc_image((80, 60), 50))
    one, _ = evolved(edges, (circle((80, 60), 8),), Parameters())
    two, _ = evolved(edges, (circle((60, 60), 8), circle((100, 60), 8)), Parameters())
    assert [c.control_points.tolist() for c in one] == [c.control_points.tolist() for c in two]


def test_a_negative_balloon_closes_in() -> None:
    edges = edges_of(disc_image((80.2, 59.7), 30.4))
    params = load_params(None, {"contour.balloon": -2.0})
    contours, _ = evolved(edges, (circle((80, 60), 55),), params)
    assert len(contours) == 1
    assert contours[0].signed_area == pytest.approx(np.pi * 30.4**2, rel=0.005)
    grown, _ = evolved(edges, (circle((80, 60), 12),), Parameters())
    assert (rasterize(contours, SHAPE) ^ rasterize(grown, SHAPE)).sum() <= 12  # of 2900: centres on the ridge itself


def test_closing_in_keeps_what_touches_the_image_border() -> None:
    image = np.full(SHAPE, 60, np.uint8)
    image[40:80, 100:] = 180
    params = load_params(None, {"contour.balloon": -2.0})
    contours, _ = evolved(edges_of(image), (FreeForm.box(60, 10, 170, 110),), params)
    mask = rasterize(contours, SHAPE)
    assert mask[45:75, 105:].all()
    assert (~mask[:35]).all()
    assert sum(c.signed_area for c in contours) == pytest.approx(40 * 60, rel=0.02)


def test_closing_in_ends_half_way_beyond_a_border_that_is_an_edge() -> None:
    rng = np.random.default_rng(4)
    inside, gradient = np.zeros((6, 8), np.uint8), np.zeros((6, 8), np.uint16)
    inside[:, :2] = 1
    gradient[:, 5:] = np.array([900, 600, 300]) + rng.integers(0, 90, (6, 3))  # on an edge, and so is the ring beyond
    options = _core.LevelSetOptions()
    options.stop, options.reach, options.closing_in = 100, 4, True  # the front climbs one column
    slowness = np.where(np.arange(65536) < options.stop, 1.0, np.inf)
    points, offsets, _ = _core.level_set(gradient, slowness, inside, None, options)
    x = points.reshape(-1, 2)[:, 0]
    assert (offsets.tolist(), set(x[x > 7].tolist())) == ([0, len(x)], {7.5})
    assert np.count_nonzero(x == 7.5) == 6


def test_the_front_does_not_jump_a_wall_of_the_domain_at_the_rim_of_its_start() -> None:
    domain = np.full(SHAPE, 255, np.uint8)
    domain[:, 89:92] = 0
    edges = edges_of(np.full(SHAPE, 90, np.uint8), domain)
    contours, _ = evolved(edges, (circle((80, 60), 12),), Parameters())
    assert (rasterize(contours, SHAPE) == (np.indices(SHAPE)[1] < 89)).all()


def test_the_front_stays_inside_the_domain() -> None:
    domain = np.zeros(SHAPE, np.uint8)
    domain[20:100, 40:120] = 255
    edges = edges_of(np.full(SHAPE, 90, np.uint8), domain)
    contours, _ = evolved(edges, (circle((80, 60), 12),), Parameters())
    assert (rasterize(contours, SHAPE) == (domain > 0)).all()


def test_without_edges_the_region_is_the_image() -> None:
    contours, _ = evolved(edges_of(np.full(SHAPE, 90, np.uint8)), (circle((80, 60), 12),), Parameters())
    assert rasterize(contours, SHAPE).all()
    assert [c.signed_area for c in contours] == [pytest.approx(SHAPE[0] * SHAPE[1], abs=1.0)]  # corners are cut


def test_a_stop_speed_can_be_set() -> None:
    edges = edges_of(disc_image((80, 60), 45))
    # The edge of 120 grey levels at sigma 1.5 peaks near 30 grey levels per pixel, where F_diff is about 1e-3.
    leaky = load_params(None, {"levelset.stop_speed": 1e-4})
    tight = load_params(None, {"levelset.stop_speed": 1e-2})
    assert rasterize(evolved(edges, (circle((80, 60), 12),), leaky)[0], SHAPE).all()
    assert not rasterize(evolved(edges, (circle((80, 60), 12),), tight)[0], SHAPE)[0, 0]


@pytest.mark.parametrize(
    ("speed", "message"),
    [(np.full((3, 3), np.nan), "speed"), (np.full((3, 3), -1.0), "speed"), (np.ones((2, 3)), "size")],
)
def test_the_core_refuses_bad_arrays(speed: NDArray[np.float64], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        _core.fast_march(speed, 0.0, np.ones((3, 3), np.uint8), None)


@pytest.mark.parametrize(("side", "doubt"), [(1, "empty"), (3, "filled")])
def test_a_start_that_covers_a_tiny_image_leaves_nothing_to_enter(side: int, doubt: str) -> None:
    """It was said to lie on an edge or outside the domain."""
    image = np.full((side, side), 90, np.uint8)
    assert ffseg.segment(image, {"init.radius": 9}, method="levelset").doubts == (doubt,)


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
        masks = inside.view(np.uint8), domain.view(np.uint8)
        found_times, found_order, found_contour, initial = _core.fast_march(speed, stop, *masks)
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
