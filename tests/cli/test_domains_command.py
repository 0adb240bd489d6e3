"""``domain.masks``: each image's own domain, by its name or its folder's."""

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
from commands import Command

FLAT = np.full((60, 80), 90, np.uint8)


@pytest.fixture
def images(tmp_path: Path) -> Path:
    for name in ("left/a.png", "left/b.png", "right/a.png"):
        (tmp_path / "in" / name).parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(tmp_path / "in" / name), FLAT)
    return tmp_path / "in"


def mask(path: Path, columns: slice) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    domain = np.zeros_like(FLAT)
    domain[:, columns] = 255
    cv2.imwrite(str(path), domain)


def found(folder: Path, name: str) -> np.ndarray:
    return np.nonzero(cv2.imread(str(folder / "masks" / name), cv2.IMREAD_GRAYSCALE)[30])[0]


def test_masks_of_images_and_of_folders(ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    mask(tmp_path / "domains" / "left.png", slice(0, 50))
    mask(tmp_path / "domains" / "left" / "b.png", slice(30, 80))
    mask(tmp_path / "domains" / "right" / "a.png", slice(20, 60))
    out = tmp_path / "out"
    arguments = ("run", images, "--out", out, "--set", "init.radius=6")
    given = (*arguments, "--set", f"domain.masks={tmp_path / 'domains'}")
    done = ffseg_command(*given)
    assert done.returncode == 0, done.stderr
    for name, first, last in (("left/a.png", 0, 49), ("left/b.png", 30, 79), ("right/a.png", 20, 59)):
        columns = found(out, name)
        assert abs(columns.min() - first) <= 1, name
        assert abs(columns.max() - last) <= 1, name
    assert "unchanged  3" in ffseg_command(*given).stdout
    mask(tmp_path / "domains" / "left.png", slice(0, 60))
    assert "unchanged  2" in ffseg_command(*given).stdout
    assert abs(found(out, "left/a.png").max() - 59) <= 1


def test_compare_takes_them(ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    mask(tmp_path / "domains" / "left.png", slice(0, 50))
    mask(tmp_path / "domains" / "right.png", slice(0, 80))
    mask(tmp_path / "truth" / "left" / "a.png", slice(0, 50))
    done = ffseg_command(
        "compare", images, "--out", tmp_path / "out", "--methods", "freeform", "--truth", tmp_path / "truth",
        "--set", f"domain.masks={tmp_path / 'domains'}", "--set", "init.radius=6",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with (tmp_path / "out" / "compare.csv").open(encoding="utf-8", newline="") as file:
        overlaps = {row["image"]: row["iou"] for row in csv.DictReader(file)}
    assert float(overlaps["left/a.png"]) > 0.97


def test_what_is_missing_is_said(ffseg_command: Command, images: Path, tmp_path: Path) -> None:
    mask(tmp_path / "domains" / "left.png", slice(0, 50))
    run = ("run", images, "--out", tmp_path / "out", "--set")
    none = ffseg_command(*run, f"domain.masks={tmp_path / 'nowhere'}")
    assert none.returncode == 2
    assert "domain.masks: there is no folder" in none.stderr
    one = ffseg_command(*run, f"domain.masks={tmp_path / 'domains'}")
    assert one.returncode == 2
    assert "domain.masks: right/a.png has no mask of its name or of its folder's" in one.stderr
    both = ffseg_command(*run, f"domain.masks={tmp_path}", "--set", f"domain.mask={tmp_path / 'domains' / 'left.png'}")
    assert both.returncode == 2
    assert "do not go together" in both.stderr
    assert not (tmp_path / "out").exists()
