"""What ``ffseg tune`` and ``ffseg learn`` refuse or warn of before they look: starts off the masks, masks of one side."""

import json
import shutil
from pathlib import Path
from unittest.mock import Mock

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from ffseg.cli.app import app
from ffseg.cli.commands.learn import sentences
from ffseg.errors import ParameterError, UsageError
from ffseg.evidence import base
from ffseg.evidence.forest import Model, to_bytes
from ffseg.learning import learn as learning
from ffseg.learning.examples import MIN_IN_LEAF, STARTS, Example, _chosen, starts_in
from ffseg.learning.gather import LabelledImage, few_known, gather, known_share, starts_off
from ffseg.learning.learn import CrossValidation
from ffseg.learning.page import summary_lines
from ffseg.learning.tune import Bench, tune
from ffseg.parameter_files import load_params
from ffseg.parameters import Parameters
from tests.discs import bright_disc, disc_of
from tests.masks import write_image

SHAPE = (60, 90)
disc = disc_of(SHAPE)
START = ("--set", "init.center=[20,30]", "--set", "init.radius=5")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three bright discs to the left of the middle, with their masks."""
    for number in range(3):
        write_image(tmp_path / "in" / f"{number}.png", bright_disc(SHAPE, (20 + number, 30), 12))
        write_image(tmp_path / "truth" / f"{number}.png", disc(20 + number, 30, 12))
    return tmp_path


def ran(folder: Path, *more: str, command: str = "tune") -> tuple[int, str]:
    """Exit code and what `tune` or `learn` says."""
    out, quick = ("t.yaml", ("--budget", "1")) if command == "tune" else ("t.ffmodel", ("--quick",))
    arguments = [command, str(folder / "in"), "--truth", str(folder / "truth"), "--out", str(folder / out)]
    done = CliRunner().invoke(app, [*arguments, *quick, "-q", *more])
    said = done.stderr if isinstance(done.exception, SystemExit | type(None)) else str(done.exception)
    return done.exit_code, said


def gathered(folder: Path, overrides: dict[str, object]) -> tuple[Parameters, list]:
    params = load_params(None, overrides)
    return params, gather([str(folder / "in")], str(folder / "truth"), params).labelled


def test_starts_outside_all_masks_are_refused(folder: Path) -> None:
    """They were tuned from: IoU 0 as they were, and the setting that leaks furthest as the better one."""
    code, said = ran(folder, "--set", "init.radius=5")
    assert code != 0
    assert "the start lies outside the mask of all images (0.png, 1.png, 2.png)" in said
    assert "--starts" in said
    assert not (folder / "t.yaml").exists()


def test_starts_outside_some_masks_are_named(folder: Path) -> None:
    (folder / "starts.csv").write_text("image,x,y,radius\n0.png,20,30,5\n1.png,70,30,5\n2.png,22,30,5\n")
    code, said = ran(folder, "--starts", str(folder / "starts.csv"))
    assert code == 0
    assert "warning: the start lies outside the mask of 1.png;" in said


def test_a_start_on_unknown_ground_is_no_mistake(folder: Path) -> None:
    for number in range(3):
        truth = np.where(disc(20 + number, 30, 12), 255, 128).astype(np.uint8)
        truth[:5] = 0
        write_image(folder / "truth" / f"{number}.png", truth)
    assert starts_off(gathered(folder, {"init.radius": 5})[1]) == []


def test_a_model_finds_its_own_starts(folder: Path) -> None:
    assert starts_off(gathered(folder, {"init.radius": 5, "edges.model": str(base.BASE)})[1]) == []


def test_scribbles_say_what_the_figures_count(folder: Path) -> None:
    """From a few strokes, which all settings get right, the figures stood as if they were of the whole region."""
    for number in range(3):
        strokes = np.full(SHAPE, 128, np.uint8)
        strokes[29:32, 16:26], strokes[5:8] = 255, 0
        write_image(folder / "truth" / f"{number}.png", strokes)
    _, labelled = gathered(folder, {"init.center": [20, 30], "init.radius": 3, "edges.source": "gradient"})
    line = "the masks know 5.6% of the pixels; the figures of IoU count no others"
    assert line in summary_lines(tune(labelled, 0.1, lambda _: None))
    figures = CrossValidation(3, 1.0, 0.0, 1.0, 0.0, helps=False, known=known_share(labelled))
    assert line in sentences(figures, "a.ffmodel")
    assert few_known(0.5) == []


def test_without_a_start_the_figure_to_beat_says_where_it_grew_from() -> None:
    lines = sentences(CrossValidation(3, 0.9, 0.1, 0.0, 0.0, helps=True, searched=True), "a.ffmodel")
    said = "where no start is named the model finds its own; without it the contour grows from the middle"  # some are
    assert any(line.startswith(said) for line in lines)
    assert "middle" not in " ".join(sentences(CrossValidation(3, 0.9, 0.1, 0.0, 0.0, helps=True), "a.ffmodel"))


def test_domains_starts_and_grounds_of_the_parameters_count(folder: Path) -> None:
    """They were read by nobody: figures were those of contours that may go everywhere, from a circle in the middle."""
    rows, start = np.indices(SHAPE)[0], disc(20, 26, 4)
    write_image(folder / "start.png", start)
    write_image(folder / "cut.png", rows < 30)  # without the lower half of each disc
    write_image(folder / "ground.png", (rows >= 18) & (rows < 23))
    start_at = {"init.mask": str(folder / "start.png"), "edges.source": "gradient"}
    _, labelled = gathered(folder, start_at)
    for one in labelled:
        np.testing.assert_array_equal(one.start, start)
    assert Bench(labelled).overlap(0, {}) > 0.95
    _, labelled = gathered(folder, {**start_at, "domain.mask": str(folder / "cut.png")})
    assert Bench(labelled).overlap(0, {}) == pytest.approx(0.5, abs=0.06)
    assert learning._contoured(labelled[0], labelled[0].params, None).iou == pytest.approx(0.5, abs=0.06)
    _, labelled = gathered(folder, {**start_at, "init.background_mask": str(folder / "ground.png")})
    assert Bench(labelled).overlap(0, {}) < 0.9
    write_image(folder / "domains" / "0.png", rows < 30)
    with pytest.raises(UsageError, match=r"domain\.masks: 1\.png has no mask"):
        gathered(folder, {**start_at, "domain.masks": str(folder / "domains")})


def test_a_domain_of_another_size_is_refused(folder: Path) -> None:
    write_image(folder / "cut.png", np.ones((20, 30), np.bool_))
    with pytest.raises(UsageError, match=r"0\.png: domain\.mask has 30 x 20 pixels, the image 90 x 60"):
        gathered(folder, {"init.center": [20, 30], "domain.mask": str(folder / "cut.png")})


def test_a_start_outside_the_image_is_refused_by_name(folder: Path) -> None:
    with pytest.raises(UsageError, match=r"0\.png: the start circle at \(200, 30\)"):
        gathered(folder, {"init.center": [200, 30]})


@pytest.mark.parametrize("source", ["model", "evidence"])
@pytest.mark.parametrize("command", ["run", "tune", "learn", "compare", "segment"])
def test_a_source_without_its_file_is_refused_before_the_work(folder: Path, command: str, source: str) -> None:
    """Each image failed by itself with the same sentence; `tune` counted every one as 0."""
    name = {"tune": "t.yaml", "learn": "t.ffmodel"}.get(command, "out")
    out = ["--out", str(folder / name)] if command != "segment" else [str(folder / "s.png")]
    given = str(folder / "in" / "0.png") if command == "segment" else str(folder / "in")
    truth = ["--truth", str(folder / "truth")] if command in ("tune", "learn") else []
    done = CliRunner().invoke(app, [command, given, *out, *truth, "--set", f"edges.source={source}"])
    assert isinstance(done.exception, ParameterError)
    assert str(done.exception).startswith(f"edges.source: {source} needs a m")
    assert sorted(path.name for path in folder.iterdir()) == ["in", "truth"]


def test_images_that_the_model_has_learned_from_are_named(folder: Path) -> None:
    """The level was tuned on masks that the model knows, where it needs no other."""
    model = folder / "a.ffmodel"
    for about, warned in (({"images": ["1.png", "x.png", 3]}, True), ({"images": 7}, False), ({}, False)):
        model.write_bytes(to_bytes(Model(base.base(), about=about)))
        code, said = ran(folder, "--set", f"edges.model={model}", *START)
        assert code == 0
        assert ("warning: edges.model has learned from images called 1.png;" in said) is warned


def test_images_and_masks_side_by_side_need_other_names(folder: Path) -> None:
    """The mask was taken for the photograph, and the photograph was blamed for being a mask in colour."""
    for number in range(3):
        image = cv2.imread(str(folder / "in" / f"{number}.png"))
        shutil.copy(folder / "truth" / f"{number}.png", folder / "in")
        write_image(folder / "in" / f"{number}.jpg", image)
    with pytest.raises(UsageError, match=r"0\.png and 0\.jpg could each be the mask of the other; .* NAME_truth\.png"):
        gather([str(folder / "in")], str(folder / "in"), load_params())
    for number in range(3):
        (folder / "in" / f"{number}.png").rename(folder / "in" / f"{number}_truth.png")
    found = gather([str(folder / "in")], str(folder / "in"), load_params())
    assert ([one.name for one in found.labelled], found.others) == (["0.jpg", "1.jpg", "2.jpg"], [])


def test_images_of_one_name_are_refused(folder: Path) -> None:
    """One mask stood for both, silently."""
    shutil.copytree(folder / "in", folder / "more")
    with pytest.raises(UsageError, match=r"in/0\.png and .*more/0\.png are both called 0\.png; give the folder above"):
        gather([str(folder / "in"), str(folder / "more")], str(folder / "truth"), load_params())


def test_photographs_from_cameras_are_learned_from_as_copies(tmp_path: Path) -> None:
    """Six of 24 MP took 1.7 GB and three times as long, for the same figures."""
    truth = disc(45, 30, 20).astype(np.uint8) * 255
    truth[:, 60:] = 128
    truth[10, 71], truth[10, 72], truth[50, 80] = 255, 0, 0
    write_image(tmp_path / "in" / "1.png", bright_disc(SHAPE, (45, 30), 20))
    write_image(tmp_path / "truth" / "1.png", truth)
    start = {"center": (45, 30), "radius": 6.0, "background": ((85, 5, 3, 1),)}
    named = {**{f"init.{key}": value for key, value in start.items()}, "contour.clearance": 6.0, "region.min_area": 10}
    params = load_params(None, named)

    def found(longest: int | None) -> LabelledImage:
        return gather([str(tmp_path / "in")], str(tmp_path / "truth"), params, longest=longest).labelled[0]

    whole, same, copy = found(None), found(90), found(45)
    assert (same.factor, same.params, same.image.shape) == (1, params, SHAPE)
    assert (copy.factor, copy.image.shape, copy.truth.shape, copy.start.shape) == (2, *[(30, 45)] * 3)
    shares = (whole.truth[:, :60] == 255).reshape(30, 2, 30, 2).mean(axis=(1, 3))
    np.testing.assert_array_equal(copy.truth[:, :30] == 255, shares >= 0.5)
    assert [copy.truth[5, 35], copy.truth[5, 36], copy.truth[25, 40], copy.truth[25, 41]] == [255, 0, 0, 128]
    init = copy.params.init
    assert (init.center, init.radius, init.background) == ((22.25, 14.75), 3.0, ((42.25, 2.25, 1.5, 1),))
    assert (copy.params.contour.clearance, copy.params.region.min_area) == (3.0, 3)
    assert np.argwhere(copy.start).mean(axis=0) == pytest.approx([14.75, 22.25], abs=0.3)
    assert found(2).start.tolist() == [[True] * 2] * 2, "no pixel lies half in it"


def test_what_a_starts_file_sets_stays_whatever_is_tried(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`run` lets the row win, so that the figure `tune` promised did not come."""
    (folder / "s").write_text("image,kind,x,y,radius,right,bottom,value\n1,probability,,,,,,0.3\n1,clearance,,,,,,5\n")
    labelled = gather([str(folder / "in")], str(folder / "truth"), load_params(), str(folder / "s")).labelled
    seen: list[tuple[float, float]] = []
    monkeypatch.setattr(
        "ffseg.learning.tune.segment",
        lambda scene: seen.append((scene.params.region.probability, scene.params.contour.clearance)) or Mock(),
    )
    for number in (0, 1):
        Bench(labelled).mask(number, {"region.probability": 0.8, "contour.clearance": 3.0, "edges.source": "prior"})
    assert seen == [(0.8, 3.0), (0.3, 5.0)]


@pytest.mark.parametrize("radius", [16, 31])
def test_a_line_of_a_pixel_has_starts_whatever_the_radius(radius: float) -> None:
    truth = np.full(SHAPE, 128, np.uint8)
    truth[20, 10:50] = 255
    assert len(starts_in(Example(truth, truth, None, radius), np.random.default_rng(0))) == STARTS


def test_few_pixels_of_a_side_are_looked_at_all_the_same() -> None:
    known = np.zeros(100_000, np.int8)
    known[:30] = 1
    assert np.count_nonzero(known[_chosen(known, np.random.default_rng(0))]) == MIN_IN_LEAF


def test_a_method_without_edges_is_refused(folder: Path) -> None:
    """All settings gave the same, and the time was spent."""
    code, said = ran(folder, "--set", "method=cv_floodfill", *START)
    assert code != 0
    assert "method: cv_floodfill does not look at the edge map" in said


@pytest.mark.parametrize("level", [0, 255])
def test_a_mask_of_one_side_is_passed_over_and_said_to_be(folder: Path, level: int) -> None:
    """`tune` counted an empty mask as 0 whatever was found, and one that is all inside as better the more leaked."""
    write_image(folder / "truth" / "1.png", np.full(SHAPE, level, np.uint8))
    found = gather([str(folder / "in")], str(folder / "truth"), load_params(None, {"init.center": [20, 30]}))
    assert [one.name for one in found.labelled] == ["0.png", "2.png"]
    assert found.others == []
    assert [text.partition(":")[0] for text in found.passed_over] == ["1.png"]
    code, said = ran(folder, *START)
    assert code == 0
    assert f"passed over 1.png: the mask knows no pixel {'outside' if level else 'inside'}" in said


@pytest.mark.parametrize("spoilt", ["image", "mask", "size"])
@pytest.mark.parametrize("command", ["tune", "learn"])
def test_one_bad_file_among_many_is_passed_over(folder: Path, spoilt: str, command: str) -> None:
    """One of two hundred ended `learn`, and the next one was found when that was mended."""
    path = folder / ("in" if spoilt == "image" else "truth") / "1.png"
    if spoilt == "size":
        write_image(path, np.full((7, 9), 255, np.uint8))
    else:
        path.write_bytes(path.read_bytes()[:60])
    code, said = ran(folder, *START, command=command)
    assert code == 0, said
    assert "warning: passed over 1.png: " in said


LACKS = {
    0: r"0\.png: the mask knows no pixel inside",
    255: r"0\.png: the mask knows no pixel outside",
    128: r"0\.png: .* has no pixel that counts",
}


@pytest.mark.parametrize(("level", "lacks"), LACKS.items())
def test_masks_that_all_show_one_side_are_refused(folder: Path, level: int, lacks: str) -> None:
    for number in range(3):
        write_image(folder / "truth" / f"{number}.png", np.full(SHAPE, level, np.uint8))
    with pytest.raises(UsageError, match=lacks):
        gathered(folder, {"init.center": [20, 30], "init.radius": 5})


def test_a_mask_too_small_to_be_seen_is_passed_over(folder: Path) -> None:
    """One of many ended `ffseg learn`, and with it what `ffseg pick` learns."""
    large = np.zeros((1000, 1000), np.uint8)
    large[500, 500] = 255
    write_image(folder / "in" / "1.png", large)
    write_image(folder / "truth" / "1.png", large)
    arguments = ["learn", str(folder / "in"), "--truth", str(folder / "truth"), "--out", str(folder / "m.ffmodel")]
    done = CliRunner().invoke(app, [*arguments, "--quick", "--json", "-q"])
    assert done.exit_code == 0
    said, found = "1.png: what the mask knows inside is too small or thin", json.loads(done.stdout)
    assert f"ffseg: warning: passed over {said}" in done.stderr
    assert (found["masks"], [text[: len(said)] for text in found["passed_over"]]) == (2, [said])


def test_with_a_model_its_level_alone_is_moved(folder: Path) -> None:
    """Thresholds were tried, which a model does not ask for: so many segmentations that all gave the same."""
    said: list[str] = []
    _, labelled = gathered(folder, {"init.center": [20, 30], "init.radius": 5, "edges.model": str(base.BASE)})
    found = tune(labelled, 30.0, said.append)
    assert ([key for key, _ in found.sensitivity], found.tried) == (["region.probability"], 8)
    assert said[-1].startswith("8 levels tried")
