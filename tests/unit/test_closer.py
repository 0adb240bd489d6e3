"""Small things in large images: what somebody points at is seen closer."""

from dataclasses import replace

import numpy as np
import pytest

import ffseg
from ffseg.evidence import closer
from ffseg.evidence.clicks import MOST_CORRECTIONS
from ffseg.evidence.closer import Crop, crops, part_with
from ffseg.image.parts import connected_parts
from ffseg.metrics import iou
from ffseg.scene import Scene
from ffseg.starts.initial import circle_start
from tests.many_things import SHAPE, deepest, large

NOISE = 20
"""Grey levels that leave no edge clear: cells are 3 px deep in the reduced image, in which they do not show."""


def pointed_at(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[int]]:
    """A picture of hundreds of cells, masks of all and of one near the middle, and that one's deepest pixel."""
    image, truth = large(seed, NOISE)
    parts = connected_parts(truth == 255)
    one = np.where(parts.labels == parts.number // 2, np.uint8(255), np.uint8(0))
    return image, truth, one, deepest(one)


@pytest.mark.parametrize("seed", range(3))
def test_a_place_finds_a_small_thing(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    image, _, truth, place = pointed_at(seed)
    found = ffseg.segment(image, {"init.center": place})
    assert iou(found.mask, truth) > 0.8
    x, y = place
    assert found.messages[0].startswith(f"the start at ({x}, {y}), radius 53.33 was seen closer, as a click of radius ")
    monkeypatch.setattr(closer, "WORKING_SIZE", 10**6)
    assert iou(ffseg.segment(image, {"init.center": place}).mask, truth) < 0.1


def test_a_radius_that_is_named_and_wide_is_what_is_meant(monkeypatch: pytest.MonkeyPatch) -> None:
    image, _, _, place = pointed_at(0)
    monkeypatch.setattr(closer, "prior_view", pytest.fail)
    wide = ffseg.segment(image, {"init.center": place, "init.radius": 40})
    middle = ffseg.segment(image)
    assert not any("closer" in one for found in (wide, middle) for one in found.messages)


def test_clicks_go_on_in_what_is_seen_closer() -> None:
    image, _, truth, (x, y) = pointed_at(0)
    inside, outside = [[x, y, 4], [x + 3, y, 2]], [[x + 19, y, 4]]
    for params in ({"init.circles": inside}, {"init.circles": inside[:1], "init.background": outside}):
        found = ffseg.segment(image, params)
        assert found.source == "hints"
        assert iou(found.mask, truth) > 0.8
        assert found.mask[y, x]
        assert not found.mask[y, x + 19]


def test_a_click_beyond_a_crop_is_seen_in_a_wider_one() -> None:
    image, _, _, (x, y) = pointed_at(0)
    far = [60, 60] if x > 600 else [1140, 740]
    found = ffseg.segment(image, {"init.circles": [[x, y, 4]], "init.background": [[*far, 4]]})
    assert found.mask[y, x]
    assert not found.mask[far[1], far[0]]


def test_all_alike_in_a_large_image() -> None:
    pytest.importorskip("lightgbm")
    image, truth, _, place = pointed_at(0)
    assert iou(ffseg.segment(image, {"init.circles": [place], "region.islands": "all"}).mask, truth) > 0.8


def of_things(truth: np.ndarray, number: int) -> tuple[list[list[int]], np.ndarray]:
    """The deepest pixels of so many of the cells, far from one another, and their mask."""
    parts = connected_parts(truth == 255)
    chosen = np.linspace(1, parts.number, number, dtype=int)
    places = [deepest(np.where(parts.labels == one, np.uint8(255), np.uint8(0))) for one in chosen]
    return places, np.where(np.isin(parts.labels, chosen), np.uint8(255), np.uint8(0))


@pytest.mark.parametrize(("number", "named"), [(3, []), (6, []), (6, [4]), (MOST_CORRECTIONS + 4, [])])
def test_several_places_find_a_small_thing_each(
    number: int, named: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    image, every, _, _ = pointed_at(0)
    places, truth = of_things(every, number)
    params = {"init.circles": [[*place, *named] for place in places]}
    found = ffseg.segment(image, params)
    assert iou(found.mask, truth) > 0.8
    said = [one for one in found.messages if "closer" in one]
    assert [one.split(" of radius")[0] for one in said] == (
        [] if named else [f"{number} starts were seen closer, as clicks"]
    )
    monkeypatch.setattr(closer, "WORKING_SIZE", 10**6)
    assert iou(ffseg.segment(image, params).mask, truth) < 0.7


def test_more_places_than_are_looked_from(monkeypatch: pytest.MonkeyPatch) -> None:
    image, every, _, _ = pointed_at(1)
    places, truth = of_things(every, 8)
    monkeypatch.setattr(closer, "MOST_LOOKED_FROM", 2)
    assert iou(ffseg.segment(image, {"init.circles": places}).mask, truth) > 0.8


def test_a_wide_thing_clicked_at_both_ends_is_seen_whole() -> None:
    """No crop of a click shows more of it than its texture."""
    band = np.zeros((800, 1200), np.uint8)
    band[251:550, 51:1150] = 255
    image = 120 + np.random.default_rng(0).normal(0, 1, band.shape) * np.where(band > 0, 40, 12)
    found = ffseg.segment(np.clip(image, 0, 255).astype(np.uint8), {"init.circles": [[150, 400, 8], [1050, 400, 8]]})
    assert iou(found.mask, band) > 0.85


def test_a_place_outside_the_domain_shows_nothing() -> None:
    image, every, _, _ = pointed_at(0)
    places, truth = of_things(every, 4)
    domain = np.full(image.shape[:2], 255, np.uint8)
    x, y = places[-1]
    domain[max(y - 60, 0) : y + 60, max(x - 60, 0) : x + 60] = 0
    truth[domain == 0] = 0
    found = ffseg.segment(image, {"init.circles": places}, domain=domain)
    assert iou(found.mask, truth) > 0.8
    assert not found.mask[domain == 0].any()


def test_points_outside_are_seen_with_the_starts_of_their_crop() -> None:
    init = {"init.circles": [[30, 30, 4], [900, 700, 4], [40, 30, 4]], "init.background": [[50, 30, 3, 2], [880, 700]]}
    scene = Scene(np.zeros((800, 1200), np.uint8), params=ffseg.load_params(None, init))
    scene = replace(scene, starts=tuple(circle_start(one, scene.params) for one in scene.params.init.circles))
    crop = Crop(0, 0, 400, 400, scene.shape)
    near = part_with(scene, [0, 2], crop)
    assert near.shape == crop.size
    assert near.params.init.circles == ((30, 30, 4), (40, 30, 4))
    assert near.params.init.background == ((50, 30, 3, 1),)
    far = part_with(scene, [1], Crop(800, 400, 1200, 800, scene.shape))
    assert far.params.init.circles == ((100, 300, 4),)
    assert far.params.init.background == ((80, 300),)
    assert np.allclose(far.starts[0].control_points.mean(axis=0), (100, 300))


def test_a_wide_thing_is_seen_whole() -> None:
    """Wider than the narrowest crop, in noise that leaves no edge clear."""
    rows, columns = np.ogrid[:700, :1000]
    thing = (rows - 350) ** 2 + (columns - 500) ** 2 <= 290**2
    noisy = np.where(thing, 130, 90) + np.random.default_rng(0).normal(0, 30, thing.shape)
    found = ffseg.segment(np.clip(noisy, 0, 255).astype(np.uint8), {"init.center": [500, 350]})
    assert found.source == "prior"
    assert iou(found.mask, np.where(thing, 255, 0).astype(np.uint8)) > 0.95
    assert not any("closer" in one for one in found.messages)


def test_a_look_that_cuts_what_it_finds_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    image, _, _, place = pointed_at(0)
    monkeypatch.setattr(Crop, "cuts", lambda _, region: region.any())
    assert not any("closer" in one for one in ffseg.segment(image, {"init.center": place}).messages)


def test_crops_halve_round_a_place_and_stay_in_the_image() -> None:
    assert [one.size for one in crops((3000, 4000), 2000, 1500)] == [(2000, 2000), (800, 800), (400, 400)]
    assert [(one.left, one.top, one.right, one.bottom) for one in crops((600, 800), 790, 5)] == [(400, 0, 800, 400)]
    assert [one.size for one in crops((1, 900), 450, 0)] == [(1, 800), (1, 400)]
    assert list(crops(SHAPE, 5, 5)) == []


def test_a_crop_in_its_image() -> None:
    crop = Crop(2, 0, 6, 3, (5, 6))
    part = np.arange(12, dtype=np.float32).reshape(crop.size)
    whole = crop.in_whole(part, -1)
    assert np.array_equal(whole[crop.rows_and_columns], part)
    assert np.count_nonzero(whole == -1) == whole.size - part.size
    inner = crop.inner_border(crop.size)
    assert inner.tolist() == [[True, False, False, False], [True, False, False, False], [True] * 4]
    assert not crop.cuts(~inner)
    assert crop.cuts(inner)
    assert crop.holds(3, 1, 1)  # what lies beyond the image needs no room
    assert crop.holds(5, 0, 1)
    assert not crop.holds(3, 1, 2)
    assert not crop.holds(4, 2, 1)
