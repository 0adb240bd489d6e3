"""Light: evened grey levels, and bright grey streaks taken out before the gradient."""

import cv2
import numpy as np
import pytest

import ffseg
from ffseg.image.edges import edge_map
from ffseg.image.evening import evened, without_streaks
from ffseg.metrics import iou
from ffseg.parameters import Edges


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
    grey = image[..., 0]
    assert (without_streaks(grey, 11)[:, 15:30] == 60).all()


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
