"""Open ground: what a start reaches without crossing an edge, and models that ask for it."""

import numpy as np
import pytest

from ffseg.evidence.features import ALL_FEATURES, DEFAULT_FEATURES, SHAPELESS_FEATURES, features
from ffseg.evidence.forest import Model, from_bytes, to_bytes
from ffseg.evidence.openings import PASSAGE_WIDTHS, open_areas
from ffseg.image.appearance import Appearance
from ffseg.image.parts import dilated
from tests.stumps import stump

SHAPE = (60, 100)


def walled(gap: int) -> np.ndarray:
    """An even image, across it a bright bar with a gap in the middle."""
    image = np.full((*SHAPE, 3), 90, np.uint8)
    image[:, 46:54] = 200
    top = SHAPE[0] // 2 - gap // 2
    image[top : top + gap, 46:54] = 90
    return image


def start() -> np.ndarray:
    inside = np.zeros(SHAPE, np.bool_)
    inside[28:33, 18:23] = True
    return inside


def seen(image: np.ndarray, factor: int = 1) -> np.ndarray:
    walls = Appearance(image, max(SHAPE) // factor, even=False).walls
    return open_areas(walls, start()[::factor, ::factor].astype(np.uint8))


@pytest.mark.parametrize(("gap", "passed"), [(0, 0), (8, 2), (12, 3), (40, 4)])
def test_passages_narrower_than_their_width_are_shut(gap: int, passed: int) -> None:
    """Edges stand up to two pixels inside a gap at the default smoothing: 8 px leave between 4 and 6, 12 leave 8 or more."""
    planes = seen(walled(gap))
    beyond = [bool(plane[30, 80]) for plane in planes[: len(PASSAGE_WIDTHS)]]
    assert beyond == sorted(beyond, reverse=True), "what a wide passage lets through, a narrow one does"
    assert sum(beyond) >= passed
    assert sum(beyond) <= passed + 1
    assert (planes[: len(PASSAGE_WIDTHS), 30, 20] == 1).all()
    assert (planes[: len(PASSAGE_WIDTHS), 30, 49:51] == 0).all() or gap


def test_the_smoothed_planes_tell_how_far_the_border_is() -> None:
    planes = seen(walled(0))
    sharp, smooth = planes[0], planes[len(PASSAGE_WIDTHS)]
    assert smooth[30, 20] == pytest.approx(1, abs=1e-5)
    assert smooth[30, 80] == pytest.approx(0, abs=1e-5)
    assert sharp[30, 38] == 1
    assert 0.5 < smooth[30, 42] < 0.99


def test_the_start_is_open_ground_on_an_edge_as_well() -> None:
    image = walled(0)
    image[:, 20:] = 200  # the edge runs through the start
    assert (seen(image)[: len(PASSAGE_WIDTHS)][:, start()] == 1).all()


def test_a_reduced_pixel_with_an_edge_is_a_wall() -> None:
    whole, halved = seen(walled(0)), seen(walled(0), 2)
    for one in (whole[0], halved[0]):
        assert one[one.shape[0] // 2, one.shape[1] // 3] == 1
        assert not one[:, one.shape[1] // 2 + 5 :].any()


def test_widened_is_the_largest_of_the_square_round_a_pixel() -> None:
    region = (np.random.default_rng(5).random((13, 17)) < 0.05).astype(np.uint8)
    for width in PASSAGE_WIDTHS:
        reach = width // 2
        padded = np.pad(region, reach)
        windows = np.lib.stride_tricks.sliding_window_view(padded, (width, width))
        np.testing.assert_array_equal(dilated(region, width), windows.max(axis=(2, 3)))


def test_only_a_model_that_asks_for_open_ground_looks_for_it() -> None:
    """A model made before there was any keeps its features, and what it says."""
    old, new = Model(stump("barrier@1.5", 0.5, 3)), Model(stump("open3", 0.5, 3, ALL_FEATURES))
    image = Appearance(walled(0), even=False)
    assert tuple(old.look(image, start()).planes) == DEFAULT_FEATURES
    assert tuple(new.look(image, start()).planes) == ALL_FEATURES
    again = from_bytes(to_bytes(new))
    assert again.inside.features == ALL_FEATURES
    everything = features(image, start(), ALL_FEATURES)
    np.testing.assert_array_equal(old.map(old.look(image, start())), old.map(everything))
    found = again.map(again.look(image, start()))
    assert found[30, 20] > 0.9 > 0.1 > found[30, 80]


def test_what_is_named_is_found_whatever_else_is_looked_for() -> None:
    some, most = (features(Appearance(walled(0)), start(), names) for names in (SHAPELESS_FEATURES, ALL_FEATURES))
    assert set(SHAPELESS_FEATURES) < set(DEFAULT_FEATURES) < set(ALL_FEATURES)
    for name in SHAPELESS_FEATURES:
        np.testing.assert_array_equal(some[name], most[name])
