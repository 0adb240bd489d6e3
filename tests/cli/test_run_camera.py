"""``ffseg run --camera``: pairs, tables, overlays, what is refused, and what is done again."""

import os
import shutil
import subprocess
import tarfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from batches import table
from commands import Command
from rendered import render_pair, write_pair

from ffseg.rendering.pairs import CAMERA_YAML
from tests.discs import overlap
from tests.masks import read_mask, write_image


@pytest.fixture
def views(tmp_path: Path) -> Path:
    write_pair(tmp_path)
    return tmp_path


def run(
    ffseg_command: Command, folder: Path, *more: str | Path, out: str = "out", code: int | None = None
) -> subprocess.CompletedProcess[str]:
    return ffseg_command("run", folder / "views", "--out", folder / out, *more, code=code)


def with_camera(folder: Path) -> tuple[str | Path, ...]:
    return "--camera", folder / "camera.yaml", "--poses", folder / "poses.csv"


def test_the_snake_takes_the_altitudes_of_the_pair(ffseg_command: Command, views: Path) -> None:
    snake = ("--set", "method=snake")
    run(ffseg_command, views, *with_camera(views), *snake, code=0)
    notes = [row["note"] for row in table(views / "out" / "timings.csv")]
    assert "first image" in notes[0]
    assert "points let the snake pass" in notes[1]
    (views / "views" / "1.png").unlink()
    run(ffseg_command, views, *with_camera(views), *snake, out="alone", code=0)
    masks = [read_mask(views / out / "masks" / "2.png") for out in ("out", "alone")]
    marks = (render_pair(4).current.labels > 0) & (render_pair(4).current.labels <= len(render_pair(4).scene.marks))
    assert masks[0][marks].mean() > masks[1][marks].mean() + 0.5


def test_a_start_that_was_moved_is_told(ffseg_command: Command, views: Path) -> None:
    """Beside what the table alone says of each pair."""
    shape = render_pair(4).current.image.shape[:2]
    rows, columns = np.indices(shape)
    write_image(views / "domain.png", (rows >= shape[0] * 3 // 4) & (columns >= shape[1] // 2))
    done = run(ffseg_command, views, *with_camera(views), "--set", f"domain.mask={views / 'domain.png'}")
    told = [line for line in done.stderr.splitlines() if "lay outside the domain and was moved to" in line]
    assert [line.partition(".png: the start at ")[0][-1] for line in told] == ["1", "2"], done.stderr
    assert "first image" not in done.stderr


def test_a_sequence_writes_verdicts_and_merged_masks(ffseg_command: Command, views: Path) -> None:
    done = run(ffseg_command, views, *with_camera(views), "--overlay", code=0)
    assert "nothing was tested" not in done.stderr
    found = table(views / "out" / "obstacles.csv")
    assert list(found[0]) == [
        "image", "component", "area_px", "centroid_x", "centroid_y", "matched_points", "max_altitude_m", "verdict",
        "against", "ground_x_m", "ground_y_m", "track",
    ]  # fmt: skip
    assert {row["verdict"] for row in found if row["image"] == "1.png"} == {"untested"}
    assert {row["verdict"] for row in found if row["image"] == "2.png"} == {"obstacle", "false_obstacle"}
    assert overlap(read_mask(views / "out" / "masks" / "2.png"), render_pair(4).current.truth) > 0.985
    timings = table(views / "out" / "timings.csv")
    assert "first image" in timings[0]["note"]
    assert "refined on the ground" in timings[1]["note"]
    assert float(timings[1]["obstacles_ms"]) > 0
    overlay = cv2.imread(str(views / "out" / "overlays" / "2.png")).astype(int)
    redness = overlay[..., 2] - overlay[..., 0]
    assert (redness < -100).sum() > 50
    assert (redness > 100).sum() > 50


def test_pairs_name_the_previous_image(ffseg_command: Command, views: Path) -> None:
    (views / "pairs.csv").write_text("previous,current\n2.png,1.png\n")
    run(ffseg_command, views, *with_camera(views), "--pairs", views / "pairs.csv", code=0)
    found = table(views / "out" / "obstacles.csv")
    assert {row["verdict"] for row in found if row["image"] == "2.png"} == {"untested"}
    assert "false_obstacle" in {row["verdict"] for row in found if row["image"] == "1.png"}


def test_the_same_bytes_for_one_and_two_workers(ffseg_command: Command, views: Path) -> None:
    shutil.copy(views / "views" / "1.png", views / "views" / "3.png")
    one = run(ffseg_command, views, "--camera", views / "camera.yaml", out="one")
    two = run(ffseg_command, views, "--camera", views / "camera.yaml", "--jobs", "2", out="two")
    assert (one.returncode, two.returncode) == (0, 0)
    for name in ("obstacles.csv", "masks/2.png", "contours/2.svg", "masks/3.png"):
        assert (views / "one" / name).read_bytes() == (views / "two" / name).read_bytes()


def test_a_second_run_does_only_what_its_inputs_changed(ffseg_command: Command, views: Path) -> None:
    command = (*with_camera(views), "--json")
    run(ffseg_command, views, *command)
    assert '"unchanged": 2' in run(ffseg_command, views, *command).stdout
    image = render_pair(4).previous.image.copy()
    image[:5, :5] = 9
    cv2.imwrite(str(views / "views" / "1.png"), image)
    again = run(ffseg_command, views, *command)
    assert '"unchanged": 0' in again.stdout, "the second image is judged by the first, which has changed"
    text = (views / "poses.csv").read_text()
    (views / "poses.csv").write_text(text.replace("2.png,0.0,", "2.png,0.001,"))
    assert '"unchanged": 1' in run(ffseg_command, views, *command).stdout
    (views / "camera.yaml").write_text(CAMERA_YAML.replace("mount_height: 0.9", "mount_height: 1.1"))
    refused = run(ffseg_command, views, *command, code=2)
    assert "the camera file or --footprint has changed" in refused.stderr


def test_a_merge_names_shards_of_other_poses(ffseg_command: Command, views: Path) -> None:
    for part in ("1/2", "2/2"):
        run(ffseg_command, views, *with_camera(views), "--shard", part)
    ffseg_command("merge", views / "out", code=0)
    text = (views / "poses.csv").read_text()
    (views / "poses.csv").write_text(text.replace("2.png,0.0,", "2.png,0.001,"))
    run(ffseg_command, views, *with_camera(views), "--shard", "2/2")
    told = ffseg_command("merge", views / "out", code=3).stderr
    assert "shards 1/2 and 2/2 were run with other poses or pairs" in told


def test_bad_files_are_refused_before_the_first_image(ffseg_command: Command, views: Path) -> None:
    for text, said in (
        (CAMERA_YAML.replace("xi: 0.95", "xi: minus"), "xi: 'minus' is not"),
        (CAMERA_YAML.replace("mount_height: 0.9\n", ""), "bad.yaml: mount_height: missing"),
    ):
        (views / "bad.yaml").write_text(text)
        result = run(ffseg_command, views, "--camera", views / "bad.yaml", code=2)
        assert said in result.stderr
        assert not (views / "out").exists()


def test_an_image_without_a_pose_is_named_and_its_pair_goes_without(ffseg_command: Command, views: Path) -> None:
    head, first, *others = (views / "poses.csv").read_text().splitlines(keepends=True)
    (views / "some.csv").write_text("".join([head, *others]))
    run(ffseg_command, views, "--camera", views / "camera.yaml", "--poses", views / "some.csv", code=0)
    notes = [row["note"] for row in table(views / "out" / "timings.csv")]
    assert any(note.startswith(f"no pose of {first.partition(',')[0]}; ") for note in notes)


def test_another_size_or_a_broken_predecessor_costs_no_other_image(ffseg_command: Command, views: Path) -> None:
    cv2.imwrite(str(views / "views" / "0.png"), np.full((60, 80), 90, np.uint8))
    run(ffseg_command, views, "--camera", views / "camera.yaml", code=3)
    timings = {row["image"]: row for row in table(views / "out" / "timings.csv")}
    assert "80x60, the camera file says 800x600" in timings["0.png"]["error"]
    assert timings["0.png"]["error"].startswith("calibration: ")
    assert timings["1.png"]["status"] == "ok"
    assert "previous image 0.png cannot be used: it is 80x60, the camera file says 800x600" in timings["1.png"]["note"]
    assert timings["2.png"]["status"] == "ok"


def test_a_run_in_which_nothing_could_be_tested_says_why_and_how_much(ffseg_command: Command, views: Path) -> None:
    for name in ("1.png", "3.png"):
        shutil.copyfile(views / "views" / "2.png", views / "views" / name)
    done = run(ffseg_command, views, "--camera", views / "camera.yaml", code=0)
    found = table(views / "out" / "obstacles.csv")
    assert {row["verdict"] for row in found} == {"untested"}
    said = done.stderr.splitlines()
    assert f"ffseg: nothing was tested: {len(found)} enclosed components of 3 images stay untested" in said
    assert any(line.startswith("ffseg:   2 images: degenerate pair: ") for line in said)
    assert any(line.startswith("ffseg:   1 image: first image: ") for line in said)
    quiet = run(ffseg_command, views, "--camera", views / "camera.yaml", "--overwrite", "-q")
    assert "nothing was tested" not in quiet.stderr


def test_wrong_units_are_named_on_stderr(ffseg_command: Command, views: Path) -> None:
    lines = (views / "poses.csv").read_text().splitlines()
    cells = [line.split(",") for line in lines[1:]]
    wrong = [f"{name},{x},{y},{float(np.rad2deg(float(theta)))!r}" for name, x, y, theta in cells]
    (views / "poses.csv").write_text("\n".join([lines[0], *wrong, ""]))
    result = run(ffseg_command, views, *with_camera(views), "-v", code=0)
    said = [line for line in result.stderr.splitlines() if "theta looks like degrees" in line]
    assert [line.partition(": no motion: ")[0] for line in said] == ["ffseg: 2.png", "ffseg:   1 image"]
    assert "ffseg: 1.png: first image" in result.stderr
    assert {row["verdict"] for row in table(views / "out" / "obstacles.csv")} == {"untested"}
    assert [row["pair"] for row in table(views / "out" / "timings.csv")] == ["first", "untested"]


def test_pairs_that_could_not_be_tested_are_counted(ffseg_command: Command, views: Path) -> None:
    shutil.copyfile(views / "views" / "1.png", views / "views" / "0.png")
    result = run(ffseg_command, views, "--camera", views / "camera.yaml")
    assert "ffseg: 1 of 2 pairs untested:" in result.stderr.splitlines()
    assert "ffseg:   1 pair: degenerate pair: " in result.stderr
    quiet = run(ffseg_command, views, "--camera", views / "camera.yaml", "--overwrite", "-q")
    assert "untested" not in quiet.stderr


def test_overlays_show_what_verdicts_rest_on(ffseg_command: Command, views: Path) -> None:
    drawn = {}
    for out, more in (("plain", ()), ("drawn", ("--set", "obstacles.draw=true"))):
        run(ffseg_command, views, *with_camera(views), "--overlay", *more, out=out, code=0)
        overlay = cv2.imread(str(views / out / "overlays" / "2.png")).astype(int)
        drawn[out] = (np.abs(overlay - [255, 255, 120]).max(axis=2) < 40).sum()
    assert drawn["drawn"] > drawn["plain"] + 500
    assert (views / "plain/masks/2.png").read_bytes() == (views / "drawn/masks/2.png").read_bytes()


def test_a_sequence_in_a_tar_file_is_that_of_its_folder(ffseg_command: Command, views: Path) -> None:
    with tarfile.open(views / "views.tar", "w") as archive:
        for name in ("1.png", "2.png"):
            archive.add(views / "views" / name, name)
    run(ffseg_command, views, *with_camera(views), out="one")
    command = ("run", views / "views.tar", "--out", views / "out", *with_camera(views), "--json")
    ffseg_command(*command, code=0)
    for name in ("obstacles.csv", "masks/2.png", "contours/2.svg"):
        assert (views / "out" / name).read_bytes() == (views / "one" / name).read_bytes()
    os.utime(views / "views.tar", (1, 1))
    assert '"unchanged": 2' in ffseg_command(*command).stdout
