"""``ffseg learn``: from folders of images and masks to a model that `run` uses, and what it says of itself."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from commands import Command

from ffseg.cli.commands.learn import sentences
from ffseg.evidence.forest import MODEL_ODDS_RATIO, load_model, to_bytes
from ffseg.evidence.source import model_odds
from ffseg.learning import learn as learning
from ffseg.learning.examples import Example, Samples, samples
from ffseg.learning.gather import LabelledImage, gather
from ffseg.learning.learn import CrossValidation, _worth_drawing, fitted_ratio, learn_and_measure, levelled
from ffseg.learning.training import BaseChoice, PriorChoice, SampleSet, grown
from ffseg.metrics import IGNORED, INSIDE
from ffseg.parameter_files import load_params
from tests.discs import disc_of
from tests.masks import write_image

pytest.importorskip("lightgbm")
SHAPE = (80, 120)
disc = disc_of(SHAPE)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Five images of a green disc on noise with bright bars through it, masks of three of them, all starts."""
    starts = ["image,x,y,radius"]
    for number in range(5):
        rng = np.random.default_rng(number)
        x, y = rng.uniform(35, 85), rng.uniform(30, 50)
        image, inside = rng.normal(110, 4, (*SHAPE, 3)), disc(x, y, 24)
        image[inside] += (-30, 25, 0)
        image[int(y) - 8 : int(y) - 6] += 50
        write_image(tmp_path / "in" / f"{number}.png", np.clip(image, 0, 255).astype(np.uint8))
        if number < 3:
            write_image(tmp_path / "truth" / f"{number}.png", inside)
        starts.append(f"{number}.png,{x:.1f},{y:.1f},5")
    (tmp_path / "starts.csv").write_text("\n".join(starts) + "\n")
    return tmp_path


def test_learn_then_run(folder: Path, ffseg_command: Command) -> None:
    model, images, scored = folder / "green.ffmodel", folder / "in", ("--truth", folder / "truth")
    starts = ("--starts", folder / "starts.csv")
    done = ffseg_command("learn", images, *scored, "--out", model, *starts, "--json", "-q", code=0)
    told = json.loads(done.stdout)
    assert told["masks"] == 3
    assert told["iou"] > 0.9
    assert told["iou"] > told["without"]
    assert told["helps"] is True
    assert told["following"] in {"3.png", "4.png"}
    assert [number for number, _ in told["curve"]] == [1, 2]
    about = load_model(model).about
    assert (about["images"], about["base"]) == (["0.png", "1.png", "2.png"], told["base"])
    assert (load_model(model).calibration.ratio, about["odds_ratio"]) == (told["odds_ratio"],) * 2
    assert 0.05 < told["odds_ratio"] < MODEL_ODDS_RATIO, "it does well; three images and one beside them tell little"
    assert about["prior"] == told["prior"]
    assert told["prior"]["asked"] is (told["prior"]["both"] > told["prior"]["taught"])
    assert told["base"]["corrected"] is (told["base"]["base"] >= told["base"]["enough"])
    run = ("run", images, *scored, "--out", folder / "out", *starts, "--set", f"edges.model={model}", "--json")
    assert json.loads(ffseg_command(*run).stdout)["mean_iou"] > 0.9
    assert json.loads(ffseg_command(*run).stdout)["counts"]["unchanged"] == 5
    model.write_bytes(b"not a model")
    assert "green.ffmodel" in ffseg_command(*run, code=2).stderr


def test_the_ratio_is_that_of_which_the_mean_comes_out_and_of_none_that_of_the_unmeasured() -> None:
    assert fitted_ratio([]) == pytest.approx(MODEL_ODDS_RATIO)
    pairs = [(0.9, 0.9)] * 300 + [(0.9, 0.1)] * 100
    assert fitted_ratio(pairs) == pytest.approx(9 / (0.7 / 0.3), rel=0.01)
    assert fitted_ratio([(1.0, 0.0), (0.0, 1.0)]) > 0


def test_without_starts_the_model_finds_them(folder: Path) -> None:
    params = load_params(None, {"init.radius": 5})
    gathered = gather([str(folder / "in")], str(folder / "truth"), params)
    model, figures = learn_and_measure(gathered, params, lambda _: None)
    assert model.start is not None
    assert (figures.iou > 0.85, figures.met, figures.searched) == (True, 1, True)
    assert [number for number, _ in figures.curve] == [1, 2]
    assert min(value for _, value in figures.curve) > 0.7  # from starts drawn inside the masks
    (folder / "in" / "4.png").write_bytes(b"")
    quick, unmeasured = learn_and_measure(gathered, params, (said := []).append, measured=False)
    assert [line for line in said if "passed over" in line] == [
        f"passed over: {folder}/in/4.png: the file is empty; copy it again"
    ]
    assert all(np.array_equal(values, quick.inside.arrays[name]) for name, values in model.inside.arrays.items())
    assert unmeasured.order == tuple(name for name in figures.order if name != "4.png")
    assert unmeasured.helps is None
    assert sentences(unmeasured, "m.ffmodel")[0].endswith("was not measured: that takes longer, and no --quick")


def test_a_model_that_finds_other_things_than_the_masks_show_keeps_no_start(folder: Path) -> None:
    """Of many things alike it took another, and clicks had to undo that first."""
    alike, params = [disc(x, 40, 14) for x in (22, 60, 98)], load_params(None, {"init.radius": 5})
    for number, truth in enumerate(alike):
        image = 110 + np.random.default_rng(number).integers(0, 9, (*SHAPE, 3), np.uint8)
        image[np.logical_or.reduce(alike)] += np.array((60, 0, 0), np.uint8)
        write_image(folder / "in" / f"{number}.png", image)
        write_image(folder / "truth" / f"{number}.png", truth)
    gathered = gather([str(folder / "in")], str(folder / "truth"), params)
    model, figures = learn_and_measure(gathered, params, (said := []).append)
    assert "most starts that the model finds lie outside the masks: measured from starts inside" in said
    assert (model.start, figures.searched, model.about["searched"]) == (None, False, False)
    assert (len(gathered.others), figures.order, figures.following) == (2, (), ""), (
        "from no start it is sure of nothing"
    )
    assert (figures.met or 0) < learning.MIN_MET
    assert min(figures.iou, figures.without) > 0.9, "from starts inside"
    lines = sentences(figures, "a.ffmodel")
    assert f"of the starts that it finds {figures.met:.0%} lie in the masks of images left out" in " ".join(lines)
    assert not any("the model finds its own" in line for line in lines)


def test_it_says_what_was_learned_from_as_a_copy(folder: Path) -> None:
    params = load_params()
    gathered = gather([str(folder / "in")], str(folder / "truth"), params, longest=100)
    figures = learn_and_measure(gathered, params, lambda _: None, measured=False)[1]
    assert figures.copies == len(gathered.labelled) > 0
    line = f"{figures.copies} images of more than 2000 pixels a side learned from, and measured on, as a copy"
    assert (line in sentences(figures, "m.ffmodel"), line in sentences(replace(figures, copies=0), "")) == (True, False)


@pytest.mark.parametrize(("measured", "most"), [(True, 200), (False, 20)])
def test_a_model_that_is_not_measured_waits_for_few_images(
    folder: Path, monkeypatch: pytest.MonkeyPatch, measured: bool, most: int
) -> None:
    """After two clicks in 200 images `ffseg pick` had its first model after 15 s, 11 of them for naming the next image."""
    params = load_params()
    gathered = gather([str(folder / "in")], str(folder / "truth"), params)
    others, looked = [SimpleNamespace(name=str(n)) for n in range(230)], list[object]()
    monkeypatch.setattr(learning, "_doubt", lambda one, *_: looked.append(one) or 0.5)
    learn_and_measure(replace(gathered, others=others), params, lambda _: None, measured=measured)
    assert looked == others[: 200 : 200 // most]


def test_scribbles_do_not_tell_that_a_start_lies_outside() -> None:
    truth = np.full(SHAPE, IGNORED, np.uint8)
    truth[:, 60:] = INSIDE
    truth[:, 90:] = 0
    starts = None, disc(30, 40, 9), disc(60, 40, 9), disc(92, 40, 9)
    assert [learning._met(start, truth) for start in starts] == [False, None, True, False]


def test_without_the_model_is_without_that_of_the_parameters_too(folder: Path) -> None:
    """Names forge no lines, either."""
    for name in ("in/1.png", "truth/1.png", "in/3.png", "in/4.png"):
        (folder / name).rename(folder / name.replace(".", "\n."))
    (folder / "starts.csv").unlink()
    params, said = load_params(None, {"init.center": [60, 40], "init.radius": 5}), []
    plain = gather([str(folder / "in")], str(folder / "truth"), params)
    model, figures = learn_and_measure(plain, params, said.append, measured=False)
    assert "looking at 1\\u000a.png" in said
    assert not any("\n" in line for line in (*said, *sentences(figures, "m.ffmodel")))
    (folder / "m.ffmodel").write_bytes(to_bytes(model))
    params = replace(params, edges=replace(params.edges, model=str(folder / "m.ffmodel")))
    named = gather([str(folder / "in")], str(folder / "truth"), params)
    without = [learning._contoured(one, one.params, None) for one in plain.labelled]
    assert [learning._contoured(one, one.params, None) for one in named.labelled] != without
    bare = [replace(one, params=learning._without_model(one.params)) for one in named.labelled]
    assert [learning._contoured(one, one.params, None) for one in bare] == without
    _, chosen = learning._sampled(plain, params, said.append)
    assert learning._curve(named.labelled, chosen) == learning._curve(plain.labelled, chosen)


def test_the_verdict_comes_first_and_no_figure_has_two_meanings() -> None:
    one = sentences(CrossValidation(1, float("nan"), float("nan"), float("nan"), float("nan"), helps=None), "a.ffmodel")
    assert one[0] == "a.ffmodel, learned from 1 mask, was not measured: that takes a second mask"
    assert not any("do without" in line for line in one)
    curve, base = ((1, 0.7), (2, 0.755), (3, 0.763)), BaseChoice(True, 0.81, 0.64, None)
    worse = sentences(
        CrossValidation(4, 0.155, 0.1, 0.61, 0.1, False, curve, 3, "b.png", base, PriorChoice(True, 0.7, 0.6, 0.65)),
        "a.ffmodel",
    )
    verdict = "worse than no model: IoU on images left out 0.155 (spread 0.100), without it 0.610 (spread 0.100)"
    assert worse[0].endswith(verdict)
    assert "what more masks gave small trial models: +0.055 from 1 to 2, +0.008 from 2 to 3" in worse
    assert [line for line in worse if "IoU" in line] == [worse[0]]
    assert worse[-4:-1] == [
        "do without it, or draw more masks", "about 3 more masks may each still raise it by .005 or more",
        "most useful to draw next: b.png",
    ]  # fmt: skip
    no_better = sentences(CrossValidation(4, 0.62, 0.1, 0.61, 0.1, helps=False), "a.ffmodel")
    assert "no better than no model beyond the noise" in no_better[0]
    assert "helps: IoU" in sentences(CrossValidation(4, 0.82, 0.1, 0.61, 0.1, helps=True), "a.ffmodel")[0]


@pytest.mark.parametrize("curve", [(), ((1, 0.5), (3, 0.58))])
@pytest.mark.parametrize("more", [0, 3])
@pytest.mark.parametrize("helps", [False, True])
def test_nobody_is_told_to_draw_what_hardly_helps(curve: tuple[tuple[int, float], ...], more: int, helps: bool) -> None:
    figures = CrossValidation(4, 0.6, 0.1, 0.61, 0.1, helps, curve, more, "b.png")
    said = " ".join(sentences(figures, "a.ffmodel"))
    assert ("hardly raise" in said) == (bool(curve) and not more)
    assert not ("hardly raise" in said and ("draw more" in said or "draw next" in said))
    assert ("do without it" in said) != helps


@pytest.mark.parametrize(
    ("base", "said", "why"),
    [
        (BaseChoice(True, 0.81, 0.64, None), "corrects the forest", "0.64 is enough"),
        (BaseChoice(True, 0.52, 0.64, 0.41), "corrects the forest", "they teach each other 0.41"),
        (BaseChoice(False, 0.42, 0.64, 0.58), "grown from the masks alone,", "they teach each other 0.58"),
        (BaseChoice(True, 0.42, 0.75, None), "corrects the forest", "one mask is too little to begin with"),
    ],
)
def test_it_says_whether_the_base_was_corrected_and_why(base: BaseChoice, said: str, why: str) -> None:
    lines = sentences(CrossValidation(4, 0.6, 0.1, 0.5, 0.1, True, base=base), "a.ffmodel")
    assert lines[1].startswith(f"{said} ")
    assert lines[1].endswith(f" ({why})")
    assert f" {base.base} " in lines[1]


def test_the_curve_scores_contours_of_models_as_they_are_used(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With votes of neighbours and from the start, whole: as `learn_and_measure` measures, with more trees."""
    params = load_params()
    labelled = gather([str(folder / "in")], str(folder / "truth"), params, str(folder / "starts.csv")).labelled
    chosen = SampleSet([samples(Example(one.image, one.truth, one.start, 5)) for one in labelled])
    maps: list[np.ndarray] = []
    plain = learning._contoured
    monkeypatch.setattr(
        learning, "_contoured", lambda one, own, told, **how: maps.append(told) or plain(one, own, told, **how)
    )
    curve = learning._curve(labelled, chosen)
    assert ([number for number, _ in curve], len(maps)) == ([1, 2], 3 * (2 + 1))
    models = [grown(chosen.some([number]), learning.CURVE_TREES) for number in range(len(chosen))]
    used = [model_odds(model, model.appearance(one.image), one.start) for model in models for one in labelled]
    assert sum(any(np.array_equal(one, other) for other in used) for one in maps) == 3 * 2, "those of one mask"
    monkeypatch.setattr(learning, "MAX_TESTED", 1)
    maps.clear()
    learning._curve(labelled, chosen)
    assert len(maps) == 3 * (1 + 1)


def test_no_number_of_masks_looks_better_for_the_images_it_was_tested_on() -> None:
    """Of a hundred masks, models of 99 were tested on three images, and these were easy: .15 better than those of 64."""
    easy, hard, gain = 0.9, 0.3, 0.05
    found = [(1, 0, easy), (1, 1, hard), (2, 1, hard + gain), (2, 2, easy + gain), (4, 0, easy + gain)]
    curve = dict(levelled(found))
    assert curve == pytest.approx({1: 0.7, 2: 0.7 + gain, 4: 0.7 + gain}, abs=1e-4)


@pytest.mark.parametrize(("count", "numbers"), [(2, [1]), (10, [1, 2, 4, 8, 9]), (40, [1, 2, 4, 8, 16, 32, 36])])
def test_a_curve_leaves_out_as_many_images_as_are_left_out_to_measure(
    count: int, numbers: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    image = np.zeros(SHAPE, np.uint8)
    one = LabelledImage("a.png", image, image, load_params(), disc(60, 40, 5))
    monkeypatch.setattr(learning, "grown", lambda *_: SimpleNamespace(map=lambda *_: None, parts=False))
    monkeypatch.setattr(learning, "_contoured", lambda *_, **__: learning.LeftOut(0.5))
    chosen = SampleSet([Samples(np.zeros((4, 1), np.float32), np.zeros(4, np.bool_))] * count)
    assert [number for number, _ in learning._curve([one] * count, chosen)] == numbers


def test_masks_are_worth_drawing_while_the_curve_rises() -> None:
    assert _worth_drawing([(1, 0.8), (2, 0.8), (4, 0.8)], 5) == 0
    rising = [(1, 0.5), (2, 0.7), (4, 0.8)]  # .9 - .4 / n: the n-th is worth .4 / n / (n + 1)
    assert _worth_drawing(rising, 5) == 4  # .4 / 72 = .0056 from 8 to 9 masks, .4 / 90 = .0044 from 9 to 10
