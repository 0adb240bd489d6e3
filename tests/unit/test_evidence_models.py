"""``edges.model``: forests and networks as what tells a contour where to stop, and forests as what finds a start."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from batches import table
from commands import Command
from tiny_onnx import pointwise

import ffseg
from ffseg.errors import ParameterError, SegmentationError
from ffseg.evidence.forest import MODEL_ODDS_RATIO, Model, to_bytes
from ffseg.evidence.recent import Recent
from ffseg.evidence.source import check_model, model_start, with_model_start
from ffseg.image.appearance import Appearance
from ffseg.metrics import iou
from ffseg.parameter_files import load_params
from ffseg.pipeline import segment
from tests.discs import disc_of
from tests.stumps import stump

SHAPE = (90, 130)
disc = disc_of(SHAPE)


START = {"init.center": [50, 28], "init.radius": 8}
SMALL, LARGE = disc(25, 30, 12), disc(90, 50, 25)


def reddened(inside: np.ndarray) -> np.ndarray:
    """Red among blue."""
    return np.where(inside[..., None], np.array([60, 70, 170], np.uint8), np.array([160, 90, 70], np.uint8))


def as_truth(inside: np.ndarray) -> np.ndarray:
    return np.where(inside, np.uint8(255), np.uint8(0))


def red_disc() -> tuple[np.ndarray, np.ndarray]:
    """A red disc with a dark line across it, among blue; and its truth."""
    image = reddened(disc(50, 45, 30))
    image[44:46, 20:80] //= 2
    return image, as_truth(disc(50, 45, 30))


@pytest.fixture
def forest(tmp_path: Path) -> str:
    red = stump("red@1.5", 20.0, 4)
    path = tmp_path / "red.ffmodel"
    path.write_bytes(to_bytes(Model(red, red)))
    return str(path)


def test_a_forest_stops_the_contour_where_it_says(forest: str) -> None:
    image, truth = red_disc()
    assert iou(ffseg.segment(image, START).mask, truth) < 0.8, "the line across stops what knows only edges"
    assert iou(ffseg.segment(image, {**START, "edges.model": forest}).mask, truth) > 0.97


@pytest.mark.parametrize("written", [0.0, -1.0, True, "2", None, [2.0]])
def test_a_model_is_as_sure_as_images_left_out_say(forest: str, written: object) -> None:
    image, truth = red_disc()
    red, scores = stump("red@1.5", 20.0, 4), []
    for ratio in (1.0, 4.0, MODEL_ODDS_RATIO, written):
        Path(forest).write_bytes(to_bytes(Model(red, red, about={"odds_ratio": ratio})))
        found = ffseg.segment(image, {**START, "edges.model": forest})
        assert iou(found.mask, truth) > 0.97
        scores.append(found.score)
    first, second, unmeasured, refused = scores
    assert first / (1 - first) == pytest.approx(4 * second / (1 - second))
    assert refused == unmeasured < second


def test_a_forest_finds_the_start(forest: str) -> None:
    image, truth = red_disc()
    for aside in (0, 40):
        found = ffseg.segment(np.roll(image, aside, axis=1), {"edges.model": forest})
        assert iou(found.mask, np.roll(truth, aside, axis=1)) > 0.97


def test_the_start_lies_in_the_largest_sure_region(forest: str) -> None:
    image, model = (
        Appearance(reddened(SMALL | LARGE), even=False),
        Model(stump("red@1.5", 20.0, 4), stump("red@1.5", 20.0, 4)),
    )
    x, y, radius = model_start(image, model, 40.0) or (0, 0, 0)
    assert np.hypot(x - 90, y - 50) < 4
    assert 10 < radius < 20
    assert model_start(image, model, 5.0)[2] == 5.0  # type: ignore[index]
    assert model_start(image, Model(model.inside, stump("x", -1.0, -4)), 5.0) is None
    assert model_start(image, Model(model.inside), 5.0) is None


def test_a_start_in_the_last_block_lies_in_the_image() -> None:
    """Where the image ends in the first pixels of a block, its middle lies outside: the start was refused as given wrongly."""
    image = Appearance(np.random.default_rng(0).integers(90, 110, (60, 805, 3), np.uint8))
    x, y, _ = model_start(image, Model(stump("x", 0.5), stump("x", 268 / 269, 4)), 40.0) or (0, 0, 0)
    assert (image.factor, x) == (3, 804)
    assert 0 <= y <= 59


def test_a_start_that_is_found_lies_beside_what_was_clicked_outside(forest: str) -> None:
    image = reddened(SMALL | LARGE)
    found = ffseg.segment(image, {"edges.model": forest, "init.background": [[90, 50, 12]]})
    assert (found.mask & LARGE).any(), "what is left of the larger disc is still the largest"
    assert not (found.mask & SMALL).any()
    assert not found.mask[disc(90, 50, 10)].any()
    found = ffseg.segment(image, {"edges.model": forest}, background=disc(90, 50, 27).view(np.uint8))
    assert iou(found.mask, as_truth(SMALL)) > 0.9


def test_circles_take_the_place_of_a_start_of_the_model_that_lies_outside(forest: str) -> None:
    own = {"edges.model": forest, "init.circles": [[25, 30, 4]]}
    found = ffseg.segment(reddened(SMALL | LARGE), {**own, "init.background": [[90, 50, 6, 1]]})
    assert iou(found.mask, as_truth(SMALL)) > 0.9


def test_a_model_without_another_start_than_what_lies_outside_says_so(forest: str) -> None:
    image = reddened(SMALL)
    with pytest.raises(SegmentationError, match="the model finds no start beside what is known to lie outside"):
        ffseg.segment(image, {"edges.model": forest}, background=disc(25, 30, 16).view(np.uint8))


def test_a_contour_that_begins_in_the_middle_for_want_of_a_start_says_so(tmp_path: Path) -> None:
    image, path = reddened(SMALL | LARGE), tmp_path / "a.ffmodel"
    path.write_bytes(to_bytes(Model(stump("light@0.7", 50.0))))
    said = "the model finds no start: the contour begins in the middle of the image"
    for named in ({}, {"init.center": [25, 30]}, {"init.circles": [[25, 30, 4]]}, {"init.boxes": [[10, 10, 40, 50]]}):
        assert (said in ffseg.segment(image, {"edges.model": str(path), **named}).messages) == (not named)


def test_points_come_after_the_start_that_a_model_finds(forest: str) -> None:
    seeds = {"init.circles": [[25, 30, 4]], "init.background": [[60, 5, 3, 1], [60, 90]]}
    params = ffseg.load_params(None, {"edges.model": forest, **seeds})
    params = with_model_start(ffseg.Scene(reddened(SMALL | LARGE), params)).params
    assert len(params.init.circles) == 2
    assert params.init.background == ((60, 5, 3, 2), (60, 90))


def test_a_model_is_asked_from_the_first_circles_and_each_click_from_all_until_then(
    forest: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = list[list[bool]]()
    circles = [(30, 30, 4), (90, 50, 4), (90, 70, 4), (70, 50, 4)]

    def said(_model: object, _image: object, start: np.ndarray) -> np.ndarray:
        asked.append([bool(start[y, x]) for x, y, _ in circles])
        return np.where(SMALL | LARGE, np.float32(0.9), np.float32(0.1))

    monkeypatch.setattr("ffseg.evidence.source.model_odds", said)
    noise = np.random.default_rng(0).integers(0, 20, (*SMALL.shape, 3), np.uint8)
    image, params = reddened(SMALL | LARGE) + noise, {"edges.model": forest, "init.center": [30, 30]}
    ffseg.segment(image, {**params, "init.circles": circles[:3]})
    first, *others = asked
    assert first == [True, True, False, False]
    assert [sum(one) for one in others] == [2, 3]
    ffseg.segment(image.copy(), {**params, "init.circles": circles})
    assert asked[3:] == [[True] * 4], "what was said before is kept"


def test_a_start_that_is_named_is_kept(forest: str) -> None:
    start = {"init.center": [25, 30], "init.radius": 4}
    found = ffseg.segment(reddened(SMALL | LARGE), {"edges.model": forest, **start})
    assert iou(found.mask, as_truth(SMALL)) > 0.9


@pytest.mark.parametrize("activation", ["none", "logistic", "softmax"])
def test_a_network_stops_the_contour_where_it_says(tmp_path: Path, activation: str) -> None:
    image, truth = red_disc()
    weights, bias = ([[0, 0, 0], [20, 0, -20]], [0, 0]) if activation == "softmax" else ([[20, 0, -20]], [0])
    path = tmp_path / "red.onnx"
    path.write_bytes(pointwise(weights, bias, squash=activation == "none"))
    settings = {"edges.model": str(path), "network.activation": activation, "network.channel": len(weights) - 1}
    assert iou(ffseg.segment(image, {**START, **settings}).mask, truth) > 0.97


def test_the_input_of_a_network_is_made_as_asked(tmp_path: Path) -> None:
    image, truth = red_disc()
    path = tmp_path / "red.onnx"
    path.write_bytes(pointwise([[-20, 0, 20]], [0]))  # blue, green, red
    keys = {"network.rgb": False, "network.size": [65, 45], "network.mean": [10, 10, 10], "network.output": "out"}
    assert iou(ffseg.segment(image, {**START, "edges.model": str(path), **keys}).mask, truth) > 0.95  # at half its size


@pytest.mark.parametrize(("key", "value"), [("network.output", "nothing"), ("network.channel", 5)])
def test_a_network_asked_for_what_it_has_not_fails_in_one_sentence(tmp_path: Path, key: str, value: object) -> None:
    path = tmp_path / "red.onnx"
    path.write_bytes(pointwise([[20, 0, -20]], [0]))
    with pytest.raises(SegmentationError, match="red.onnx") as caught:
        ffseg.segment(red_disc()[0], {"edges.model": str(path), key: value})
    assert "\n" not in str(caught.value)
    assert "network.output" in str(caught.value)


@pytest.mark.parametrize("name", ["a.onnx", "a.ffmodel", "a.txt"])
def test_what_is_no_model_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"hello")
    with pytest.raises(ParameterError, match=name):
        check_model(str(path))
    with pytest.raises(ParameterError, match=name):
        check_model(str(tmp_path / f"none-{name}"))


@pytest.mark.parametrize(("bit", "command"), [(96, "segment"), (247, "run")])  # divides by zero; reads where nothing is
def test_a_network_with_one_bit_turned_ends_no_command(tmp_path: Path, bit: int, command: str) -> None:
    data = bytearray(pointwise([[20, 0, -20]], [0]))
    data[bit // 8] ^= 1 << bit % 8
    path, image, out = tmp_path / "bad.onnx", tmp_path / "a.png", tmp_path / "out"
    path.write_bytes(data)
    cv2.imwrite(str(image), red_disc()[0])
    with pytest.raises(ParameterError, match=r"bad\.onnx: (reading or running it ends OpenCV \(SIG|it is no network)"):
        check_model(str(path))  # an older OpenCV may refuse by itself
    with pytest.raises(ParameterError, match=r"bad\.onnx: "):  # it ended the interpreter
        ffseg.segment(red_disc()[0], {"edges.model": str(path)})
    given = [tmp_path / "a.svg"] if command == "segment" else ["--out", out]
    words = [sys.executable, "-m", "ffseg", command, image, *given, "--set", f"edges.model={path}"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert "export it as ONNX" in done.stderr
    assert not out.exists()


def test_a_model_that_changes_is_read_anew(forest: str) -> None:
    image, truth = red_disc()
    settings = load_params(None, {**START, "edges.model": forest})
    assert iou(ffseg.segment(image, settings).mask, truth) > 0.97
    Path(forest).write_bytes(to_bytes(Model(stump("x", 2.0, -4))))
    assert iou(ffseg.segment(image, settings).mask, truth) < 0.9


def test_sources_without_what_they_need_say_so() -> None:
    image, _ = red_disc()
    with pytest.raises(ParameterError, match="set edges.model"):
        ffseg.segment(image, {"edges.source": "model"})
    with pytest.raises(SegmentationError, match="--evidence"):
        ffseg.segment(image, {"edges.source": "evidence"})


@pytest.mark.parametrize("command", ["run", "compare"])
def test_commands_start_where_told(command: str, forest: str, tmp_path: Path, ffseg_command: Command) -> None:
    """Two red discs: a model starts in the larger one, a file takes the smaller one, or adds it where it says so."""
    truths = {"large": LARGE, "small": SMALL, "both": SMALL | LARGE}
    images = {"in": reddened(SMALL | LARGE), **{name: as_truth(inside) for name, inside in truths.items()}}
    for folder, image in images.items():
        (tmp_path / folder).mkdir()
        cv2.imwrite(str(tmp_path / folder / "a.png"), image)
    added = "image,kind,x,y,radius,right,bottom,value\na,start,25,30,4,,,\na,model,,,,,,\n"
    for truth, text in (("large", ""), ("small", "image,x,y,radius\na,25,30,4\n"), ("both", added)):
        (tmp_path / f"{truth}.csv").write_text(text)
        out, more = tmp_path / f"out-{truth}", ["--starts", tmp_path / f"{truth}.csv"] if text else []
        words = [command, str(tmp_path / "in"), "--truth", str(tmp_path / truth), "--out", str(out), *more]
        words += ["--set", f"edges.model={forest}", *(["--methods", "freeform"] if command == "compare" else [])]
        ffseg_command(*words, code=0)
        (row,) = table(out / ("timings.csv" if command == "run" else "compare.csv"))
        assert float(row["iou"]) > 0.9


@pytest.mark.parametrize(("draft", "reduced"), [(True, 1), (False, 3)])
def test_while_the_hand_moves_the_image_is_reduced_once(
    forest: str, monkeypatch: pytest.MonkeyPatch, *, draft: bool, reduced: int
) -> None:
    image, made, plain = reddened(SMALL | LARGE), [], Appearance.__init__

    def counted(self: Appearance, *arguments: object) -> None:
        made.append(self)
        plain(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(Appearance, "__init__", counted)
    monkeypatch.setattr("ffseg.evidence.prior._appearances", Recent(2))
    found = []
    for x in (85, 90, 95):
        params = ffseg.load_params(None, {"edges.model": forest, "init.center": [x, 50], "init.radius": 4})
        found.append(segment(ffseg.Scene(image, params, draft=draft)).mask)
    assert len(made) == reduced
    assert all(iou(mask, as_truth(LARGE)) > 0.97 for mask in found)
