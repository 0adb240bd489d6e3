"""A picture and its enlargement have the same region; what was enlarged is told, and nothing else."""

import cv2
import numpy as np
import pytest

import ffseg
from ffseg.errors import SegmentationError
from ffseg.image import magnified
from ffseg.image.magnified import magnification
from ffseg.metrics import iou
from tests.scenes import HEIGHT, START, START_RADIUS, WIDTH, scene

WAYS = {"nearest": cv2.INTER_NEAREST, "linear": cv2.INTER_LINEAR, "cubic": cv2.INTER_CUBIC, "area": cv2.INTER_AREA}
LEAST = 0.99
"""IoU of masks of one size: what was taken back is rounded twice, and moves outlines by some hundredths of a pixel."""


def larger(image: np.ndarray, factor: float, way: str = "linear") -> np.ndarray:
    return cv2.resize(image, None, fx=factor, fy=factor, interpolation=WAYS[way])


def smaller(mask: np.ndarray, factor: int) -> np.ndarray:
    """255 where most of what becomes a pixel is set."""
    shares = cv2.resize(mask.astype(np.float32), None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA)
    return np.where(shares > 0.5, np.uint8(255), np.uint8(0))


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("factor", [2, 3, 4, 8])
def test_an_enlargement_is_told_and_taken_back(factor: int, way: str) -> None:
    colours = np.dstack([scene(seed).image for seed in (1, 2, 3)])
    for image in (scene(1).image, colours):  # of noise, which no smoothing gives back
        found, before = magnification(larger(image, factor, way))
        assert found == factor
        assert np.abs(before.astype(int) - image).max() <= 2  # twice rounded


def test_curves_cut_at_black_and_white_do_not_hide_it() -> None:
    image = scene(1).image.astype(int)
    hard = np.clip(128 + 3 * (image - image.mean()), 0, 255).astype(np.uint8)
    found, before = magnification(larger(hard, 4, "cubic"))
    assert found == 4
    assert np.abs(before.astype(int) - hard).mean() < 0.1


@pytest.mark.parametrize("seed", range(4))
def test_a_picture_as_it_was_drawn_is_none(seed: int) -> None:
    image = scene(seed).image
    assert magnification(image)[1] is image
    binary = np.where(scene(seed).truth, np.uint8(200), np.uint8(40))
    assert magnification(binary)[1] is binary


@pytest.mark.parametrize("way", ["linear", "cubic"])
def test_a_picture_in_which_only_the_liveliest_lines_are_enlarged_is_none(way: str) -> None:
    """A faint part of it was never smaller."""
    rng = np.random.default_rng(0)
    smooth = cv2.GaussianBlur(rng.normal(size=(256, 256)), (0, 0), 2)
    image = larger((127 + 110 * np.clip(smooth / smooth.std(), -1, 1)).astype(np.uint8), 2, way)
    image[200:300, 200:300] = 120 + rng.integers(-8, 9, (100, 100))
    image[180:320, :] //= 6  # so that no line through it is among the liveliest
    image[:, 180:320] //= 2
    assert magnification(image)[0] == 1


def test_a_smooth_picture_is_not_taken_back_only_to_be_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Soft photographs and films pass for enlarged in a few lines; to find the picture before takes longer than all else."""
    rng = np.random.default_rng(0)
    smooth = larger(scene(1).image, 2.6, "cubic")
    image = np.clip(smooth + rng.normal(0, 0.9, smooth.shape), 0, 255).astype(np.uint8)[: 8 * 90, : 8 * 120]
    asked = list[int]()
    monkeypatch.setattr(magnified, "_reduced", lambda picture, factor, _: asked.append(factor) or picture)
    assert magnification(image)[1] is image
    assert asked == []


def test_nothing_is_told_of_an_even_picture_nor_of_a_small_one() -> None:
    assert (
        magnification(np.full((400, 400), 7, np.uint8))[0],
        magnification(larger(scene(1).image[:60, :80], 2))[0],
    ) == (1, 1)
    assert magnification(larger(scene(1).image, 4), most=3)[0] == 2


@pytest.mark.parametrize(("factor", "way"), [(2, "cubic"), (4, "linear"), (8, "linear")])
def test_both_have_the_same_region_contours_and_say_the_same(factor: int, way: str) -> None:
    drawn, seen = scene(3), []
    x, y = ((place + 0.5) * factor - 0.5 for place in START)
    own = ffseg.segment(drawn.image, {"init.center": list(START), "init.radius": START_RADIUS})
    params = {"init.center": [x, y], "init.radius": factor * START_RADIUS, "region.min_area": 10}
    more = ffseg.segment(larger(drawn.image, factor, way), params, callback=seen.append)
    assert more.mask.shape == (factor * HEIGHT, factor * WIDTH)
    assert iou(own.mask, smaller(more.mask, factor)) >= LEAST
    assert len(more.contours) == len(own.contours) == len(seen[-1].contours)
    assert sum(one.signed_area for one in seen[-1].contours) == pytest.approx(more.mask.sum(), rel=0.01)
    assert more.source == own.source
    assert more.score == pytest.approx(own.score, abs=0.02)


def test_sentences_tell_places_in_the_picture_that_was_given() -> None:
    image = np.full((200, 300), 60, np.uint8)
    image[:, 150:] = 180
    rng = np.random.default_rng(2)
    image = (image + rng.integers(0, 6, image.shape)).astype(np.uint8)
    found = ffseg.segment(larger(image, 2), {"init.center": [290, 200], "init.radius": 24})
    assert any("the start at (290, 200), radius 24 lay across an edge" in text for text in found.messages)
    said = r"background seed at \(700, 9\) has its centre outside the image of 600 x 400"
    with pytest.raises(SegmentationError, match=said):
        ffseg.segment(larger(image, 2), {"init.background": [[700, 9]]})
    with pytest.raises(SegmentationError, match="background mask has 300 x 200 pixels, the image 600 x 400"):
        ffseg.segment(larger(image, 2), background=np.zeros((200, 300), np.uint8))


def test_masks_come_along() -> None:
    image, rng = scene(1).image, np.random.default_rng(1)
    masks = {name: np.zeros(image.shape, bool) for name in ("domain", "start_mask", "background")}
    masks["domain"][:, :300] = True
    masks["start_mask"][140:160, 190:220] = True
    masks["background"][rng.integers(0, 30, 5), rng.integers(0, 30, 5)] = True
    own = ffseg.segment(image, **masks)
    enlarged = {name: larger(mask.astype(np.uint8), 2, "nearest") for name, mask in masks.items()}
    more = ffseg.segment(larger(image, 2), **enlarged)
    assert iou(own.mask, smaller(more.mask, 2)) >= LEAST


def test_lengths_of_ones_own_are_pixels_of_the_picture() -> None:
    params = {"init.center": [401, 301], "init.radius": 28}
    image = larger(scene(1).image, 2)
    smoothed, usual = (ffseg.segment(image, {**params, **more}).stats for more in ({"edges.sigma": 3}, {}))
    assert smoothed.iterations > usual.iterations
