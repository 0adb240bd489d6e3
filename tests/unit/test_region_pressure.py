"""region.weight: the colours of swept ground against the rest, in the balloon's pressure."""

import numpy as np
import pytest
from numpy.typing import NDArray

import ffseg
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed
from ffseg.native import _core
from tests import naive_region
from tests.discs import overlap

SHAPE = (300, 400)
GROUND, OTHER = (90.0, 100.0, 110.0), (110.0, 130.0, 90.0)
NO_EDGES = {"edges.source": "gradient", "edges.canny": [9000, 9999]}
"""No gradient of 8-bit levels is so strong: what stops the front is colour."""


def region() -> NDArray[np.bool_]:
    """An ellipse with a round hole."""
    y, x = np.indices(SHAPE)
    hole = (x - 250) ** 2 + (y - 160) ** 2 < 25**2
    return (((x - 200) / 150) ** 2 + ((y - 150) / 110) ** 2 < 1) & ~hole


def noisy(levels: NDArray[np.float64], seed: int, noise: float = 3.0) -> NDArray[np.uint8]:
    return np.clip(levels + np.random.default_rng(seed).normal(0, noise, (*levels.shape[:2], 3)), 0, 255).astype(
        np.uint8
    )


def picture(noise: float = 6.0) -> NDArray[np.uint8]:
    return noisy(np.where(region()[..., None], GROUND, OTHER), 0, noise)


SLACK = 2.0
"""Pixels the contour may lie off on the mean: the front looks a pixel ahead, at the mean of three pixels each way."""

LEAST = 1 - SLACK * (822 + 157) / 49_852
"""IoU, by the perimeters of ellipse (Ramanujan) and hole, and the area."""


@pytest.mark.parametrize("window", [0, 96])
@pytest.mark.parametrize("weight", [0.5, 1.0])
def test_colours_alone_stop_the_front_and_leave_a_hole(weight: float, window: float) -> None:
    overrides = {**NO_EDGES, "region.weight": weight, "region.window": window, "init.center": [130, 150]}
    result = ffseg.segment(picture(), overrides)
    assert result.num_holes == 1
    assert overlap(result.mask, region()) >= LEAST
    without = ffseg.segment(picture(), {**overrides, "region.weight": 0})
    assert without.mask.sum() >= without.mask.size - 4  # nothing else stops it; the corners are cut


def test_the_front_that_closes_in_stops_as_well() -> None:
    truth = (np.indices(SHAPE)[1] - 200) ** 2 + (np.indices(SHAPE)[0] - 150) ** 2 < 80**2
    start = {"init.boxes": [[20, 20, 380, 280]], "contour.balloon": -8}
    image = noisy(np.where(truth[..., None], GROUND, OTHER), 1, 6)
    result = ffseg.segment(image, {**NO_EDGES, **start, "region.weight": 1})
    assert overlap(result.mask, truth) >= 1 - 2 * SLACK / 80  # area pi r^2: a ring of SLACK px is 2 SLACK / r of it


def test_grey_images_have_one_colour_a_pixel() -> None:
    result = ffseg.segment(picture()[..., 1], {**NO_EDGES, "region.weight": 1, "init.center": [130, 150]})
    assert overlap(result.mask, region()) >= LEAST


def test_edges_stand_where_they_stood() -> None:
    """Where an edge stops the front too, its place is the edge's to a fraction of a pixel."""
    image = picture(2.0)
    plain = {"edges.source": "gradient", "init.center": [130, 150]}
    without, result = (ffseg.segment(image, {**plain, "region.weight": weight}) for weight in (0, 0.5))
    loss = overlap(without.mask, region()) - overlap(result.mask, region())
    assert loss <= 0.0003, "the loss that a region's evidence may cost"


def test_a_gap_in_the_edge_does_not_leak() -> None:
    """A wall open over 40 px between two grounds: colours hold the front where no edge does."""
    soft = np.clip((np.arange(400) - 180) / 40, 0, 1)[None, :, None]  # no edge
    levels = np.array(GROUND) * (1 - soft) + np.array(OTHER) * soft + np.zeros((*SHAPE, 1))
    levels[:130, 198:202] = levels[170:, 198:202] = 20
    image = noisy(levels, 2)
    start = {"edges.source": "gradient", "edges.canny": [20, 40], "init.center": [80, 150]}
    without, result = (ffseg.segment(image, {**start, "region.weight": weight}) for weight in (0, 1))
    assert without.mask[:, 210:].mean() > 0.9
    assert result.mask[:, 230:].sum() == 0


def test_the_last_pixels_are_swept_as_well() -> None:
    """Of a rest of a few pixels no colours are known."""
    result = ffseg.segment(noisy(np.full((*SHAPE, 1), 100.0), 4), {**NO_EDGES, "region.weight": 1})
    assert result.mask.mean() > 0.999  # the corners are cut


@pytest.mark.parametrize(("brightest", "balloon", "most", "reached"), [(110, 8, 100, 300), (250, 3, 2000, 395)])
def test_what_is_swept_teaches_what_may_be_swept(brightest: int, balloon: float, most: int, reached: int) -> None:
    """Where ground changes slowly the front learns as it goes; where faster, again when it has come to rest."""
    image = noisy(np.linspace(30, brightest, SHAPE[1])[None, :, None] + np.zeros((*SHAPE, 3)), 5)
    start = {"init.center": [40, 150], "init.radius": 30, "contour.balloon": balloon, "contour.max_iterations": most}
    result = ffseg.segment(image, {**NO_EDGES, **start, "region.weight": 0.2})
    assert np.flatnonzero(result.mask.any(axis=0)).max() >= reached


def test_weight_zero_looks_at_no_colour() -> None:
    ground = np.zeros(SHAPE, np.uint8)
    options = _core.EvolutionOptions()
    options.degree, options.split_threshold, options.balloon, options.max_iterations = 3, 40.0, 8.0, 12
    options.refine = options.topology = True
    start = FreeForm(np.array([150, 150]) + 20 * circle(13 * 3), 3)
    found = []
    for image in (None, picture()):
        evolution = _core.Evolution(*packed([start]), ground, None, options, image)
        evolution.advance(12)
        found.append(evolution.contours()[0])
    np.testing.assert_array_equal(found[0], found[1])


def circle(count: int) -> NDArray[np.float64]:
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle)], 1)


@pytest.mark.parametrize("channels", [1, 2, 3])
@pytest.mark.parametrize("closes_in", [False, True])
def test_the_pressure_is_that_of_two_gaussians(channels: int, closes_in: bool) -> None:
    rng = np.random.default_rng(channels)
    swept = np.zeros((128, 160), np.bool_)
    swept[20:90, 30:110] = True
    image = np.clip(rng.normal(110, 20, (128, 160, channels)) + 12.0 * swept[..., None], 0, 255).astype(np.uint8)
    corners = np.array([[29.5, 19.5], [109.5, 19.5], [109.5, 89.5], [29.5, 89.5]])
    pressure = _core.Pressure(image, 0.1, 0.0)
    points = corners[::-1] if closes_in else corners
    pressure.fit(np.ascontiguousarray(points), np.array([0, 4]), 1, closes_in)
    values = []
    for x, y in rng.integers(0, (160, 128), (60, 2)):
        values.append(naive_region.pressure(image, swept ^ closes_in, (int(x), int(y)), 0.1, floor=9.0, every=8))
        assert pressure.at(float(x), float(y)) == pytest.approx(values[-1], abs=1e-9)  # sums are whole numbers
    assert len(set(values)) > 10  # not all cut to 0 or 1


def test_windows_see_what_is_near_them() -> None:
    """Ground that changes its colour slowly: each window has its own, the whole image has both."""
    levels = np.tile((60 + np.arange(640) / 5)[None, :, None], (128, 1, 3))
    levels[64:] += 60  # the other ground
    image = noisy(levels, 3, 2)
    corners = np.array([[-0.5, -0.5], [639.5, -0.5], [639.5, 63.5], [-0.5, 63.5]])
    shares = {}
    for window in (0.0, 64.0):
        pressure = _core.Pressure(image, 1.0, window)
        pressure.fit(corners, np.array([0, 4]), 1, False)
        shares[window] = pressure.at(100.0, 100.0), pressure.at(100.0, 30.0)
    assert shares[64.0] == (0.0, 1.0)
    assert shares[0.0][0] == 1.0  # as bright as the first ground is farther right


def test_narrower_windows_are_sixteen_pixels_wide() -> None:
    image = np.random.default_rng(6).integers(0, 256, (64, 96, 3), np.uint8)
    corners = np.array([[-0.5, -0.5], [47.5, -0.5], [47.5, 63.5], [-0.5, 63.5]])
    found = []
    for window in (1e-9, 5.0, 16.0, 32.0):
        pressure = _core.Pressure(image, 0.1, window)
        pressure.fit(corners, np.array([0, 4]), 1, False)
        found.append([pressure.at(float(x), 30.0) for x in range(96)])
    assert found[0] == found[1] == found[2] != found[3]


def test_what_makes_no_sense_is_refused() -> None:
    image = np.zeros((20, 20, 3), np.uint8)
    for weight, window in ((0.0, 0.0), (float("nan"), 0.0), (1.0, -1.0), (1.0, float("nan"))):
        with pytest.raises(ValueError, match="out of range"):
            _core.Pressure(image, weight, window)
    with pytest.raises(ValueError, match="channels"):
        _core.Pressure(np.zeros((20, 20, 4), np.uint8), 1.0, 0.0)
    options = _core.EvolutionOptions()
    options.degree, options.split_threshold, options.balloon, options.max_iterations = 1, 40.0, 8.0, 1
    start = packed([FreeForm(10 + 4 * circle(8), 1)])
    with pytest.raises(ValueError, match="differ in size"):
        _core.Evolution(*start, np.zeros((20, 21), np.uint8), None, options, image)
