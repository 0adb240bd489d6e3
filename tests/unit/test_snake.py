"""The parametric snake on cases whose answer is known, and against its dense-matrix twin."""

from functools import partial

import naive_snake as naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ffseg.errors import SegmentationError
from ffseg.geometry.freeform import FreeForm
from ffseg.image.edges import EdgeMap
from ffseg.image.raster import rasterize
from ffseg.methods import snake
from ffseg.native import _core
from ffseg.parameter_files import load_params
from ffseg.parameters import Parameters
from ffseg.scene import Progress, Scene
from tests.discs import bright_disc, edges_of, overlap

SHAPE = (160, 200)
START = FreeForm.circle((100, 80), 14, 13, 3)
disc_image = partial(bright_disc, SHAPE, (100.2, 79.7))


def evolved(edges: EdgeMap, starts: tuple[FreeForm, ...], params: Parameters, **more: object) -> tuple:
    outcome = snake.run(Scene(np.empty(SHAPE, np.uint8), params, edges=edges, starts=starts, **more))
    return outcome.contours, outcome.stats


def test_it_rests_on_the_boundary_of_a_disc() -> None:
    (contour,), stats = evolved(edges_of(disc_image(52.4)), (START,), Parameters())
    radius = np.hypot(*(contour.control_points - (100.2, 79.7)).T)
    # Points rest on the ridge; bilinear sampling and the internal energy (tension * h^2 / R = 0.01 px) leave a tenth.
    assert np.abs(radius - 52.4).max() <= 0.2
    assert stats.stop_reason == "converged"
    assert stats.iterations < 60
    assert stats.splits > stats.initial_points
    assert stats.final_points == len(contour.control_points) == stats.initial_points + stats.splits - stats.prunes


def test_contrast_does_not_matter() -> None:
    strong, _ = evolved(edges_of(disc_image(52.4, 250)), (START,), Parameters())
    weak, _ = evolved(edges_of(disc_image(52.4, 80)), (START,), Parameters())
    # 8-bit steps blur an edge of 20 grey levels: a tenth of a pixel on a perimeter of 329 px.
    assert (rasterize(strong, SHAPE) ^ rasterize(weak, SHAPE)).sum() <= 33


def test_a_negative_balloon_closes_in() -> None:
    params = load_params(None, {"contour.balloon": -2.0})
    (contour,), stats = evolved(edges_of(disc_image(30.4)), (FreeForm.circle((100, 80), 74, 13, 3),), params)
    assert contour.signed_area == pytest.approx(np.pi * 30.4**2, rel=0.01)
    assert stats.prunes > 0
    assert stats.stop_reason == "converged"


def test_a_shrinking_snake_without_an_object_vanishes() -> None:
    params = load_params(None, {"contour.balloon": -2.0})
    contours, stats = evolved(edges_of(np.full(SHAPE, 90, np.uint8)), (START,), params)
    assert contours == ()
    assert (stats.stop_reason, stats.final_points) == ("vanished", 0)


def test_round_an_island_it_closes_to_a_slit() -> None:
    image = disc_image(70)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    island = np.hypot(x - 135, y - 80) < 8
    image[island] = 60
    contours, stats = evolved(edges_of(image), (START,), Parameters())
    truth = (np.hypot(x - 100.2, y - 79.7) < 70) & ~island
    mask = rasterize(contours, SHAPE)
    assert (len(contours), stats.stop_reason) == (1, "converged")
    assert overlap(mask, truth) > 0.98
    assert mask[island].mean() < 0.125  # half a pixel of its outline


def test_without_refinement_the_number_of_points_stays() -> None:
    params = load_params(None, {"contour.refine": False})
    (contour,), stats = evolved(edges_of(disc_image(52.4)), (START,), params)
    assert len(contour.control_points) == stats.initial_points
    assert (stats.splits, stats.prunes) == (0, 0)


def test_it_stays_in_domain_and_image() -> None:
    domain = np.zeros(SHAPE, np.uint8)
    domain[:130, 30:] = 255
    contours, _ = evolved(edges_of(np.full(SHAPE, 90, np.uint8), domain), (START,), Parameters())
    mask = rasterize(contours, SHAPE)
    assert not mask[domain == 0].any()
    assert mask[domain > 0].mean() > 0.95  # a snake rounds the corners


def test_it_does_not_step_over_a_wall_of_the_domain() -> None:
    domain = np.full(SHAPE, 255, np.uint8)
    domain[:, 130:134] = 0  # half as wide as a step
    contours, _ = evolved(edges_of(np.full(SHAPE, 90, np.uint8), domain), (START,), Parameters())
    assert not rasterize(contours, SHAPE)[:, 130:].any()


def altitude_case() -> tuple[EdgeMap, NDArray[np.bool_]]:
    """A painted ring on the ground inside a disc, and the disc as truth."""
    image = disc_image(70)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    distance = np.hypot(x - 100.2, y - 79.7)
    image[np.abs(distance - 40) < 2] = 250
    return edges_of(image), distance < 70


def ring_of(altitude: float, count: int) -> NDArray[np.float64]:
    angle = np.arange(count) * (2 * np.pi / count)
    points = np.stack([100.2 + 40 * np.cos(angle), 79.7 + 40 * np.sin(angle)], axis=1)
    return np.concatenate([points, np.full((count, 1), altitude), np.full((count, 1), 10.0)], axis=1)


def test_points_on_the_ground_let_it_pass_a_painted_ring() -> None:
    edges, truth = altitude_case()
    held, _ = evolved(edges, (START,), Parameters())
    passed, _ = evolved(edges, (START,), Parameters(), altitudes=ring_of(0.0, 24))
    tall, _ = evolved(edges, (START,), Parameters(), altitudes=ring_of(0.5, 24))
    assert rasterize(held, SHAPE).sum() < 0.4 * truth.sum()
    assert rasterize(tall, SHAPE).sum() < 0.4 * truth.sum()
    assert overlap(rasterize(passed, SHAPE), truth) > 0.99


def test_too_few_ground_points_do_not_open_the_ring() -> None:
    edges, truth = altitude_case()
    contours, _ = evolved(edges, (START,), Parameters(), altitudes=ring_of(0.0, 3))
    area = rasterize(contours, SHAPE).sum()
    assert 0.3 * truth.sum() < area < truth.sum()  # it gets out through three gaps, the ring itself stays uncovered


def test_callbacks_do_not_change_the_result() -> None:
    seen: list[Progress] = []
    edges = edges_of(disc_image(52.4))
    (plain,), stats = evolved(edges, (START,), Parameters())
    (watched,), _ = evolved(edges, (START,), Parameters(), callback=seen.append, every=7)
    assert (plain.control_points == watched.control_points).all()
    assert ([p.iteration for p in seen[:3]], seen[-1].iteration) == ([0, 7, 14], stats.iterations)


def test_stiff_forces_move_far_points_step_by_step() -> None:
    shape, options = (400, 500), _core.SnakeOptions()
    options.tension, options.spacing, options.max_iterations = 1000.0, 6.0, 10
    start = np.array([[20.0, 20.0], [480, 20], [480, 380], [250, 200], [20, 380]])
    nothing = np.zeros(shape, np.uint16)
    free = _core.Snake(start, nothing, nothing.astype(np.uint8), None, np.empty((0, 4)), 0.1, options)
    free.advance(1)
    moved = np.hypot(*(free.points() - start).T)
    # The solution lies close to the mean of all points, 240 px away from the outer ones.
    assert moved[[0, 1, 2, 4]] == pytest.approx(64.0)
    assert moved[3] < 64.0


def test_two_starts_are_refused() -> None:
    with pytest.raises(SegmentationError, match="2 starts"):
        evolved(edges_of(disc_image(52.4)), (START, START), Parameters())


def test_the_core_refuses_what_it_cannot_run_on() -> None:
    gradient, edges = np.zeros((8, 8), np.uint16), np.zeros((8, 8), np.uint8)
    none, options = np.empty((0, 4)), _core.SnakeOptions()
    options.spacing = 6.0
    start, unknown = np.zeros((6, 2)), np.array([[0, 0, np.nan, 1.0]])
    bad = {
        "not finite": (start + np.nan, edges, none),
        "size": (start, edges[:4], none),
        "altitude": (start, edges, unknown),
    }
    for message, (points, pixels, altitudes) in bad.items():
        with pytest.raises(ValueError, match=message):
            _core.Snake(points, gradient, pixels, None, altitudes, 0.1, options)
    options.spacing = 0.0
    with pytest.raises(ValueError, match="option"):
        _core.Snake(np.zeros((6, 2)), gradient, edges, None, none, 0.1, options)


@given(st.integers(5, 60), st.floats(0, 1000), st.floats(0, 1000), st.integers(0, 2**32 - 1))
def test_a_snake_without_forces_solves_as_a_dense_one(count: int, tension: float, rigidity: float, seed: int) -> None:
    right = np.random.default_rng(seed).uniform(0, 60, (count, 2))
    matrix = naive.internal_matrix(count, tension, rigidity)
    options = _core.SnakeOptions()
    options.tension, options.rigidity, options.max_iterations, options.spacing = tension, rigidity, 1, 6.0
    plain = np.zeros((61, 61), np.uint8)
    snake = _core.Snake(right, plain.astype(np.uint16), plain, None, np.empty((0, 4)), 0.08, options)
    assert snake.advance(1)
    # Both are exact up to rounding times the condition number, which is at most 1 + 4 tension + 16 rigidity.
    condition = 1 + 4 * tension + 16 * rigidity
    assert np.abs(snake.points() - np.linalg.solve(matrix, right)).max() <= 1e-15 * 20 * condition * np.abs(right).max()


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
    zones = naive.zones(edges, altitudes, 0.08)
    twin = naive.Snake(start, gradient.astype(float), zones, domain, options)
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
