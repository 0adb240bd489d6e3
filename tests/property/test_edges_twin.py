"""The native edge map beside its twin."""

from __future__ import annotations

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
        st.tuples(st.integers(1, 12), st.integers(1, 20), st.just(3)),
    ),
    elements=st.one_of(st.integers(0, 255), st.sampled_from([0, 255, 100])),
)


@given(images)
@settings(max_examples=60, deadline=None)
def test_gradient_is_that_of_the_twin(image: np.ndarray) -> None:
    out = np.empty(image.shape[:2], np.uint16)
    _core.gradient_magnitude(image, out)
    np.testing.assert_array_equal(out, naive_edges.gradient(image))


@given(images, st.integers(0, 2000), st.integers(0, 3000))
@settings(max_examples=60, deadline=None)
def test_canny_is_that_of_the_twin(image: np.ndarray, low: int, above: int) -> None:
    gradient = np.empty(image.shape[:2], np.uint16)
    _core.gradient_magnitude(image, gradient)
    out = np.empty(image.shape[:2], np.uint8)
    _core.canny(image, gradient, low, low + above, out)
    np.testing.assert_array_equal(out == 255, naive_edges.canny(image, low, low + above, SHORTEST_CHAIN))
    assert set(np.unique(out)) <= {0, 255}


@pytest.mark.parametrize("channels", [1, 3])
def test_thresholds_follow_the_noise(channels: int) -> None:
    rng = np.random.default_rng(3)
    image = np.clip(rng.normal(120, 12, (200, 300, channels)), 0, 255).astype(np.uint8).squeeze()
    gradient = np.empty((200, 300), np.uint16)
    _core.gradient_magnitude(image, gradient)
    out = np.empty((200, 300), np.uint8)
    quiet = _core.canny_auto(image, gradient, None, 5.5 / 1.1774, 48.0, 0.5, 2.0, out)
    assert abs(quiet - np.median(gradient)) < 0.1 * np.median(gradient)
    assert not out.any()  # noise alone has no edge
