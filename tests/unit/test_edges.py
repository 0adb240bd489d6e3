"""Edge maps beside their twin, light and streaks before the gradient, and what lies under the joints of a contour."""

import math

import cv2
import naive_edges
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import ffseg
from ffseg.image.edges import edge_map
from ffseg.image.evening import evened, without_streaks
from ffseg.metrics import iou
from ffseg.native import _core
from ffseg.parameters import Edges

SHORTEST_CHAIN = 6
images = hnp.arrays(
    np.uint8,
    st.one_of(
        st.tuples(st.integers(1, 24), st.integers(1, 40)),
        st.tuples(st.integers(1, 12), st.integers(1, 20), st.integers(1, 4)),
        st.tuples(st.just(1), st.integers(1, 90)),
    ),
    elements=st.one_of(st.integers(0, 255), st.sampled_from([0, 255, 100])),
)
sigmas = st.one_of(st.floats(0.01, 4), st.sampled_from([1.5, 20.0, 32.0]), st.floats(0, 32, exclude_min=True))


def native(image: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    gradient, ridges = np.empty(image.shape[:2], np.uint16), np.empty(image.shape[:2], np.uint8)
    _core.gradient_and_ridges(image, sigma, gradient, ridges)
    return gradient, ridges


@given(images, sigmas)
@settings(max_examples=120, deadline=None)
def test_gradient_and_ridges_are_those_of_the_twin(image: np.ndarray, sigma: float) -> None:
    gradient, ridges = native(image, sigma)
    size, maxima = naive_edges.gradient_and_ridges(image, sigma)
    np.testing.assert_array_equal(gradient, size)
    np.testing.assert_array_equal(ridges, maxima)


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_one_pixel_that_is_not_grey_counts(channel: int) -> None:
    image = np.full((40, 70, 3), 100, np.uint8)
    np.testing.assert_array_equal(native(image, 1.0)[0], 0)
    image[-1, -1, channel] = 255
    np.testing.assert_array_equal(native(image, 1.0)[0], naive_edges.gradient_and_ridges(image, 1.0)[0])


def most_error(sigma: float) -> float:
    """What rounding and the cut kernel can add up to, in stored units.

    Every product of the two passes is off by at most 1/2 unit of 1/128 grey level after half of it is given back, every
    weight by 1/2 of 1/65536, each pass loses what is cut, a smoothed pixel is rounded to 1/32; a Sobel sum has absolute
    weight 8, a vector is sqrt(2) times as long as its longest component, and the magnitude itself is rounded.
    """
    parts = len(naive_edges.weights(sigma))
    cut = math.erfc((parts - 0.5) / sigma / math.sqrt(2)) * 255 * naive_edges.UNIT
    one_pass = (parts / 2 + 0.5) / 4 + (2 * parts) / 2 / 65536 * 255 * naive_edges.UNIT + cut
    return math.sqrt(2) * (2 * one_pass + 0.5) + 1


@given(images, st.floats(0.3, 6))
@settings(max_examples=60, deadline=None)
def test_gradient_is_that_of_exact_arithmetic(image: np.ndarray, sigma: float) -> None:
    gradient, _ = native(image, sigma)
    exact = naive_edges.exact_gradient(image, sigma) * naive_edges.UNIT
    assert np.abs(gradient - exact).max() <= most_error(sigma)


@pytest.mark.parametrize("sigma", [0.8, 1.5, 3.0, 8.0])
def test_weak_slopes_are_kept(sigma: float) -> None:
    """A slope of 0.05 grey levels per pixel, dithered to whole grey levels; smoothed to 8 bits it would become steps."""
    image = (np.random.default_rng(2).random((200, 400)) + 100 + 0.05 * np.arange(400)).astype(np.uint8)
    gradient, _ = native(image, sigma)
    exact = naive_edges.exact_gradient(image, sigma) * naive_edges.UNIT
    # The stored magnitude and the smoothed pixels are rounded to whole units (0.29 each), the products before to quarters.
    assert np.sqrt(np.mean((gradient - exact) ** 2)) < 0.5


@given(images, st.integers(0, 2000), st.integers(0, 3000))
@settings(max_examples=60, deadline=None)
def test_canny_is_that_of_the_twin(image: np.ndarray, low: int, above: int) -> None:
    gradient, edges = native(image, 0.6)
    ridges = edges > 0
    _core.canny(gradient, low, low + above, edges)
    twin = naive_edges.linked(gradient.astype(np.int64), ridges, low, low + above, SHORTEST_CHAIN)
    np.testing.assert_array_equal(edges == 255, twin)
    assert set(np.unique(edges)) <= {0, 255}


@pytest.mark.parametrize("channels", [1, 3])
def test_thresholds_follow_the_noise(channels: int) -> None:
    image = np.clip(np.random.default_rng(3).normal(120, 12, (200, 300, channels)), 0, 255).astype(np.uint8).squeeze()
    gradient, edges = native(image, 1.0)
    quiet = _core.canny_auto(gradient, None, 5.5 / 1.1774, 48.0, 0.5, 2.0, edges)
    assert abs(quiet - np.median(gradient)) < 0.1 * np.median(gradient)
    assert not edges.any()  # noise alone has no edge


def test_impossible_calls_are_refused() -> None:
    image, gradient = np.zeros((3, 4), np.uint8), np.zeros((3, 4), np.uint16)
    for sigma in (0.0, -1.0, 33.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="sigma is out of range"):
            _core.gradient_and_ridges(image, sigma, gradient, image.copy())
    for other in (np.zeros((4, 3), np.uint16), np.zeros((0, 4), np.uint16)):
        with pytest.raises(ValueError, match="differ in size"):
            _core.gradient_and_ridges(image, 1.0, other, image.copy())
    with pytest.raises(ValueError, match="differ in size"):
        _core.canny(gradient, 1, 2, np.zeros((4, 4), np.uint8))
    with pytest.raises(ValueError, match="above the high one"):
        _core.canny(gradient, 3, 2, image.copy())
    with pytest.raises(ValueError, match="pixels a side"):
        _core.canny(np.zeros((0, 4), np.uint16), 1, 2, np.zeros((0, 4), np.uint8))


def test_by_default_the_image_itself_is_looked_at() -> None:
    image = np.random.default_rng(1).integers(0, 256, (20, 30, 3), np.uint8)
    assert evened(image, Edges()) is image


@pytest.mark.parametrize("levels", ["root", "log"])
def test_evened_levels_rise_from_0_to_255_and_open_the_dark(levels: str) -> None:
    ramp = np.arange(256, dtype=np.uint8)[None]
    found = evened(ramp, Edges(levels=levels))[0].astype(int)
    assert (found[0], found[255]) == (0, 255)
    assert (np.diff(found) >= 0).all()
    assert found[64] - found[32] > 2 * (found[224] - found[192])


def test_a_step_of_reflectance_has_one_size_in_light_and_shade() -> None:
    """The same two greys in full light and in a quarter of it: log makes the steps alike, linear keeps 4 to 1."""
    light, shade = np.full((40, 80), 200, np.uint8), np.full((40, 80), 50, np.uint8)
    light[:, 40:], shade[:, 40:] = 140, 35

    def ratio(levels: str) -> float:
        steps = (edge_map(image, Edges(levels=levels)).magnitude()[20].max() for image in (light, shade))
        return next(steps) / next(steps)

    assert ratio("linear") == pytest.approx(4, rel=0.02)
    assert ratio("root") == pytest.approx(2, rel=0.05)
    assert ratio("log") == pytest.approx(np.log(210 / 150) / np.log(60 / 45), rel=0.06)


def test_grey_streaks_go_and_what_is_wide_or_coloured_stays() -> None:
    image = np.full((60, 90, 3), (60, 90, 120), np.uint8)
    image[:, 20:26] += 80  # gloss: the lamp's grey on top of the ground
    image[:, 40:60] += 80  # as bright, but wide
    image[:, 75:81] = (200, 90, 60)  # a coloured line
    found = without_streaks(image, 11)
    assert (found[:, 15:30] == (60, 90, 120)).all()
    assert np.array_equal(found[:, 35:], image[:, 35:])
    assert np.array_equal(without_streaks(image, 3), image)  # narrower than the streaks
    assert (without_streaks(image[..., 0], 11)[:, 15:30] == 60).all()


def test_the_contour_passes_streaks_that_are_taken_out() -> None:
    image = np.full((120, 200, 3), 90, np.uint8)
    image[:20] = image[100:] = 200
    for x in (70, 130):
        cv2.line(image, (x, 0), (x, 119), (230, 230, 230), 5)
    truth = np.zeros((120, 200), np.uint8)
    truth[20:100] = 255
    start = {"init.center": [100, 60], "init.radius": 10}
    assert iou(ffseg.segment(image, start).mask, truth) < 0.4
    assert iou(ffseg.segment(image, {**start, "edges.highlights": 11}).mask, truth) > 0.95


MARGIN, SHAPE = 3, (30, 40)


def naive_within(x: float, y: float, domain: np.ndarray | None) -> bool:
    height, width = SHAPE
    if not (MARGIN <= x <= width - 1 - MARGIN and MARGIN <= y <= height - 1 - MARGIN):
        return True
    near = [(round(y + dy), round(x + dx)) for dy in (-MARGIN, 0, MARGIN) for dx in (-MARGIN, 0, MARGIN)]
    return domain is not None and any(domain[at] == 0 for at in near)


@pytest.mark.parametrize("bounded", [False, True])
def test_gradients_under_joints_and_the_share_at_the_border(bounded: bool) -> None:
    rng, joints = np.random.default_rng(3), np.random.default_rng(2).uniform(-4, 44, (300, 2))
    gradient = rng.integers(0, 9000, SHAPE).astype(np.uint16)
    domain = (rng.random(SHAPE) < 0.97).astype(np.uint8) if bounded else None
    at = [(round(x), round(y)) for x, y in joints]
    expected = [gradient[y - 1 : y + 2, x - 1 : x + 2].max() for x, y in at if not naive_within(x, y, domain)]
    assert _core.gradients_at(joints, gradient, domain, MARGIN).tolist() == expected != []
    near = np.array([naive_within(x, y, domain) for x, y in joints])
    after = np.array([*range(1, 7), 0, *range(8, 300), 7])  # two contours
    lengths = np.hypot(*(joints[after] - joints).T)
    share = _core.share_within(joints, np.array([0, 7, 300]), SHAPE, domain, MARGIN)
    assert share == pytest.approx(lengths[near & near[after]].sum() / lengths.sum(), rel=1e-12)
    assert _core.share_within(np.empty((0, 2)), np.array([0]), SHAPE, domain, MARGIN) == 0.0


def test_what_does_not_fit_is_refused() -> None:
    points, plane = np.zeros((2, 2)), np.zeros(SHAPE, np.uint16)
    with pytest.raises(ValueError, match="margin"):
        _core.gradients_at(points, plane, None, 0)
    with pytest.raises(ValueError, match="differ in size"):
        _core.gradients_at(points, plane, np.ones((2, 2), np.uint8), 3)


@pytest.mark.parametrize("exponent", [-1, 0, math.nan])
def test_an_exponent_with_which_edges_slow_nothing_down_is_refused(exponent: float) -> None:
    edges = edge_map(np.zeros((4, 4), np.uint8), Edges())
    with pytest.raises(ffseg.SegmentationError, match="exponent is"):
        edges.diffusion(exponent)
