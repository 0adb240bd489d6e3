"""All things that look like the one that is picked: ``region.islands: all`` without a model."""

from pathlib import Path

import numpy as np
import pytest
from commands import Command

import ffseg
from ffseg.image.parts import connected_parts
from ffseg.metrics import iou
from tests.many_things import RADIUS, SHAPE, cells, deepest, disc
from tests.masks import read_mask, write_image

pytest.importorskip("lightgbm")
ALL = {"region.islands": "all"}


def middles(truth: np.ndarray) -> list[list[int]]:
    """The middle of each cell that lies whole in the picture, x and y."""
    components = connected_parts(truth > 0)
    whole = np.flatnonzero(components.areas >= 0.95 * np.pi * RADIUS**2)
    places = [np.argwhere(components.labels == part).mean(axis=0) for part in whole]
    return [[round(column), round(row)] for row, column in places]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_one_click_finds_all_that_look_alike(seed: int) -> None:
    """Each cell took a click of its own."""
    image, truth = cells(seed)
    place = deepest(truth)
    found = ffseg.segment(image, {**ALL, "init.center": place})
    assert (found.source, found.messages) == ("alike", ())
    assert iou(found.mask, truth) > 0.8
    assert iou(ffseg.segment(image, {"init.center": place}).mask, truth) < 0.2
    assert np.array_equal(found.mask, ffseg.segment(image, {**ALL, "init.circles": [place]}).mask)


def test_a_box_round_one_finds_all() -> None:
    image, truth = cells(4)
    (x, y), reach = deepest(truth), RADIUS + 3
    box = [x - reach, y - reach, x + reach, y + reach]
    assert iou(ffseg.segment(image, {**ALL, "init.boxes": [box]}).mask, truth) > 0.8
    other = next(one for one in middles(truth) if abs(one[0] - x) > 3 * reach)
    both = ffseg.segment(image, {**ALL, "init.boxes": [box], "init.circles": [other]})
    assert iou(both.mask, truth) > 0.8


def test_a_mask_of_some_finds_all() -> None:
    image, truth = cells(4)
    some = np.where(np.arange(SHAPE[1]) < 100, truth, np.uint8(0))
    found = ffseg.segment(image, ALL, start_mask=some)
    assert iou(found.mask, truth) > 0.8


def test_clicks_correct_what_looks_alike() -> None:
    image, truth = cells(5)
    first, *others = middles(truth)
    wrong = disc(*others[2], RADIUS + 3)
    found = ffseg.segment(image, {**ALL, "init.circles": [first, others[0]], "init.background": [others[2]]})
    assert not found.mask[others[2][1], others[2][0]]
    assert iou(found.mask, np.where(wrong, np.uint8(0), truth)) > 0.7
    bluish = (image[..., 0] > 100) & (image[..., 1] < 90)
    place = deepest(bluish.astype(np.uint8))
    more = ffseg.segment(image, {**ALL, "init.circles": [first, place]})
    assert more.mask[place[1], place[0]]


def test_nothing_outside_shows_nothing_alike() -> None:
    """What fills the picture has no surroundings to tell it from."""
    even = np.full((60, 80, 3), 120, np.uint8)
    found = ffseg.segment(even, {**ALL, "init.center": [40, 30]})
    assert found.mask.mean() > 0.99
    assert found.score < 0.05


def test_other_evidence_is_not_asked_for_what_looks_alike() -> None:
    image, truth = cells(6)
    told = np.where(truth > 0, np.float32(0.9), np.float32(0.1))
    given = {**ALL, "init.center": deepest(truth)}
    assert ffseg.segment(image, given, evidence=told).source == "evidence"
    assert ffseg.segment(image, {**given, "edges.canny": [20, 40]}).source == "gradient"
    assert ffseg.segment(image, {**given, "method": "paper"}).source == "gradient"


def test_all_alike_in_a_run(ffseg_command: Command, tmp_path: Path) -> None:
    """Of each image that its table says it of, from one place."""
    rows = ["image,kind,x,y,radius,right,bottom,value"]
    pictures = {f"{seed}.png": cells(seed) for seed in (1, 2)}
    for name, (image, truth) in pictures.items():
        write_image(tmp_path / "in" / name, image)
        x, y = deepest(truth)
        rows += [f"{name},start,{x},{y},,,,", *([f"{name},alike,,,,,,"] if name == "1.png" else [])]
    (tmp_path / "picked.csv").write_text("\n".join([*rows, ""]), encoding="utf-8")
    ffseg_command("run", tmp_path / "in", "--starts", tmp_path / "picked.csv", "--out", tmp_path / "out", code=0)
    one, two = (iou(read_mask(tmp_path / "out" / "masks" / name), truth) for name, (_, truth) in pictures.items())
    assert one > 0.8
    assert two < 0.2


def test_what_is_missing_is_named_before_anything_is_run(
    monkeypatch: pytest.MonkeyPatch, ffseg_command: Command, tmp_path: Path
) -> None:
    image, truth = cells(1)
    write_image(tmp_path / "a.png", image)
    monkeypatch.setattr("ffseg.plugins.find_spec", lambda _: None)
    done = ffseg_command("run", tmp_path / "a.png", "--out", tmp_path / "out", "--set", "region.islands=all", code=2)
    assert "finding all that look alike, need LightGBM; install it with: pip install 'ffseg[learn]'" in done.stderr
    assert not (tmp_path / "out").exists()
    with pytest.raises(ffseg.UsageError, match=r"ffseg\[learn\]"):
        ffseg.segment(image, {**ALL, "init.center": deepest(truth)})
