"""``ffseg tune``: finds what masks ask for, keeps what is at hand where nothing is better, and says which."""

import errno
import json
import os
from dataclasses import replace
from itertools import islice
from pathlib import Path
from time import process_time
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from ffseg.cli.app import app
from ffseg.io import files
from ffseg.learning import tune as tuning
from ffseg.learning.choice import Trial
from ffseg.learning.gather import LabelledImage, gather
from ffseg.learning.page import not_tried, summary_lines, to_html, to_yaml
from ffseg.learning.space import MAX_SETTINGS, halton, levels, settings, with_setting
from ffseg.learning.tune import TuningResult, _sensitivity, before_and_after, tune
from ffseg.parameter_files import load_params
from ffseg.parameter_text import non_defaults
from tests.discs import disc_of
from tests.masks import write_image

SHAPE = (90, 130)
disc = disc_of(SHAPE)


def written(folder: Path, *, lined: bool) -> Path:
    """Four bright discs; with `lined`, the masks go on beyond weak lines that the defaults stop at."""
    for number in range(4):
        rng = np.random.default_rng(number)
        image, inside = rng.normal(60, 1, SHAPE), disc(60 + number, 45, 32)
        image[inside] += 120
        if lined:
            image[disc(60 + number, 45, 16) ^ disc(60 + number, 45, 14)] += 12
        write_image(folder / "in" / f"{number}.png", np.clip(image, 0, 255).astype(np.uint8))
        write_image(folder / "truth" / f"{number}.png", inside)
    return folder


def ran(folder: Path, *more: str) -> Result:
    command = ["tune", str(folder / "in"), "--truth", str(folder / "truth"), "--out", str(folder / "mine.yaml")]
    return CliRunner().invoke(app, [*command, "--page", str(folder / "tune.html"), "-q", *more])


SET = {"init.center": [60, 45], "init.radius": 6}


def test_settings_and_page_are_written_together_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page does not fit on the disk: a limit on the size of files stands for it."""
    folder = written(tmp_path, lined=False)
    kept, most = files.write_fully, 4096

    def full(descriptor: int, data: bytes) -> None:
        if len(data) > most:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        kept(descriptor, data)

    monkeypatch.setattr(files, "write_fully", full)
    before = sorted(os.listdir(folder))
    done = ran(folder, "--budget", "1")
    assert (type(done.exception).__name__, sorted(os.listdir(folder))) == ("OutputError", before)
    assert "tune.html cannot be written (No space left on device)" in str(done.exception)


def test_tuning_passes_the_lines_that_masks_pass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its two seconds are of processor time here: on a busy machine it would try too little."""
    monkeypatch.setattr(tuning, "time", SimpleNamespace(monotonic=process_time))
    folder = written(tmp_path, lined=True)
    start = ("--set", "init.center=[60,45]", "--set", "init.radius=6", "--set", "edges.source=gradient")
    done = ran(folder, "--budget", "2", "--json", *start)
    assert done.exit_code == 0, done.stderr
    found = json.loads(done.stdout)
    assert max(found["before"]) < 0.5
    assert min(found["left_out"]) > 0.9
    assert found["setting"]
    params = load_params(str(folder / "mine.yaml"), SET)
    canny, sigma = (found["setting"][key] for key in ("edges.canny", "edges.sigma"))
    assert (params.edges.canny, params.edges.sigma) == (canny if canny == "auto" else tuple(canny), sigma)
    assert "best on the others" in (folder / "mine.yaml").read_text()
    page = (folder / "tune.html").read_text()
    assert page.count("<img") == 8
    assert "before" in page


def test_where_nothing_is_better_the_parameters_are_kept(tmp_path: Path) -> None:
    folder = written(tmp_path, lined=False)
    params = load_params(None, SET)
    labelled = gather([str(folder / "in")], str(folder / "truth"), params).labelled
    found = tune(labelled, 1.0, lambda _: None)
    assert min(found.before) > 0.95
    assert found.setting == {}
    assert "they are kept" in to_yaml(found)
    path = tmp_path / "kept.yaml"
    path.write_text(to_yaml(found))
    assert load_params(str(path)) == load_params()
    page = to_html(found, labelled, before_and_after(labelled, found), "what was written")
    assert page.count("<section>") == 4
    assert "<pre>what was written</pre>" in page


def test_the_page_names_the_setting_it_shows_where_none_is_taken() -> None:
    found = TuningResult({}, {"edges.sigma": 2.0}, (0.5,), (0.9,), (0.5,), (), 3, 1.0)
    plane = np.zeros((2, 2), np.uint8)
    shown = [LabelledImage("a.png", plane, plane, load_params(), None)], [(plane > 0, plane > 0)], ""
    assert "which is not taken: edges.sigma 2.0</p>" in to_html(found, *shown)
    assert "not taken" not in to_html(replace(found, setting=found.best), *shown)


def test_settings_are_spread_and_differ() -> None:
    drawn = list(islice(settings(), 100))
    assert (len({str(one) for one in drawn}), len({str(one) for one in settings()})) == (100, MAX_SETTINGS)
    assert len({str(one["edges.canny"]) for one in drawn}) == 10
    assert [halton(index, 2) for index in (1, 2, 3, 4)] == [0.5, 0.25, 0.75, 0.125]
    params = with_setting(load_params(), drawn[0])
    assert params.edges.sigma == drawn[0]["edges.sigma"]
    assert load_params(None, {key: list(v) if isinstance(v, tuple) else v for key, v in drawn[0].items()}) == params


def test_levels_lie_round_the_one_at_hand_where_there_is_a_probability() -> None:
    own = [one["region.probability"] for one in levels(load_params())]
    assert own == [0.62, 0.38, 0.73, 0.27, 0.82, 0.18, 0.88, 0.12]
    moved = [float(str(one["region.probability"])) for one in levels(load_params(None, {"region.probability": 0.95}))]
    assert moved == pytest.approx([0.97, 0.92, 0.98, 0.87, 0.99, 0.81, 0.72], abs=0.011)  # two digits
    assert levels(load_params(None, {"edges.source": "gradient"})) == []
    assert len(levels(load_params(None, {"edges.source": "prior"}))) == 8


@pytest.mark.parametrize(("budget", "most"), [(5, 10), (30, 40), (60, 68), (90, 98)])
def test_the_budget_is_kept(budget: int, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once the first images were seen the rest of a bracket was finished, however long that took."""
    seen: list[int] = []
    monkeypatch.setattr(tuning.time, "monotonic", lambda: float(len(seen)))
    monkeypatch.setattr(tuning.Bench, "overlap", lambda _self, number, _setting: seen.append(number) or 0.5)
    params = load_params(None, {"edges.source": "gradient"})
    image = np.zeros((8, 8), np.uint8)
    found = tune([LabelledImage(str(n), image, image, params, None) for n in range(8)], budget, lambda _: None)
    assert found.seconds == len(seen) <= most  # 8 for the parameters at hand, and at most a round of 2, 4 and 8 images
    assert found.tried + found.left == MAX_SETTINGS
    (said,) = not_tried(found)
    assert said.startswith(f"not tried for want of time: {found.left} of {MAX_SETTINGS} settings; a longer")
    assert f"# {said}" in to_yaml(found)


def test_what_had_its_time_says_nothing_of_it() -> None:
    assert not_tried(TuningResult({}, {}, (0.5, 0.5), (0.5, 0.5), (0.5, 0.5), (), 249, 1.0)) == []


def test_sensitivity_is_the_span_of_the_means() -> None:
    trials = [Trial({}, {0: 1.0, 1: 1.0}), Trial({"a": 1, "b": 1}, {0: 0.2, 1: 0.4}),
              Trial({"a": 2, "b": 1}, {0: 0.8, 1: 0.8}), Trial({"a": 2, "b": 2}, {0: 0.6})]  # fmt: skip
    assert dict(_sensitivity(trials)) == pytest.approx({"a": 0.5})  # of b, the second value was tried on one image only
    second = Trial({"a": 1, "b": 2}, {0: 0.4, 1: 0.4})
    assert dict(_sensitivity([*trials, second])) == pytest.approx({"a": 0.45, "b": 0.15})


def test_thresholds_survive_their_file(tmp_path: Path) -> None:
    setting = {"edges.source": "gradient", "edges.canny": (2.5, 5.0), "contour.clearance": 6.0}
    path = tmp_path / "mine.yaml"
    path.write_text(to_yaml(TuningResult(setting, setting, (0.5, 0.5), (0.9, 0.9), (0.9, 0.9), (), 3, 1.0)))
    params = load_params(str(path))
    assert (params.edges.source, params.edges.canny, params.contour.clearance) == ("gradient", (2.5, 5.0), 6.0)


@pytest.mark.parametrize("others", [0.4, 0.6])
def test_a_setting_that_serves_no_other_image_is_told(others: float) -> None:
    found = TuningResult(
        {"edges.sigma": 2.0}, {"edges.sigma": 2.0}, (0.5, 0.5), (0.9, 0.9), (others, others), (), 3, 1.0
    )
    assert any("draw more masks" in line for line in summary_lines(found)) == (others < 0.5)


def test_one_image_says_nothing_of_others() -> None:
    found = TuningResult({}, {"edges.sigma": 2.0}, (0.5,), (0.9,), (0.5,), (), 3, 1.0)
    assert not any("others" in line for line in summary_lines(found))
    assert any("one image may be chance: they are kept" in line for line in summary_lines(found))


def test_the_file_holds_what_tuning_began_with(tmp_path: Path) -> None:
    """`--config toy-full --set contour.degree=2` were left out of the file that is to be used with --config alone."""
    (tmp_path / "mask.png").write_bytes(b"")
    circles = {"init.circles": [[1.5, 2, 3], [4, 5, 6]], "init.center": [7, 123.4567891]}
    others = {"method": "snake", "edges.canny": [3, 6], "domain.mask": str(tmp_path / "mask.png")}
    began = load_params("toy-full", {"contour.degree": 2, "contour.refine": False, **circles, **others})
    path = tmp_path / "sub" / "t.yaml"
    path.parent.mkdir()
    for setting in ({}, {"edges.canny": (8.0, 16.0), "edges.sigma": 2.0}):
        path.write_text(to_yaml(TuningResult(setting, setting, (0.5, 0.5), (0.9, 0.9), (0.9, 0.9), (), 3, 1.0), began))
        assert load_params(path) == load_params("toy-full", {**non_defaults(began), **setting})
    assert "contour" not in to_yaml(TuningResult({}, {}, (0.5,), (0.9,), (0.9,), (), 3, 1.0), load_params())
