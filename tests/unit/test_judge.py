"""No result looks sure that has no boundary of its own."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from commands import Command

import ffseg
from ffseg.learning.drawn.clicks import Clicks
from ffseg.learning.drawn.sights import KINDS, sights
from ffseg.metrics import iou
from ffseg.parameters import click_radius
from tests.masks import box_round
from tests.scenes import START, START_RADIUS, scene


def disc(x: int = 320, y: int = 240, radius: int = 50) -> np.ndarray:
    image = np.full((480, 640, 3), 255, np.uint8)
    cv2.circle(image, (x, y), radius, (0, 0, 255), -1)
    return image


@pytest.mark.parametrize(
    ("image", "doubt", "method"),
    [
        (np.zeros((480, 640), np.uint8), "filled", "freeform"),
        (np.full((200, 300), 90, np.uint8), "filled", "levelset"),
        (np.zeros((1, 1), np.uint8), "empty", "freeform"),
        (disc(120, 100), "filled", "freeform"),  # the start misses it
    ],
)
def test_a_region_without_a_boundary_of_its_own_is_doubted(image: np.ndarray, doubt: str, method: str) -> None:
    found = ffseg.segment(image, method=method)
    assert found.doubts == (doubt,)
    assert found.score < 0.2
    assert any("region" in message for message in found.messages)


def test_a_region_whose_outline_is_the_border_is_doubted() -> None:
    image = np.full((200, 300), 120, np.uint8)
    image[60:140, 100:240] = 20  # a fifth of the image; the rest runs all round it
    found = ffseg.segment(image, {"init.center": [40, 100], "init.radius": 10})
    assert found.doubts == ("border",)
    assert found.score <= 0.2
    assert "of the region's outline is the border of the image" in "".join(found.messages)


def test_no_region_fills_more_than_all_of_its_domain(tmp_path: Path) -> None:
    """Nor does it settle on the edge three pixels beyond the domain's limit."""
    domain = np.where(disc(320, 240, 100)[..., 1] == 0, np.uint8(255), np.uint8(0))
    assert cv2.imwrite(str(tmp_path / "domain.png"), domain)
    found = ffseg.segment(disc(320, 240, 103), {"domain.mask": str(tmp_path / "domain.png")})
    assert 0.999 < found.mask.sum() / np.count_nonzero(domain) < 1.001
    assert re.match(r"the region fills (99\.9|100\.0) % of the domain", found.messages[0])


def test_a_floor_that_fills_the_lower_half_is_not_doubted() -> None:
    image = np.vstack([np.full((200, 640), 60, np.uint8), np.full((280, 640), 160, np.uint8)])
    found = ffseg.segment(image, {"init.center": [320, 400]})
    assert (found.doubts, found.messages) == ((), ())
    assert found.score > 0.9


def test_what_is_bounded_all_round_is_not_doubted() -> None:
    assert ffseg.segment(disc()).doubts == ()
    start = {"init.center": list(START), "init.radius": START_RADIUS}
    assert [ffseg.segment(scene(number).image, start).doubts for number in range(6)] == [()] * 6


def test_a_contour_that_was_stopped_is_doubted() -> None:
    found = ffseg.segment(disc(radius=200), {"contour.max_iterations": 5})
    assert found.doubts == ("early",)
    assert found.score <= 0.5
    assert "stopped after 5 iterations" in "".join(found.messages)


def test_nearly_done_is_not_done() -> None:
    """What lies below is as a map says, but the contour has not come to rest: the score was .91."""
    y, x = np.indices((200, 240))
    said = np.where(np.hypot(x - 120, y - 100) < 60, np.float32(0.97), np.float32(0.03))
    params = {"init.center": [120, 100], "init.radius": 10, "contour.max_iterations": 8}
    found = ffseg.segment(np.full((200, 240), 120, np.uint8), params, evidence=said)
    assert (found.doubts, found.score) == (("early",), 0.5)


def test_the_given_domain_counts_and_not_what_rivals_leave() -> None:
    domain = np.zeros((480, 640), np.uint8)
    domain[150:330, 200:440] = 255
    assert ffseg.segment(np.full((480, 640), 90, np.uint8), domain=domain).doubts == ("filled",)
    assert ffseg.segment(disc(), {"region.border": "outside"}).doubts == ()


def test_a_start_on_both_sides_of_edges_is_doubted() -> None:
    image = np.where(np.arange(160) // 11 % 2 == 0, 60, 190).astype(np.uint8)[None].repeat(140, axis=0)
    found = ffseg.segment(image, {"init.center": [80, 70], "init.radius": 25, "edges.source": "gradient"})
    assert "start" in found.doubts
    assert found.score <= 0.5


def test_a_clear_boundary_round_two_things_is_no_surer_than_either() -> None:
    """A start in the middle of a disc of two halves: the outline of both is as clear as can be."""
    y, x = np.indices((200, 240))
    image = np.where(np.hypot(x - 120, y - 100) < 60, np.where(x < 120, 20, 230), 120).astype(np.uint8)
    found = ffseg.segment(image, {"init.center": [120, 100], "init.radius": 25, "edges.source": "gradient"})
    assert (found.doubts, found.score) == (("start",), 0.5)


def test_the_score_is_the_iou_in_the_mean_of_drawings() -> None:
    """Within two standard errors of 44 results whose IoU differs from the score by .2."""
    apart = []
    for kind in KINDS:
        for seen in sights(kind, 4, 100_000):
            x, y, radius = seen.start
            found = ffseg.segment(seen.image, {"init.center": [x, y], "init.radius": radius})
            apart.append(found.score - iou(found.mask, seen.truth))
    assert abs(np.mean(apart)) < 2 * 0.2 / np.sqrt(len(apart))


def test_clicks_make_surer_as_they_make_better() -> None:
    """After three clicks 22 results had a score of .72 for an IoU of .84; the IoU differs from the score by .15."""
    apart = []
    for kind in KINDS:
        for seen in sights(kind, 2, 100_000):
            clicks, found = Clicks(), None
            for _ in range(3):
                mask = np.zeros(seen.truth.shape, np.bool_) if found is None else found.mask
                clicks = clicks.next(mask, seen.truth, click_radius(mask.shape))
                init = {"init.circles": clicks.inside, "init.background": clicks.outside}
                found = ffseg.segment(seen.image, init)
            assert found is not None
            apart.append(found.score - iou(found.mask, seen.truth))
    assert abs(np.mean(apart)) < 2 * 0.15 / np.sqrt(len(apart))


def test_what_a_box_is_too_large_for_does_not_look_sure() -> None:
    """A box a third of its side too large on each side, in which something else is found: the score was .91."""
    seen = next(sights("organ", 1, 100_000))
    box = box_round(seen.truth, 0.35).tolist()
    found = ffseg.segment(seen.image, {"init.boxes": [box]})
    assert iou(found.mask, seen.truth) < 0.5
    assert found.score < 0.87


def test_what_fits_its_box_is_not_doubted_for_that() -> None:
    """Most of the outline of a book with a corner cut off is its box: the score was .4."""
    rng = np.random.default_rng(0)
    image = np.full((140, 200, 3), 190, np.uint8)
    cv2.fillConvexPoly(image, np.array([[60, 40], [140, 40], [140, 60], [100, 100], [60, 100]]), (60, 90, 120))
    image = np.clip(image + rng.normal(0, 6, image.shape), 0, 255).astype(np.uint8)
    found = ffseg.segment(image, {"init.boxes": [[59.5, 39.5, 140.5, 100.5]]})
    assert (found.source, found.doubts) == ("box", ())
    assert found.score > 0.7


def test_a_run_says_how_many_are_doubtful(ffseg_command: Command, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    for name, image in (("a.png", np.zeros((60, 80), np.uint8)), ("b.png", disc())):
        cv2.imwrite(str(tmp_path / "in" / name), image)
    command = ("run", tmp_path / "in", "--out", tmp_path / "out")
    assert "1 fill their image; of 2" in ffseg_command(*command).stdout
    told = json.loads(ffseg_command(*command, "--json").stdout)
    assert (told["doubts"], [row["doubts"] for row in told["images"]]) == ({"filled": 1}, ["filled", ""])
