"""What ``ffseg tune`` and ``ffseg learn`` refuse or warn of before they look: starts off the masks, masks of one side."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from ffseg.batch.learning.gather import counted, gather, known_share, starts_off
from ffseg.batch.learning.learn import Figures
from ffseg.batch.learning.page import told
from ffseg.batch.learning.tune import tune
from ffseg.cli.app import app
from ffseg.cli.commands.learning.learn import sentences
from ffseg.errors import ParameterError, UsageError
from ffseg.evidence import base
from ffseg.parameters import Parameters, load_params

SHAPE = (60, 90)


def disc(x: float, y: float, radius: float) -> np.ndarray:
    rows, columns = np.indices(SHAPE)
    return (columns - x) ** 2 + (rows - y) ** 2 <= radius**2


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three bright discs to the left of the middle, with their masks."""
    for name in ("in", "truth"):
        (tmp_path / name).mkdir()
    for number in range(3):
        inside = disc(20 + number, 30, 12)
        image = np.where(inside, 180, 60).astype(np.uint8)
        cv2.imwrite(str(tmp_path / "in" / f"{number}.png"), image)
        cv2.imwrite(str(tmp_path / "truth" / f"{number}.png"), inside.astype(np.uint8) * np.uint8(255))
    return tmp_path


def ran(folder: Path, *more: str) -> tuple[int, str]:
    """Exit code and what `tune` says."""
    arguments = ["tune", str(folder / "in"), "--truth", str(folder / "truth"), "--out", str(folder / "t.yaml")]
    done = CliRunner().invoke(app, [*arguments, "--budget", "1", "-q", *more])
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
        cv2.imwrite(str(folder / "truth" / f"{number}.png"), truth)
    assert starts_off(gathered(folder, {"init.radius": 5})[1]) == []


def test_a_model_finds_its_own_starts(folder: Path) -> None:
    assert starts_off(gathered(folder, {"init.radius": 5, "edges.model": str(base.BASE)})[1]) == []


def test_scribbles_say_what_the_figures_count(folder: Path) -> None:
    """From a few strokes, which all settings get right, the figures stood as if they were of the whole region."""
    for number in range(3):
        strokes = np.full(SHAPE, 128, np.uint8)
        strokes[29:32, 16:26], strokes[5:8] = 255, 0
        cv2.imwrite(str(folder / "truth" / f"{number}.png"), strokes)
    _, labelled = gathered(folder, {"init.center": [20, 30], "init.radius": 3, "edges.source": "gradient"})
    line = "the masks know 5.6% of the pixels; the figures of IoU count no others"
    assert line in told(tune(labelled, 0.1, lambda _: None))
    figures = Figures(3, 1.0, 0.0, 1.0, 0.0, helps=False, known=known_share(labelled))
    assert line in sentences(figures, "a.ffmodel")
    assert counted(0.5) == []


def test_without_a_start_the_figure_to_beat_says_where_it_grew_from() -> None:
    lines = sentences(Figures(3, 0.9, 0.1, 0.0, 0.0, helps=True, searched=True), "a.ffmodel")
    assert "without the model:       0.000 (spread 0.000), from the middle of the images: no start is named" in lines
    assert "middle" not in " ".join(sentences(Figures(3, 0.9, 0.1, 0.0, 0.0, helps=True), "a.ffmodel"))


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


@pytest.mark.parametrize(("level", "side"), [(0, "inside"), (255, "outside"), (128, "inside")])
def test_a_mask_of_one_side_is_refused(folder: Path, level: int, side: str) -> None:
    """`tune` counted an empty mask as 0 whatever was found, and one that is all inside as better the more leaked."""
    cv2.imwrite(str(folder / "truth" / "1.png"), np.full(SHAPE, level, np.uint8))
    with pytest.raises(UsageError, match=rf"1\.png: the mask knows no pixel {side}"):
        gathered(folder, {"init.center": [20, 30], "init.radius": 5})


def test_with_a_model_its_level_alone_is_moved(folder: Path) -> None:
    """Thresholds were tried, which a model does not ask for: so many segmentations that all gave the same."""
    said: list[str] = []
    _, labelled = gathered(folder, {"init.center": [20, 30], "init.radius": 5, "edges.model": str(base.BASE)})
    found = tune(labelled, 30.0, said.append)
    assert [key for key, _ in found.sensitivity] == ["region.probability"]
    assert found.tried == 8
    assert said[-1].startswith("8 levels tried")
