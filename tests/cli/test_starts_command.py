"""``--starts`` of ``ffseg run`` and ``ffseg compare``: exit codes, sentences, the plan shown, and what is on disk."""

import json
from pathlib import Path

import numpy as np
import pytest
from batches import table
from commands import Command

from tests.discs import LEFT, RIGHT, disc_of, two_discs
from tests.masks import read_mask, write_image


@pytest.fixture
def images(tmp_path: Path) -> Path:
    two_discs(tmp_path / "in", "a.png", "b.png")
    return tmp_path / "in"


def starts(folder: Path, *rows: str) -> Path:
    path = folder / "starts.csv"
    path.write_text("\n".join(["image,x,y,radius", *rows, ""]), encoding="utf-8")
    return path


def test_the_plan_shows_the_starts_and_the_run_takes_them(ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    path, out = starts(tmp_path, "b.png,90.5,40,", "a,30,40,6"), tmp_path / "out"
    arguments = ("run", images, "--out", out, "--starts", path, "--set", "init.radius=7")
    plan = ffseg_command(*arguments, "--dry-run", code=0)
    assert f"{images}/a.png (start at 30, 40, radius 6) -> masks/a.png, contours/a.svg" in plan.stdout
    assert f"{images}/b.png (start at 90.5, 40) -> masks/b.png, contours/b.svg" in plan.stdout
    document = json.loads(ffseg_command(*arguments, "--dry-run", "--json").stdout)
    told = [image["start"] for image in document["images"]]
    assert told == [{"x": 30.0, "y": 40.0, "radius": 6.0}, {"x": 90.5, "y": 40.0, "radius": None}]
    assert not out.exists()
    done = ffseg_command(*arguments, "--json", code=0)
    assert [row["start_x"] for row in json.loads(done.stdout)["images"]] == [30.0, 90.5]
    places = [read_mask(out / "masks" / name)[40, [30, 90]].tolist() for name in ("a.png", "b.png")]
    assert places == [[True, False], [False, True]]


@pytest.mark.parametrize(
    ("given", "same"),
    [
        (["--at", "30,40"], ["init.center=[30, 40]"]),
        (["--at", "30,40,6"], ["init.center=[30, 40]", "init.radius=6"]),
        (["--at", "30,40,6", "--at", "90.5,40"], ["init.circles=[[30, 40, 6], [90.5, 40]]"]),
        (["--at", "30,40", "--box", "5,15,50,50"], ["init.circles=[[30, 40]]", "init.boxes=[[4.5, 14.5, 54.5, 64.5]]"]),
    ],
    ids=["a place", "a circle", "two", "beside a box"],
)
def test_a_place_on_the_command_line(
    ffseg_command: Command, images: Path, tmp_path: Path, given: list[str], same: list[str]
) -> None:
    named = [part for key in same for part in ("--set", key)]
    ffseg_command("run", images / "a.png", "--out", tmp_path / "out", *given, code=0)
    ffseg_command("segment", images / "a.png", tmp_path / "at.png", *given, code=0)
    ffseg_command("segment", images / "a.png", tmp_path / "set.png", *named, code=0)
    masks = [read_mask(tmp_path / name) for name in ("out/masks/a.png", "at.png", "set.png")]
    assert all(np.array_equal(mask, masks[0]) for mask in masks)
    assert (masks[0][40, 30], masks[0][40, 90]) == (True, "90.5" in same[0])


def test_images_without_a_row_start_as_ever_and_are_told(ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    (images / "b.png").rename(images / "quite_another.png")
    done = ffseg_command("run", images, "--out", tmp_path / "out", "--starts", starts(tmp_path, "a,30,40,6"), code=0)
    assert "1 image of 2 without a row in" in done.stderr
    assert f"start as init or the model says: {images}/quite_another.png" in done.stderr


@pytest.mark.parametrize("command", ["run", "compare"])
def test_wrong_starts_end_with_2_unwritten(command: str, ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    cases = {
        "starts.csv: no row for the image 'b.png' (line 3 has 'b.pgn')": ("a,30,40,6", "b.pgn,90,40,6"),
        "starts.csv:3: y: '4O' is not a finite number": ("a,30,40,6", "b,90,4O,6"),
        "starts.csv:3: 'a' has this start already": ("a,30,40,6", "a,30,40,6", "b,1,1,1"),
    }
    for sentence, rows in cases.items():
        done = ffseg_command(command, images, "--out", tmp_path / "out", "--starts", starts(tmp_path, *rows), code=2)
        assert sentence in done.stderr
        assert "Traceback" not in done.stderr
    circles = ("--starts", starts(tmp_path, "a,30,40,6", "b,90,40,6"), "--set", "init.circles=[[30,40,6]]")
    done = ffseg_command(command, images, "--out", tmp_path / "out", *circles)
    assert (done.returncode, "init.circles is set too" in done.stderr) == (2, True)
    done = ffseg_command(command, images, "--out", tmp_path / "out", "--starts", tmp_path / "none.csv")
    assert (done.returncode, "none.csv: cannot be read" in done.stderr) == (2, True)
    assert not (tmp_path / "out").exists()


def test_a_start_that_had_to_move_is_told_and_noted(ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    """The start of b.png is a circle along the edge of the right disc."""
    path, out = starts(tmp_path, "a.png,30,40,6", "b.png,90,40,20"), tmp_path / "out"
    done = ffseg_command("run", images, "--out", out, "--starts", path, "--set", "edges.source=gradient", code=0)
    told = [line for line in done.stderr.splitlines() if "lay on an edge" in line]
    assert len(told) == 1
    assert "b.png: the start at (90, 40), radius 20 lay on an edge and was moved to (90, 40), radius 16.8" in told[0]
    rows = {row["image"]: row for row in table(out / "timings.csv")}
    assert rows["a.png"]["note"] == ""
    assert rows["b.png"]["note"] in told[0]
    assert rows["b.png"]["status"] == "ok"


def test_several_rows_of_an_image_merge_in_every_command(ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    path, out = starts(tmp_path, "a,30,40,6", "b,30,40,6", "a,90,40,"), tmp_path / "out"
    arguments = ("run", images, "--out", out, "--starts", path, "--set", "init.radius=7")
    plan = ffseg_command(*arguments, "--dry-run")
    assert f"{images}/a.png (start at 30, 40, radius 6; 90, 40) -> masks/a.png" in plan.stdout
    told = json.loads(ffseg_command(*arguments, "--dry-run", "--json").stdout)["images"]
    others = [{"x": 90, "y": 40, "radius": None, "others": []}]
    assert told[0]["start"] == {"x": 30, "y": 40, "radius": 6, "others": others}
    ffseg_command(*arguments, code=0)
    places = [read_mask(out / "masks" / name)[40, [30, 90]].tolist() for name in ("a.png", "b.png")]
    assert places == [[True, True], [True, False]]
    assert json.loads(ffseg_command(*arguments, "--json").stdout)["counts"]["unchanged"] == 2
    starts(tmp_path, "a,30,40,6", "b,30,40,6")
    counts = json.loads(ffseg_command(*arguments, "--json").stdout)["counts"]
    assert counts["unchanged"] == 1, "one image lost a start"
    starts(tmp_path, "a,30,40,6", "b,30,40,6", "a,90,40,")
    started = (images, "--starts", path)
    ffseg_command("compare", *started, "--out", tmp_path / "c", "--methods", "freeform,levelset", code=0)
    disc, truth = disc_of((80, 120)), tmp_path / "truth"
    write_image(truth / "a.png", disc(*LEFT, 19.99) | disc(*RIGHT, 19.99))
    masked = (*started, "--truth", truth, "--set", "init.radius=7", "--json", "-q")
    tuned = ffseg_command("tune", *masked, "--out", tmp_path / "mine.yaml", "--budget", "1", code=0)
    assert json.loads(tuned.stdout)["before"][0] > 0.95, "both discs are found, from both starts"
