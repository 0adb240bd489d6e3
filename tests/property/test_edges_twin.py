"""The native edge map beside its twin."""

import math

import naive_edges
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ffseg.native import _core

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
    """Gradient and ridges."""
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


@pytest.mark.parametrize("grey", [0, 1, 100, 255])
@pytest.mark.parametrize("sigma", [0.3, 1.5, 20.0])
def test_a_plain_surface_has_no_gradient(grey: int, sigma: float) -> None:
    gradient, ridges = native(np.full((40, 50), grey, np.uint8), sigma)
    assert not gradient.any()
    assert not ridges.any()


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
    rng = np.random.default_rng(3)
    image = np.clip(rng.normal(120, 12, (200, 300, channels)), 0, 255).astype(np.uint8).squeeze()
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
    with pytest.raises(ValueError, match="empty"):
        _core.canny(np.zeros((0, 4), np.uint16), 1, 2, np.zeros((0, 4), np.uint8))
