"""All things of a kind: masks with many parts, models that tell them all, and maps of which all is wanted."""

from pathlib import Path

import numpy as np
import pytest
from commands import Command

import ffseg
from ffseg.evidence.forest import to_bytes
from ffseg.image.appearance import WORKING_SIZE, size_to_see
from ffseg.image.parts import connected_parts
from ffseg.learning.examples import Example, samples, share_apart, size_of_things
from ffseg.learning.training import SampleSet, learn
from ffseg.metrics import iou
from tests.many_things import SHAPE, cells, deepest, disc, large
from tests.masks import read_mask, write_image


def learned(folder: Path, *seeds: int) -> str:
    pytest.importorskip("lightgbm")
    model = learn(SampleSet([samples(Example(*cells(seed), None, 8.0)) for seed in seeds]))
    (folder / "cells.ffmodel").write_bytes(to_bytes(model))
    return str(folder / "cells.ffmodel")


@pytest.mark.parametrize("seeds", [(1,), (1, 2)], ids=["one mask", "two masks"])
def test_a_model_of_many_things_takes_them_all(tmp_path: Path, seeds: tuple[int, ...]) -> None:
    """Only the one that the start lay in was taken; and of one mask, base and prior told that one from all others."""
    model, (image, truth) = learned(tmp_path, *seeds), cells(5)
    found = ffseg.segment(image, {"edges.model": model})
    assert iou(found.mask, truth) > 0.8
    assert not found.messages, "of starts that nobody named there is nothing to say"
    named = ffseg.segment(image, {"edges.model": model, "init.center": deepest(truth)})
    assert iou(named.mask, truth) > 0.8
    alone = ffseg.segment(image, {"edges.model": model, "region.islands": False})
    assert alone.num_regions == 1
    assert iou(alone.mask, truth) < 0.2


def test_a_model_of_one_thing_takes_one() -> None:
    pytest.importorskip("lightgbm")
    image = cells(1)[0]
    thing = disc(120, 80, 30)
    image[thing] = image[thing] // 2 + 100
    one = learn(SampleSet([samples(Example(image, np.where(thing, np.uint8(255), np.uint8(0)), None, 8.0))]))
    many = learn(SampleSet([samples(Example(*cells(2), None, 8.0))]))
    assert (one.parts, many.parts) == (False, True)
    assert one.about["base"]["corrected"]
    assert one.about["prior"]["asked"]
    assert [many.about["base"]["corrected"], many.about["prior"]["asked"]] == [False, False]


def test_models_of_small_things_see_them_less_reduced(tmp_path: Path) -> None:
    """Cells 10 px deep in a picture of 1200: at 400 pixels a side they are 3 px deep."""
    pytest.importorskip("lightgbm")
    (image, truth), other = large(0, 40), large(1, 40)
    overlaps = {}
    for size in (WORKING_SIZE, size_of_things([truth])):
        model = learn(SampleSet([samples(Example(image, truth, None, 8.0), size)]))
        (tmp_path / "cells.ffmodel").write_bytes(to_bytes(model))
        assert model.size == size
        overlaps[size] = iou(ffseg.segment(other[0], {"edges.model": str(tmp_path / "cells.ffmodel")}).mask, other[1])
    usual, seen = overlaps
    assert seen == 1200
    assert overlaps[seen] > max(0.8, overlaps[usual] + 0.05)


def test_the_size_at_which_things_are_seen() -> None:
    one = np.where(disc(120, 80, 30), np.uint8(255), np.uint8(0))
    assert size_of_things([]) == size_of_things([np.tile(one, (1, 1))]) == WORKING_SIZE
    large = np.tile(np.where(disc(120, 80, 30), np.uint8(255), np.uint8(0)), (8, 6))  # 1440 px wide, 31 px deep
    assert size_of_things([large]) == 720
    assert size_of_things([large, one, large]) == 720
    scribbled = np.where(large > 0, np.uint8(255), np.uint8(128))
    scribbled[::40] = 0
    assert size_of_things([scribbled]) == WORKING_SIZE, "a scribble says nothing of how deep a thing is"
    assert size_to_see((9000, 24000), 8.0) == 2400


def test_what_lies_apart_in_a_mask() -> None:
    truth = np.where(disc(40, 80, 20) | disc(200, 80, 20), np.uint8(255), np.uint8(0))
    assert share_apart(truth) == pytest.approx(0.5)
    assert share_apart(np.where(disc(40, 80, 20), truth, np.uint8(0))) == 0
    scribbled = np.where(truth == 0, np.uint8(128), truth)
    scribbled[:, :5] = 0
    assert share_apart(scribbled) == 0, "what is unknown may join them"


def test_all_parts_of_a_map_on_demand() -> None:
    """A start that lies in none of them grew in the ground."""
    image, truth = cells(3)
    told, outside = np.where(truth > 0, np.float32(0.9), np.float32(0.1)), [4, 4]
    one = ffseg.segment(image, {"init.center": deepest(truth)}, evidence=told)
    assert one.num_regions == 1
    for where in ({"init.center": deepest(truth)}, {}, {"init.center": outside}):
        every = ffseg.segment(image, {"region.islands": "all", **where}, evidence=told)
        assert iou(every.mask, truth) > 0.9
        assert any("lies in no part that is told" in said for said in every.messages) == (
            where.get("init.center") == outside
        )


def test_clicks_mend_a_few_of_many_parts(tmp_path: Path) -> None:
    """The first click left only the part that it lay in; one outside would take all parts that are no deeper than it."""
    model, (image, truth) = learned(tmp_path, 1, 2), cells(5)
    center, wrong = deepest(truth), (truth > 0) & disc(*deepest(truth), 15)
    missed = {"edges.model": model, "init.circles": [[8, 8, 3]]}
    found = ffseg.segment(image, missed)
    assert found.mask[8, 8]
    assert iou(found.mask, truth) > 0.75, "what is clicked comes to the others"
    left = ffseg.segment(image, {"edges.model": model, "init.background": [center]})
    assert not left.mask[center[1], center[0]]
    assert iou(left.mask, np.where(wrong, np.uint8(0), truth)) > 0.8


def test_an_image_with_none_of_many_things_has_an_empty_region(tmp_path: Path) -> None:
    """It was filled whole: the contour began in the middle, and the image's own edges decided."""
    model = learned(tmp_path, 1, 2)
    bare = np.clip(np.random.default_rng(9).normal(60, 8, (*SHAPE, 3)), 0, 255).astype(np.uint8)
    found = ffseg.segment(bare, {"edges.model": model})
    assert (found.mask.any(), found.contours, found.doubts, found.score) == (False, (), ("empty",), 0)
    assert found.messages == ("the model tells of none of the things that it has learned",)
    clicked = ffseg.segment(bare, {"edges.model": model, "init.circles": [[100, 80, 5]]})
    assert clicked.mask[80, 100], "who clicks means something"


def test_a_steady_film_of_many_things_may_have_none(ffseg_command: Command, tmp_path: Path) -> None:
    """A start carried into a frame without things filled it."""
    model, (image, truth) = learned(tmp_path, 1, 2), cells(5)
    bare = np.clip(np.random.default_rng(9).normal(60, 8, (*SHAPE, 3)), 0, 255).astype(np.uint8)
    for number, frame in enumerate((image, bare, image)):
        write_image(tmp_path / "film" / f"{number}.png", frame)
    film = ("run", tmp_path / "film", "--film", "--steady", "--out", tmp_path / "out", "--set", f"edges.model={model}")
    ffseg_command(*film, code=0)
    masks = [read_mask(tmp_path / "out" / "masks" / f"{number}.png") for number in range(3)]
    assert not masks[1].any()
    assert min(iou(masks[number], truth) for number in (0, 2)) > 0.8


def test_scribbles_are_said_to_mean_all(ffseg_command: Command, tmp_path: Path) -> None:
    """What is unknown between scribbles may join them, so that they show nothing apart."""
    pytest.importorskip("lightgbm")
    image, truth = cells(1)
    scribbled = np.where((truth > 0) & (np.arange(SHAPE[1]) < 140), np.uint8(255), np.uint8(128))
    scribbled[(truth == 0) & (np.arange(SHAPE[0])[:, None] % 40 < 6)] = 0
    write_image(tmp_path / "in" / "a.png", image)
    write_image(tmp_path / "truth" / "a.png", scribbled)
    said = ("learn", tmp_path / "in", "--truth", tmp_path / "truth", "--quiet", "--set", "region.islands=all")
    done = ffseg_command(*said, "--out", tmp_path / "a.ffmodel", code=0)
    assert "all that the model tells are taken" in done.stdout
    other, whole = cells(5)
    found = ffseg.segment(other, {"edges.model": str(tmp_path / "a.ffmodel")})
    assert iou(found.mask, whole) > 0.7


def test_a_place_in_each_of_many_things(ffseg_command: Command, tmp_path: Path) -> None:
    """As a detector writes them, without radii: each was a disc of a fifteenth of the shorter side, wider than the cells."""
    image, truth = cells(4)
    components = connected_parts(truth > 0)
    places = [np.argwhere(components.labels == part).mean(axis=0) for part in range(1, components.number)]
    write_image(tmp_path / "in" / "a.png", image)
    rows = [f"a,{column:.0f},{row:.0f}" for row, column in places]
    (tmp_path / "places.csv").write_text("\n".join(["image,x,y", *rows, ""]), encoding="utf-8")
    run = ("run", tmp_path / "in", "--starts", tmp_path / "places.csv", "--out", tmp_path / "out")
    ffseg_command(*run, code=0)
    assert iou(read_mask(tmp_path / "out" / "masks" / "a.png"), truth) > 0.8
