"""Boxes that hold the object: what lies outside is background, and the contour ends where the object does."""

from collections.abc import Iterator
from pathlib import Path
from statistics import mean

import cv2
import numpy as np
import pytest
from commands import Command
from numpy.typing import NDArray

import ffseg
from ffseg.errors import SegmentationError
from ffseg.evidence import box as evidence
from ffseg.evidence.forest import Model, to_bytes
from ffseg.io.starts import Start
from ffseg.learning.drawn.clicks import Clicks
from ffseg.learning.drawn.sights import sights
from ffseg.metrics import INSIDE, iou
from ffseg.parameter_files import load_params
from ffseg.picking.open_image import OpenImage
from ffseg.picking.picks import ImagePicks
from tests.masks import read_mask
from tests.stumps import stump

Picture = NDArray[np.uint8]
KINDS = ("thing", "animal", "organ", "nuclei", "colony", "field")
UNSEEN = 300_000
"""Number of the first picture: the forest has learned from the first ones, and choices were made on those from 100,000 on."""


def objects(kind: str, count: int) -> Iterator[tuple[Picture, Picture, tuple[int, int, int, int]]]:
    """Drawn objects, their truths, and the boxes (x, y, width, height) round them, of four fifths of the picture at most."""
    found = 0
    for seen in sights(kind, 4 * count, UNSEEN):
        x, y, width, height = cv2.boundingRect((seen.truth == INSIDE).astype(np.uint8))
        if width * height <= 0.8 * seen.truth.size and found < count:
            found += 1
            yield seen.image, seen.truth, (x, y, width, height)


def prompt(box: tuple[int, int, int, int]) -> list[float]:
    x, y, width, height = box
    return [x - 0.5, y - 0.5, x + width - 0.5, y + height - 0.5]


def grabcut(image: Picture, box: tuple[int, int, int, int]) -> NDArray[np.bool_]:
    labels = np.zeros(image.shape[:2], np.uint8)
    cv2.setRNGSeed(0)
    cv2.grabCut(image, labels, box, np.zeros((1, 65)), np.zeros((1, 65)), 5, cv2.GC_INIT_WITH_RECT)
    return (labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD)


def scene() -> tuple[Picture, Picture]:
    """A dark disc on light ground beside another, and its truth."""
    image = np.full((140, 200, 3), 190, np.uint8)
    cv2.circle(image, (60, 70), 30, (60, 90, 120), -1)
    cv2.circle(image, (150, 70), 30, (60, 90, 120), -1)
    image = np.clip(image + np.random.default_rng(0).normal(0, 6, image.shape), 0, 255).astype(np.uint8)
    y, x = np.mgrid[:140, :200]
    return image, np.where(np.hypot(x - 60, y - 70) <= 30, INSIDE, 0).astype(np.uint8)


BOX = [25.0, 35.0, 95.0, 105.0]


def test_what_is_of_one_colour_is_not_cut_by_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a grey of 60 OpenCV's cut took 3 s for 30x30 pixels; which greys do is by their last bits."""
    monkeypatch.setattr("ffseg.evidence.box.grabcut_mask", lambda *_: pytest.fail("cut"))
    assert ffseg.segment(np.full((50, 50, 3), 60, np.uint8), {"init.boxes": [[10, 10, 30, 30]]}).mask.any()


def test_boxes_that_stand_are_looked_at_once_and_without_a_cut_while_the_hand_moves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each move of the hand looked at every box anew, 50 ms each, most of it in the cut."""
    image, _ = scene()
    picture, looked = OpenImage(image + np.uint8(1)), list[bool]()
    look = evidence.in_box
    monkeypatch.setattr(evidence, "in_box", lambda *args, cut: looked.append(cut) or look(*args, cut=cut))
    cuts = list[int]()
    cutting = evidence.grabcut_mask
    monkeypatch.setattr(evidence, "grabcut_mask", lambda *args: cuts.append(1) or cutting(*args))
    boxes = (tuple(BOX), (115.0, 35.0, 185.0, 105.0))
    for x in range(4):
        found = picture.find(ImagePicks(((60.0 + x, 70.0, 3.0),), boxes=boxes), load_params(), None, quick=True)
        assert found.mask[70, 60]
        assert found.mask[70, 150]
    assert (looked, cuts) == ([False, False], [])
    picture.find(ImagePicks(((60.0, 70.0, 3.0),), boxes=boxes), load_params(), None)
    assert (looked, cuts) == ([False, False, True, True], [1, 1])


def test_boxes_round_drawn_objects_serve_at_least_as_well_as_they_serve_grabcut() -> None:
    """Six kinds of drawings; before, what stood in the box was what the box itself grew into."""
    ours, theirs = [], []
    for kind in KINDS:
        for image, truth, box in objects(kind, 2):
            found = ffseg.segment(image, {"init.boxes": [prompt(box)]})
            assert found.source == "box"
            ours.append(iou(found.mask, truth))
            theirs.append(iou(grabcut(image, box), truth))
    assert mean(ours) >= mean(theirs)
    assert mean(ours) > 0.75


def figure(seed: int) -> tuple[Picture, Picture]:
    """A light trunk with a brown head and dark brown legs on rough ground that is brown too, and its truth."""
    image, truth = np.empty((260, 200, 3), np.float64), np.zeros((260, 200), np.uint8)
    image[:] = 70, 90, 110
    for on, legs, trunk, head in (
        (image, (40, 60, 120), (225, 225, 225), (60, 110, 150)),
        (truth, INSIDE, INSIDE, INSIDE),
    ):
        cv2.rectangle(on, (82, 150), (94, 230), legs, -1)
        cv2.rectangle(on, (106, 150), (118, 230), legs, -1)
        cv2.ellipse(on, (100, 125), (30, 50), 0, 0, 360, trunk, -1)
        cv2.ellipse(on, (100, 58), (17, 22), 0, 0, 360, head, -1)
    rng = np.random.default_rng(seed)
    rough = 84 * cv2.GaussianBlur(rng.normal(size=truth.shape), (0, 0), 2)[..., None]
    return np.clip(image + rough + rng.normal(0, 7, image.shape), 0, 255).astype(np.uint8), truth


def test_parts_of_other_colours_than_the_middle_belong_to_the_object() -> None:
    """As photographs' things have them; before, the legs were lost to the ground: .91 in the mean."""
    overlaps = []
    for seed in range(3):
        image, truth = figure(seed)
        overlaps.append(iou(ffseg.segment(image, {"init.boxes": [prompt(cv2.boundingRect(truth))]}).mask, truth))
    assert mean(overlaps) > 0.95


@pytest.mark.parametrize(("left", "right"), [(20.5, 24.5), (0.5, 58.5)])
def test_boxes_that_show_hardly_any_colours(left: float, right: float) -> None:
    """Few pixels and nearly all, on even ground, grey and in colour: no colours can be told apart."""
    for shape in ((50, 60), (50, 60, 3)):
        found = ffseg.segment(np.full(shape, 120, np.uint8), {"init.boxes": [[left, left / 20, right, 48.5]]})
        assert found.mask.shape == (50, 60)


@pytest.mark.parametrize(
    "params",
    [
        *({"method": name} for name in ("freeform", "levelset", "snake", "paper")),
        {"edges.source": "gradient"},
        {"edges.source": "prior"},
        {"edges.canny": [6, 15]},
        {"contour.balloon": -6.0},
    ],
)
def test_the_object_in_the_box_and_nothing_outside_whatever_decides(params: dict[str, object]) -> None:
    """The method as printed stops two or three pixels before an edge."""
    image, truth = scene()
    found = ffseg.segment(image, {"init.boxes": [BOX], **params})
    assert iou(found.mask, truth) > (0.75 if params == {"method": "paper"} else 0.9)
    assert not found.mask[:, 96:].any()


def test_a_map_of_evidence_and_edges_of_ones_own_decide_in_the_box() -> None:
    """A map says where both discs end, and the contour starts in its depth: here in a corner, where the box's middle is not."""
    image, _ = scene()
    inside = np.zeros((140, 200), np.float32)
    inside[38:60, 28:120] = 1
    found = ffseg.segment(image, {"init.boxes": [BOX]}, evidence=inside)
    truth = np.where((inside > 0) & (np.arange(200) <= 95), INSIDE, 0).astype(np.uint8)
    assert found.source == "evidence"
    assert iou(found.mask, truth) > 0.9
    open_edges = ffseg.edge_map(np.full((140, 200), 90, np.uint8), ffseg.load_params().edges)
    filled = ffseg.segment(image, {"init.boxes": [BOX]}, edges=open_edges)
    assert filled.mask[40:100, 30:90].mean() > 0.95
    assert not filled.mask[:, 96:].any()
    assert filled.score < 0.5, "nothing shows where it ends"


def test_an_enlarged_picture_gives_the_same() -> None:
    image, _ = scene()
    large = cv2.resize(image, None, fx=4, fy=4, interpolation=cv2.INTER_CUBIC)
    box = [4 * side + 1.5 for side in BOX]
    one = ffseg.segment(image, {"init.boxes": [BOX]}).mask.repeat(4, axis=0).repeat(4, axis=1)
    other = ffseg.segment(large, {"init.boxes": [box]}).mask
    assert iou(other, one.astype(np.uint8) * np.uint8(255)) > 0.97


def test_two_boxes_hold_two_objects_and_a_circle_in_one_leaves_the_other() -> None:
    image, _ = scene()
    boxes = [BOX, [115.0, 35.0, 185.0, 105.0]]
    assert ffseg.segment(image, {"init.boxes": boxes}).num_regions == 2
    assert ffseg.segment(image, {"init.boxes": boxes, "init.circles": [[60, 70, 8]]}).num_regions == 2
    with pytest.raises(SegmentationError, match=r"start circle at \(5, 5\) lies in no box, and .* close in"):
        ffseg.segment(image, {"init.boxes": boxes, "init.circles": [[5, 5, 2]], "contour.balloon": -1})


def test_a_circle_in_no_box_finds_another_object_or_what_a_box_has_cut_off() -> None:
    """It was refused, and what lay outside all boxes could not be had at all."""
    image, truth = scene()
    both = np.maximum(truth, np.roll(truth, 90, axis=1))  # the other disc lies 90 px to the right
    found = ffseg.segment(image, {"init.boxes": [BOX], "init.circles": [[150, 70, 5]]})
    assert iou(found.mask, both) > 0.95
    cut = {"init.boxes": [[*BOX[:2], 70.0, BOX[3]]]}
    assert iou(ffseg.segment(image, cut).mask, truth) < 0.8
    assert iou(ffseg.segment(image, cut | {"init.circles": [[80, 70, 3]]}).mask, truth) > 0.95


def test_clicks_correct_what_a_box_holds() -> None:
    """Each click of a simulated user took the starts of the box away, and lost a quarter of the IoU."""
    overlaps = []
    for kind in KINDS:
        image, truth, box = next(objects(kind, 1))
        clicks, mask = Clicks(), np.zeros(truth.shape, np.bool_)
        for _ in range(3):
            init = {"circles": clicks.inside, "background": clicks.outside, "boxes": [prompt(box)]}
            mask = ffseg.segment(image, {f"init.{name}": value for name, value in init.items()}).mask
            overlaps.append(iou(mask, truth))
            clicks = clicks.next(mask, truth, 5.0)
    box_alone, first, second = np.reshape(overlaps, (-1, 3)).mean(axis=0)
    assert box_alone < first < second


@pytest.mark.parametrize("more", [{"init.background": [[3, 3]]}, {"init.circles": [[60, 60, 4]]}])
def test_clicks_beside_a_box_that_closes_in_leave_its_object(more: dict[str, object]) -> None:
    image = np.full((120, 160), 60, np.uint8)
    cv2.circle(image, (60, 60), 25, 200, -1)
    found = ffseg.segment(image, {"init.boxes": [[25, 25, 95, 95]], "contour.balloon": -8, **more})
    assert found.mask[60, 60]
    assert not found.mask[30, 30]


def test_a_box_outside_the_domain_is_refused_by_every_method(tmp_path: Path) -> None:
    domain = np.zeros((120, 160), np.uint8)
    domain[:, 120:] = 255
    cv2.imwrite(str(tmp_path / "domain.png"), domain)
    own = {"init.boxes": [[10, 10, 60, 60]], "domain.mask": str(tmp_path / "domain.png")}
    for method in ("freeform", "snake", "levelset"):
        with pytest.raises(ffseg.SegmentationError, match="in the domain and in a box"):
            ffseg.segment(np.full((120, 160), 90, np.uint8), {**own, "method": method})


def test_a_click_outside_in_the_middle_of_a_box_leaves_a_ring() -> None:
    """It was refused: the start of a box that nothing is known of lies there."""
    image = np.full((140, 140, 3), 190, np.uint8)
    y, x = np.mgrid[:140, :140]
    ring = (np.hypot(x - 70, y - 70) <= 50) & (np.hypot(x - 70, y - 70) > 20)
    image[ring] = (60, 90, 120)
    image = np.clip(image + np.random.default_rng(0).normal(0, 6, image.shape), 0, 255).astype(np.uint8)
    found = ffseg.segment(image, {"init.boxes": [[18, 18, 122, 122]], "init.background": [[70, 70, 5]]})
    assert iou(found.mask, np.where(ring, INSIDE, 0).astype(np.uint8)) > 0.95


@pytest.mark.parametrize(("method", "parts"), [("freeform", 2), ("levelset", 2), ("snake", 1)])
def test_a_box_of_two_objects_has_both_where_the_method_can(method: str, parts: int) -> None:
    """The snake is one contour, and has one of them."""
    image, _ = scene()
    found = ffseg.segment(image, {"init.boxes": [[25, 35, 185, 105]], "method": method})
    assert (found.source, found.num_regions) == ("box", parts)


def test_a_click_in_a_picked_box_is_not_lost() -> None:
    placed = Start(60.0, 70.0, 8.0, boxes=((25.0, 35.0, 95.0, 105.0),)).placed(ffseg.load_params(), (140, 200))
    assert placed.init.circles == ((60.0, 70.0, 8.0),)


@pytest.mark.parametrize("shape", [(1, 1), (3, 200), (60, 80)])
def test_a_box_that_is_the_whole_image_leaves_its_own_edges(shape: tuple[int, int]) -> None:
    image = np.full(shape, 120, np.uint8)
    whole = [-0.5, -0.5, shape[1] - 0.5, shape[0] - 0.5]
    found = ffseg.segment(image, {"init.boxes": [whole]})
    assert (found.source, found.score < 0.5) == ("gradient", True)


def test_boxes_that_cannot_be() -> None:
    image, _ = scene()
    for params, said in (
        ({"init.boxes": [[30, 30, 30, 50]]}, r"the box \[30, 30, 30, 50\] needs x0 < x1"),
        ({"init.boxes": [[30.2, 30, 30.7, 50]]}, r"the box \[30.2, 30, 30.7, 50\] holds no pixel's centre"),
        ({"edges.source": "box"}, "edges.source: box needs a box; give one with --box"),
    ):
        with pytest.raises(SegmentationError, match=said):
            ffseg.segment(image, params)


def test_commands_take_a_box(ffseg_command: Command, tmp_path: Path) -> None:
    image, truth = scene()
    cv2.imwrite(str(tmp_path / "discs.png"), image)
    ffseg_command("segment", tmp_path / "discs.png", tmp_path / "mask.png", "--box", "25,35,71,71", code=0)
    mask = read_mask(tmp_path / "mask.png")
    assert iou(mask, truth) > 0.9
    run = ("run", tmp_path / "discs.png", "--out", tmp_path / "out", "--box", "25,35,71,71")
    assert ffseg_command(*run).returncode == 0
    assert np.array_equal(read_mask(tmp_path / "out" / "masks" / "discs.png"), mask)


@pytest.mark.parametrize("method", ["freeform", "paper", "snake"])
def test_what_closes_in_keeps_to_the_domain(method: str) -> None:
    """It begins outside where the box does; that stood in the region."""
    image, domain = np.full((200, 300), 150, np.uint8), np.full((200, 300), 255, np.uint8)
    cv2.circle(image, (150, 100), 55, 90, -1)
    domain[60:70] = 0
    params = {"init.boxes": [[2, 2, 297, 197]], "contour.balloon": -8.0, "edges.source": "gradient", "method": method}
    found = ffseg.segment(image, params, domain=domain)
    assert found.mask[120, 150]
    assert not found.mask[domain == 0].any()


@pytest.fixture
def red(tmp_path: Path) -> str:
    """A model to which red is inside."""
    path = tmp_path / "red.ffmodel"
    path.write_bytes(to_bytes(Model(stump("red@1.5", 20.0, 6))))
    return str(path)


GREY, LIGHT, RED = (120, 120, 120), (190, 190, 190), (60, 70, 170)


def coloured(ground: tuple[int, int, int], right: tuple[int, int, int]) -> Picture:
    """The disc of the scene, grey, on ground of a colour, and its right half of another."""
    truth = scene()[1]
    image = np.full((*truth.shape, 3), ground, np.uint8)
    image[truth == INSIDE] = GREY
    image[:, 60:][truth[:, 60:] == INSIDE] = right
    return image


def test_a_model_that_takes_what_lies_beside_a_box_does_not_decide_in_it(red: str) -> None:
    found = ffseg.segment(coloured(ground=RED, right=GREY), {"init.boxes": [BOX], "edges.model": red})
    assert found.source == "model"
    assert iou(found.mask, scene()[1]) > 0.95


def test_a_model_that_takes_nothing_beside_a_box_decides_in_it(red: str) -> None:
    """Both halves differ from the ground; the model knows one of them."""
    image, truth = coloured(ground=LIGHT, right=RED), scene()[1]
    assert iou(ffseg.segment(image, {"init.boxes": [BOX]}).mask, truth) > 0.95
    half = np.where(np.arange(200) < 60, np.uint8(0), truth)
    assert iou(ffseg.segment(image, {"init.boxes": [BOX], "edges.model": red}).mask, half) > 0.95


def test_beside_a_box_that_is_all_there_is_a_circle_is_a_click_as_any() -> None:
    """Nothing was inside for such a box, and the click got no more than its own disc."""
    image, truth = scene()
    found = ffseg.segment(image, {"init.boxes": [[-0.5, -0.5, 199.5, 139.5]], "init.circles": [[60, 70, 5]]})
    assert iou(found.mask, truth) > 0.9
