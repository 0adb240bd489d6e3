"""The fast-marching level set on analytic cases."""

import numpy as np
import pytest
from numpy.typing import NDArray

import ffseg
from ffseg.geometry.freeform import FreeForm
from ffseg.image.edges import EdgeMap, edge_map
from ffseg.image.raster import rasterize
from ffseg.methods import levelset
from ffseg.native import _core
from ffseg.parameters import Parameters, load_params
from ffseg.scene import Scene

SHAPE = (120, 160)


def disc_image(center: tuple[float, float], radius: float) -> NDArray[np.uint8]:
    """A bright disc on dark ground with an antialiased edge one pixel wide."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    distance = radius - np.hypot(x - center[0], y - center[1])
    return np.rint(60 + 120 * np.clip(distance + 0.5, 0, 1)).astype(np.uint8)


def evolved(edges: EdgeMap, starts: tuple[FreeForm, ...], params: Parameters, **more: object) -> tuple:
    outcome = levelset.run(Scene(np.empty(SHAPE, np.uint8), params, edges=edges, starts=starts, **more))
    return outcome.contours, outcome.stats


def edges_of(image: NDArray[np.uint8], domain: NDArray[np.uint8] | None = None) -> EdgeMap:
    return edge_map(image, Parameters().edges, domain)


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
    contours, stats = evolved(edges_of(disc_image((80.2, 59.7), 45.4)), (circle((80, 60), 12),), Parameters())
    (outline,) = contours
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
    (outline,) = contours
    assert outline.signed_area == pytest.approx(np.pi * 30.4**2, rel=0.005)
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
    assert offsets.tolist() == [0, len(x)]
    assert set(x[x > 7].tolist()) == {7.5}
    assert np.count_nonzero(x == 7.5) == 6


def test_the_front_does_not_jump_a_wall_of_the_domain_at_the_rim_of_its_start() -> None:
    domain = np.full(SHAPE, 255, np.uint8)
    domain[:, 89:92] = 0
    edges = edges_of(np.full(SHAPE, 90, np.uint8), domain)
    contours, _ = evolved(edges, (circle((80, 60), 12),), Parameters())
    mask = rasterize(contours, SHAPE)
    assert mask[:, :89].all()
    assert not mask[:, 89:].any()


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
