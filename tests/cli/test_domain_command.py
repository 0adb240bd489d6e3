"""``ffseg domain`` and ``domain.masks``: one mask of all images, one for each folder or image, and runs within them."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from batches import table
from commands import Command

from tests.masks import read_mask, write_image

BONNET = np.indices((90, 120))[0] > 70


def images(folder: Path, count: int = 8, own: bool = True) -> None:
    for number in range(count):
        rng = np.random.default_rng(number)
        image = np.full((90, 120, 3), 120, np.uint8)
        for _ in range(15):
            x, y, w, h = rng.integers((0, 0, 8, 8), (120, 90, 50, 40))
            cv2.rectangle(image, (int(x), int(y)), (int(x + w), int(y + h)), rng.integers(60, 220, 3).tolist(), -1)
        if own:
            image[BONNET] = 30
        write_image(folder / f"{number}.png", image)


def test_one_mask_of_all_images(ffseg_command: Command, tmp_path: Path) -> None:
    images(tmp_path / "in")
    done = ffseg_command("domain", "in", "--out", "own.png", cwd=tmp_path, code=0)
    beyond = ~read_mask(tmp_path / "own.png")
    assert np.count_nonzero(beyond != BONNET) <= 240  # two rows: the limit lies on the crest of the gradient
    assert done.stdout.startswith("own.png: ")
    assert "stays in its place in 8 images" in done.stdout
    assert done.stdout.endswith("use it with --set domain.mask=own.png\n")
    settings = ("domain.mask=own.png", "init.center=[60,30]", "init.radius=10", "edges.canny=[250,255]")
    ffseg_command("run", "in/3.png", "--out", "out", *(f"--set={one}" for one in settings), cwd=tmp_path, code=0)
    region = read_mask(tmp_path / "out" / "masks" / "3.png")
    assert region.any()
    beyond = cv2.erode(beyond.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    assert not region[beyond].any()  # patches cut the corners of a domain by less than a pixel


def test_a_mask_for_each_folder_of_images(ffseg_command: Command, tmp_path: Path) -> None:
    images(tmp_path / "in" / "left")
    images(tmp_path / "in" / "day1" / "right", own=False)
    done = ffseg_command("domain", "in", "--out", "own", "--json", cwd=tmp_path, code=0)
    told = json.loads(done.stdout)["masks"]
    assert {one["out"] for one in told} == {"own/left.png", "own/day1/right.png"}
    assert [(one["images"], one["problems"]) for one in told] == [(8, [])] * 2
    assert read_mask(tmp_path / "own" / "left.png")[BONNET].mean() < 0.1
    assert read_mask(tmp_path / "own" / "day1" / "right.png").all()
    settings = ("--set", "domain.masks=own", "--set", "init.center=[60,30]", "--set", "init.radius=10")
    ffseg_command("run", "in", "--out", "out", *settings, cwd=tmp_path, code=0)


def test_what_goes_wrong_in_one_folder_is_named_and_the_rest_done(ffseg_command: Command, tmp_path: Path) -> None:
    images(tmp_path / "in" / "left")
    images(tmp_path / "in" / "few", 3)
    (tmp_path / "in" / "left" / "broken.png").write_bytes(b"no image")
    done = ffseg_command("domain", "in", "--out", "own", cwd=tmp_path, code=3)
    assert "in/left/broken.png: " in done.stderr
    assert "in 8 of 9 images" in done.stdout
    assert "no mask own/few.png: 3 images are too few; take 5 or more of one camera" in done.stderr
    assert [path.name for path in (tmp_path / "own").iterdir()] == ["left.png"]


def test_a_sample_is_spread_over_all_images(ffseg_command: Command, tmp_path: Path) -> None:
    images(tmp_path / "in", 12)
    done = ffseg_command("domain", "in", "--out", "own.png", "--sample", "5", cwd=tmp_path)
    assert "in 5 of 12 images" in done.stdout
    for number in (0, 3, 6, 8, 11):
        (tmp_path / "in" / f"{number}.png").write_bytes(b"")
    done = ffseg_command("domain", "in", "--out", "own.png", "--sample", "5", cwd=tmp_path)
    assert "0 images are too few" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("in", "--out", "own"), "for one mask of all images name a file: --out own.png"),
        (("in", "--out", "own.jpg"), "masks are PNG files; name it .png"),
        (("in", "--out", "no/own.png"), "there is no folder no"),
        (("none", "--out", "own.png"), "there is no file or folder none"),
        (("in", "few", "--out", "own.png"), "has another size than the images before it"),
        (("few", "--out", "own.png"), "3 images are too few"),
        (("in", "--out", "few/0.png"), "few/0.png is there already and not known as a file of ffseg"),
    ],
)
def test_nothing_is_written(ffseg_command: Command, tmp_path: Path, arguments: tuple[str, ...], words: str) -> None:
    images(tmp_path / "in")
    images(tmp_path / "few", 3)
    for path in (tmp_path / "few").iterdir():
        cv2.imwrite(str(path), cv2.imread(str(path))[:50])
    before = sorted(tmp_path.iterdir())
    done = ffseg_command("domain", *arguments, cwd=tmp_path, code=2)
    assert words in " ".join(done.stderr.split())
    assert (done.stdout, sorted(tmp_path.iterdir())) == ("", before)


FLAT = np.full((60, 80), 90, np.uint8)


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    for name in ("left/a.png", "left/b.png", "right/a.png"):
        write_image(tmp_path / "in" / name, FLAT)
    return tmp_path / "in"


def mask(path: Path, columns: slice) -> None:
    domain = np.zeros_like(FLAT)
    domain[:, columns] = 255
    write_image(path, domain)


def found(folder: Path, name: str) -> np.ndarray:
    return np.flatnonzero(read_mask(folder / "masks" / name)[30])


def test_masks_of_images_and_of_folders(ffseg_command: Command, pictures: Path, tmp_path: Path) -> None:
    mask(tmp_path / "domains" / "left.png", slice(0, 50))
    mask(tmp_path / "domains" / "left" / "b.png", slice(30, 80))
    mask(tmp_path / "domains" / "right" / "a.png", slice(20, 60))
    out = tmp_path / "out"
    given = ("run", pictures, "--out", out, "--set", "init.radius=6", "--set", f"domain.masks={tmp_path / 'domains'}")
    ffseg_command(*given, code=0)
    for name, first, last in (("left/a.png", 0, 49), ("left/b.png", 30, 79), ("right/a.png", 20, 59)):
        columns = found(out, name)
        assert abs(columns.min() - first) <= 1, name
        assert abs(columns.max() - last) <= 1, name
    assert "unchanged  3" in ffseg_command(*given).stdout
    mask(tmp_path / "domains" / "left.png", slice(0, 60))
    assert "unchanged  2" in ffseg_command(*given).stdout
    assert abs(found(out, "left/a.png").max() - 59) <= 1


def test_compare_takes_them(ffseg_command: Command, pictures: Path, tmp_path: Path) -> None:
    mask(tmp_path / "domains" / "left.png", slice(0, 50))
    mask(tmp_path / "domains" / "right.png", slice(0, 80))
    mask(tmp_path / "truth" / "left" / "a.png", slice(0, 50))
    given = ("--truth", tmp_path / "truth", "--set", f"domain.masks={tmp_path / 'domains'}", "--set", "init.radius=6")
    ffseg_command("compare", pictures, "--out", tmp_path / "out", "--methods", "freeform", *given, code=0)
    overlaps = {row["image"]: row["iou"] for row in table(tmp_path / "out" / "compare.csv")}
    assert float(overlaps["left/a.png"]) > 0.97


def test_what_is_missing_is_said(ffseg_command: Command, pictures: Path, tmp_path: Path) -> None:
    mask(tmp_path / "domains" / "left.png", slice(0, 50))
    run = ("run", pictures, "--out", tmp_path / "out", "--set")
    none = ffseg_command(*run, f"domain.masks={tmp_path / 'nowhere'}", code=2)
    assert "domain.masks: there is no folder" in none.stderr
    one = ffseg_command(*run, f"domain.masks={tmp_path / 'domains'}", code=2)
    assert "domain.masks: right/a.png has no mask of its name or of its folder's" in one.stderr
    one_of_all = ("--set", f"domain.mask={tmp_path / 'domains' / 'left.png'}")
    assert "do not go together" in ffseg_command(*run, f"domain.masks={tmp_path}", *one_of_all, code=2).stderr
    assert not (tmp_path / "out").exists()
