"""What clicks say of an image: where they lie holds, and what they show of both sides teaches the evidence."""

from statistics import mean
from typing import cast
from unittest.mock import Mock

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

import ffseg
from ffseg.evidence import clicks as evidence
from ffseg.evidence import hints, prior
from ffseg.evidence.clicks import Click, ClickedImage, ClickState, state_after_all
from ffseg.evidence.recent import Recent
from ffseg.image.appearance import Appearance
from ffseg.image.free import distances
from ffseg.learning.drawn.clicks import Clicks, disc_mask
from ffseg.learning.drawn.sights import Sight, sights
from ffseg.metrics import INSIDE, iou
from ffseg.parameters import Circle
from ffseg.result import Segmentation
from tests.discs import disc_of

UNSEEN = 300_000
"""Number of the first picture: the forest has learned from others."""


@pytest.fixture(autouse=True)
def _nothing_is_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a test tells a forest to show is no answer to another's click."""
    monkeypatch.setattr(evidence, "_states", Recent(evidence.CACHED_STATES))
    monkeypatch.setattr(evidence, "_views", Recent(1))


def segmented(image: NDArray[np.uint8], clicks: Clicks, **more: object) -> Segmentation:
    circles, background = ([list(one) for one in side] for side in (clicks.inside, clicks.outside))
    return ffseg.segment(image, {"init.circles": circles, "init.background": background, **more})


def clicked(seen: Sight, count: int) -> list[tuple[Clicks, Segmentation]]:
    """What so many clicks of a simulated user give, one after another."""
    clicks, mask, found = Clicks(), np.zeros(seen.truth.shape, np.bool_), []
    for _ in range(count):
        clicks = clicks.next(mask, seen.truth, 0.01 * max(mask.shape))
        found.append((clicks, segmented(seen.image, clicks)))
        mask = found[-1][1].mask
    return found


@pytest.mark.parametrize("kind", ["animal", "organ", "nuclei"])
def test_every_click_holds(kind: str) -> None:
    for seen in sights(kind, 2, UNSEEN):
        for clicks, found in clicked(seen, 5):
            assert_held(clicks, found)


def assert_held(clicks: Clicks, found: Segmentation) -> None:
    """But for a rim of a pixel and a half: the contour settles on an edge that near."""
    inside, outside = (
        tuple((x, y, max(radius - 1.5, 0.5)) for x, y, radius, *_ in side) for side in (clicks.inside, clicks.outside)
    )
    assert found.mask[disc_mask(inside, found.mask.shape)].all()
    assert not found.mask[disc_mask(outside, found.mask.shape)].any()


def test_clicks_on_drawings_that_were_not_learned_from_mend_what_the_first_left() -> None:
    first, third = [], []
    for kind in ("animal", "organ", "nuclei", "tissue", "thing"):
        for seen in sights(kind, 2, UNSEEN):
            runs = clicked(seen, 3)
            first.append(iou(runs[0][1].mask, seen.truth))
            third.append(iou(runs[2][1].mask, seen.truth))
    assert mean(third) > mean(first) + 0.05
    assert mean(third) > 0.8


def halves() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Two speckled halves of almost one colour with no edge between them, and the left one as a truth."""
    image = np.full((160, 240, 3), 120, np.uint8)
    image[:, 120:] = (120, 132, 108)
    image = np.clip(image + np.random.default_rng(0).normal(0, 12, image.shape), 0, 255).astype(np.uint8)
    return image, np.where(np.arange(240) < 120, INSIDE, 0).astype(np.uint8)[None].repeat(160, axis=0)


def test_one_start_alone_is_the_priors() -> None:
    image, _ = halves()
    assert ffseg.segment(image, {"init.center": [40, 80], "init.radius": 12}).source in {"gradient", "prior"}


def test_both_sides_teach_their_colours() -> None:
    image, truth = halves()
    discs: dict[str, list[Circle]] = {"init.circles": [(40, 80, 12)], "init.background": [(200, 80, 12)]}
    found = ffseg.segment(image, discs)
    assert found.source == "hints"
    assert iou(found.mask, truth) > 0.9
    turned = {"init.circles": discs["init.background"], "init.background": discs["init.circles"]}
    assert iou(ffseg.segment(image, turned).mask, np.where(truth == INSIDE, 0, INSIDE).astype(np.uint8)) > 0.9


def test_circles_that_overlap_a_click_outside_keep_their_own_pixels() -> None:
    image, _ = halves()
    clicks = Clicks(((40.0, 80.0, 8.0),), ((51.0, 80.0, 4.0),))
    assert_held(clicks, segmented(image, clicks, **{"edges.source": "hints"}))


def test_a_click_of_a_pixel_beside_the_edge_does_not_leak_over_it() -> None:
    seen = next(sights("room", 1, 500_000))
    inside = ((127.0, 334.0, 3.8), (202.0, 186.0, 3.8), (150.0, 222.0, 3.8), (177.0, 159.0, 1.0))
    found = segmented(seen.image, Clicks(inside, ((228.0, 219.0, 3.8), (198.0, 154.0, 1.8))))
    assert iou(found.mask, seen.truth) > 0.95  # .23, the whole room, where the disc itself was all that was known


def test_a_narrow_click_on_a_rim_shows_nothing_of_what_lies_beyond() -> None:
    seen = next(sights("tissue", 1, 710_001))
    clicks = Clicks(((208.0, 239.0, 3.8), (206.0, 210.0, 1.0)))
    assert iou(segmented(seen.image, clicks).mask, seen.truth) > 0.9  # .25, with the next cell
    seen = next(sights("organ", 1, 710_003))
    inside, outside = ((44.0, 58.0, 2.3), (79.0, 81.0, 1.2)), ((50.0, 109.0, 2.3), (7.0, 77.0, 2.0))
    assert iou(segmented(seen.image, Clicks(inside, outside)).mask, seen.truth) > 0.9  # .39


def test_clicks_that_are_all_narrow_show_what_they_lie_on() -> None:
    image, truth = halves()
    found = ffseg.segment(image, {"init.circles": [[40, 80, 2]], "init.background": [[200, 80, 2]]})
    assert iou(found.mask, truth) > 0.9


def test_a_click_outside_corrects_what_a_map_says_and_leaves_the_rest() -> None:
    """A rival that grew from it took the ground behind the box as well."""
    levels, truth = np.full((120, 180, 3), (150, 170, 190), np.float64), np.zeros((120, 180), np.uint8)
    levels[40:], truth[40:] = (120, 125, 130), INSIDE
    said = np.where(truth == INSIDE, np.float32(0.9), np.float32(0.1))  # of a map to which the box is ground
    levels[60:100, 100:150], truth[60:100, 100:150] = (140, 135, 110), 0
    image = (levels + np.random.default_rng(1).normal(0, 3, levels.shape)).clip(0, 255).astype(np.uint8)
    asked = {"init.circles": [[40, 80, 5]], "init.background": [[125, 80, 5]]}
    found = ffseg.segment(image, asked, evidence=said)
    assert (found.source, iou(found.mask, truth) > 0.95) == ("hints", True)


@pytest.mark.parametrize("points", [[], [[40, 65, 6]]])
def test_a_click_over_the_limit_of_the_domain_shows_what_it_has_in_it(points: list[list[float]]) -> None:
    levels, truth = np.full((160, 240, 3), (90, 120, 150), np.float64), np.zeros((160, 240), np.uint8)
    levels[:, 120:], levels[30:130, 20:70] = (150, 130, 80), (150, 130, 80)  # outside the domain, and a thing in it
    truth[:, :120], truth[30:130, 20:70] = INSIDE, 0
    image = (levels + np.random.default_rng(2).normal(0, 40, levels.shape)).clip(0, 255).astype(np.uint8)
    domain = np.zeros(truth.shape, np.uint8)
    domain[:, :120] = 255
    asked = {"init.circles": [[95, 120, 8], [130, 80, 22]], "init.background": points}
    found = ffseg.segment(image, asked, domain=domain)
    assert (found.source, iou(found.mask, truth) > 0.98) == ("hints", True)  # .73 to .95 with all of the disc


@pytest.mark.parametrize("kind", ["thing", "tissue", "animal"])
def test_a_click_in_a_leak_of_a_map_that_is_not_sure_takes_the_leak_and_little_else(kind: str) -> None:
    for seen in sights(kind, 6, UNSEEN):
        truth = seen.truth == INSIDE
        near = cv2.dilate(seen.truth, np.ones((81, 81), np.uint8)) == INSIDE
        y, x = np.unravel_index(np.argmax(np.where(near, distances(~truth), 0)), truth.shape)
        leaking = truth | disc_mask(((float(x), float(y), 30.0),), truth.shape)
        said = np.where(leaking, np.float32(0.6), np.float32(0.2))
        asked = {"init.circles": [list(seen.start)], "init.background": [[float(x), float(y), 4.0]]}
        found = ffseg.segment(seen.image, asked, evidence=said)
        assert iou(found.mask, seen.truth) > iou(leaking, seen.truth) - 0.02


def told(said: NDArray[np.float32], circles: list[Click], points: list[Click] = []) -> ClickState:  # noqa: B006 - never changed
    """What clicks tell of a speckled image of one colour, of which something is said; a disc near its left end is known."""
    image = np.random.default_rng(3).integers(100, 140, (*said.shape, 3), np.uint8)
    y, x = np.ogrid[: said.shape[0], : said.shape[1]]
    inside = np.hypot(x - 20, y - 60) <= 6
    return state_after_all(
        ClickedImage(Appearance(image), inside, np.zeros_like(inside), said, 0.0, None), circles, points
    )


def shows(monkeypatch: pytest.MonkeyPatch, *odds: float) -> Mock:
    """Let the forest show such log odds everywhere, one after another."""
    left = iter(odds)
    forest = Mock(side_effect=lambda *given: (np.full_like(given[3].before, next(left)), given[3].before))
    monkeypatch.setattr("ffseg.evidence.hints.hints", forest)
    return forest


def test_a_click_counts_near_where_it_lies_only(monkeypatch: pytest.MonkeyPatch) -> None:
    said = np.where(np.arange(240) < 40, np.float32(3), np.float32(-3))[None].repeat(120, axis=0)
    shows(monkeypatch, 5.0)
    odds = told(said, [Click(60.0, 60.0, 4.0, True)]).odds  # 20 px from where the region ends
    assert (odds[30, :68] > 0).all()
    assert (odds[30, 90:] == -3).all()


def test_what_clicks_turned_stays_though_later_ones_show_something_else(monkeypatch: pytest.MonkeyPatch) -> None:
    said = np.where(np.arange(240) < 40, np.float32(3), np.float32(-3))[None].repeat(120, axis=0)
    shows(monkeypatch, 5.0, -5.0)
    odds = told(said, [Click(60.0, 60.0, 4.0, True), Click(200.0, 60.0, 4.0, True)]).odds
    assert (odds[30, :68] > 0).all()


def test_of_circles_and_points_the_one_deeper_in_what_is_wrong_counts_first(monkeypatch: pytest.MonkeyPatch) -> None:
    said = np.where(np.arange(240) < 120, np.float32(3), np.float32(-3))[None].repeat(120, axis=0)
    known: list[tuple[bool, bool]] = []

    def shown(
        _image: object, inside: NDArray[np.bool_], outside: NDArray[np.bool_], click: hints.Correction, _said: object
    ) -> object:
        known.append((bool(inside[60, 130]), bool(outside[60, 60])))
        return click.before, click.before

    monkeypatch.setattr("ffseg.evidence.hints.hints", shown)
    told(said, [Click(130.0, 60.0, 4.0, True)], [Click(60.0, 60.0, 4.0, False)])  # 10 px wrong, and 60
    told(said, [Click(200.0, 60.0, 4.0, True), Click(130.0, 60.0, 4.0, True)], [Click(60.0, 60.0, 4.0, False)])
    assert known == [(False, True), (True, True), (False, False), (False, True), (True, True)]


@pytest.mark.parametrize(("after", "order"), [(0, "-++"), (1, "+-+"), (2, "++-")])
def test_points_that_say_after_how_many_circles_they_came_keep_their_place(
    monkeypatch: pytest.MonkeyPatch, after: float, order: str
) -> None:
    said = np.where(np.arange(240) < 120, np.float32(3), np.float32(-3))[None].repeat(120, axis=0)
    found = list[str]()

    def shown(*given: object) -> object:
        click = cast(hints.Correction, given[3])
        found.append("+" if click.inside else "-")
        return click.before, click.before

    monkeypatch.setattr("ffseg.evidence.hints.hints", shown)
    circles = [Click(200.0, 60.0, 4.0, True, 0), Click(130.0, 60.0, 4.0, True, 1)]
    told(said, circles, [Click(60.0, 60.0, 4.0, False, after)])  # of depths 80, 10 and 60
    assert "".join(found) == order


def test_a_part_that_a_click_outside_cuts_off_stays_if_it_is_as_deep(monkeypatch: pytest.MonkeyPatch) -> None:
    said = np.full((120, 240), np.float32(-3))
    said[40:80] = 3
    said[:, 220:] = -3
    shown = np.full((60, 120), np.float32(3))
    shown[:, 40:60], shown[:, 100:104] = -3, -3
    monkeypatch.setattr("ffseg.evidence.hints.hints", lambda *given: (shown, given[3].before))
    stays = told(said, [], [Click(100.0, 60.0, 4.0, False), Click(204.0, 60.0, 1.0, False)]).stays
    assert stays[30, 80]  # 39 px high, as deep as the click outside lay
    assert not stays[30, 106]  # 12 px wide, and cut off by the second


def test_only_clicks_inside_are_looked_from_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    image, _ = halves()
    first = np.zeros(image.shape[:2], np.bool_)
    first[76:85, 36:45] = True
    look = Mock(wraps=prior.start_features)
    monkeypatch.setattr(prior, "start_features", look)
    asked = ClickedImage(Appearance(image), first, np.zeros_like(first), None, 0.0, None)
    outside = [Click(200.0, 80.0, 6.0, False), Click(210.0, 40.0, 6.0, False)]
    for circles, looks in (([], 1), ([Click(60.0, 40.0, 6.0, True)], 2)):
        assert state_after_all(asked, circles, outside) is not None
        assert look.call_count == looks


def test_a_mask_of_what_lies_outside_may_be_a_single_pixel() -> None:
    image, _ = halves()
    outside = np.zeros(image.shape[:2], np.uint8)
    outside[81, 201] = 1  # neither row nor column is one of those that are looked at
    start = {"init.center": [40, 80], "init.radius": 12, "edges.source": "hints"}
    found = ffseg.segment(image, start, background=outside)
    assert found.mask[80, 40]
    assert not found.mask[81, 201]


def test_one_click_more_asks_the_forest_once_more(monkeypatch: pytest.MonkeyPatch) -> None:
    said = np.where(np.arange(240) < 42, np.float32(3), np.float32(-3))[None].repeat(120, axis=0)
    forest = shows(monkeypatch, 5.0, 4.0, 3.0)
    clicks = [Click(x, 60.0, 4.0, True) for x in (60.0, 120.0, 180.0)]
    for number in (1, 2, 3, 3):
        told(said, clicks[:number])
    assert forest.call_count == 3


def test_one_more_of_clicks_in_order_asks_the_forest_once_more(monkeypatch: pytest.MonkeyPatch) -> None:
    said = np.where(np.arange(240) < 44, np.float32(3), np.float32(-3))[None].repeat(120, axis=0)
    forest = shows(monkeypatch, 5.0, -5.0, 4.0)
    circles = [Click(60.0, 60.0, 4.0, True, 0), Click(200.0, 60.0, 4.0, True, 1)]  # the second is the deepest of all
    for count, points in ((1, []), (1, [Click(30.0, 20.0, 4.0, False, 1)]), (2, [Click(30.0, 20.0, 4.0, False, 1)])):
        told(said, circles[:count], points)
    assert forest.call_count == 3


def test_a_map_that_takes_the_first_start_for_outside_does_not_count() -> None:
    image, truth = halves()
    wrong = np.where(truth == INSIDE, np.float32(0.1), np.float32(0.9))
    asked = {"init.circles": [[40, 80, 12]], "init.background": [[200, 80, 12]]}
    assert iou(ffseg.segment(image, asked, evidence=wrong).mask, truth) > 0.9


def test_no_contour_grows_from_a_click_that_mends_a_rim() -> None:
    """On clear edges the contour from the small one beyond the disc filled all else, and counted."""
    y, x = np.mgrid[:300, :300]
    image = np.where(np.hypot(x - 150, y - 150) <= 60, np.uint8(200), np.uint8(60))
    truth = np.where(np.hypot(x - 150, y - 150) <= 60, np.uint8(INSIDE), np.uint8(0))
    assert iou(ffseg.segment(image, {"init.circles": [[150, 150, 10], [150, 88, 1]]}).mask, truth) > 0.9


@pytest.mark.parametrize("radius", [3.0, None])
def test_things_of_other_contrast_and_size_are_each_judged_by_their_own_edges(radius: float | None) -> None:
    """Edges were compared with those of all, starts that lay near edges ended the trial, and small ones were no starts."""
    rng, image, circles = np.random.default_rng(4), np.full((300, 400), 70.0), []
    truth, draw = np.zeros(image.shape, np.uint8), disc_of(image.shape)
    for row in range(3):
        for column in range(4):
            middle, size = (50 + 100 * column, 50 + 100 * row), 8 + 2 * (row + column)
            inside = draw(*middle, size)
            image[inside], truth[inside] = rng.choice([110, 125, 220]), INSIDE
            circles.append([*middle, radius or 0.25 * size])
    image = cv2.GaussianBlur(image, (0, 0), 1.0) + rng.normal(0, 6, image.shape)
    found = ffseg.segment(np.clip(image, 0, 255).astype(np.uint8), {"init.circles": circles})
    assert (found.source, found.score > 0.95) == ("gradient", True)
    assert iou(found.mask, truth) > 0.95


def test_starts_in_many_things_are_samples_of_them() -> None:
    """The prior leaked from the first, a small thing in noise, and later clicks only added to that: IoU .14."""
    rng, image, circles = np.random.default_rng(28), np.full((600, 800), 60.0), list[Circle]()
    truth, draw = np.zeros(image.shape, np.uint8), disc_of(image.shape)
    for middle, size in (((211, 580), 7), ((150, 380), 9), ((712, 46), 10), ((350, 205), 11), ((231, 342), 9)):
        inside = draw(*middle, size)
        image[inside], truth[inside] = rng.uniform(110, 180), INSIDE
        circles.append((*middle, 3.0))
    image = cv2.GaussianBlur(image, (0, 0), 1.3) + rng.normal(0, 25, image.shape)
    found = ffseg.segment(np.clip(image, 0, 255).astype(np.uint8), {"init.circles": circles})
    assert (found.source, iou(found.mask, truth) > 0.6) == ("hints", True)


def test_a_hundred_starts_are_no_corrections(monkeypatch: pytest.MonkeyPatch) -> None:
    """The forest of clicks was asked once a start: nine hundred took a minute."""
    monkeypatch.setattr(hints, "hints", lambda *_: pytest.fail("the forest of clicks was asked"))
    rng, image = np.random.default_rng(1), np.full((300, 300), 60.0)
    y, x = np.indices(image.shape)
    truth = np.where(np.hypot(x % 30 - 15, y % 30 - 15) <= 8, np.uint8(INSIDE), np.uint8(0))
    image = np.where(truth == INSIDE, 140.0, image) + rng.normal(0, 30, image.shape)
    circles = [[15 + 30 * column, 15 + 30 * row, 3] for row in range(10) for column in range(10)]
    found = ffseg.segment(np.clip(image, 0, 255).astype(np.uint8), {"init.circles": circles, "edges.source": "hints"})
    assert (found.source, iou(found.mask, truth) > 0.75) == ("hints", True)
