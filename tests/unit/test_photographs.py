"""The campaign on photographs in short form: halves, choice, limits, and what is written."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from campaigns import photographs


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Four images a folder: a bright disc of radius 20; at even places its edge is strong, at odd ones weak."""
    y, x = np.mgrid[:90, :120]
    inside = np.hypot(x - 60, y - 45) < 20
    for folder in photographs.SETS:
        for kind in ("images", "truth"):
            (tmp_path / "data" / folder / kind).mkdir(parents=True)
        lines = ["image,seed_x,seed_y" + (",inner_radius_px" if folder == "road" else "")]
        for index in range(4):
            step = 20 if index % 2 else 120
            image = np.where(inside, 60 + step, 60).astype(np.uint8)
            truth = np.where(inside, 255, 0).astype(np.uint8)
            truth[:, :30] = 128
            cv2.imwrite(str(tmp_path / "data" / folder / "images" / f"{index}.png"), image)
            cv2.imwrite(str(tmp_path / "data" / folder / "truth" / f"{index}.png"), truth)
            lines.append(f"{index}.png,60,45" + (",12" if folder == "road" else ""))
        (tmp_path / "data" / folder / "seeds.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return tmp_path / "data"


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["photographs", *map(str, arguments)])
    return photographs.main()


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_the_even_places_choose_and_the_odd_ones_are_reported(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # A threshold of 8 holds the strong edge and not the weak one.
    monkeypatch.setitem(photographs.GRIDS, "cv_edges", {"threshold": (200.0, 8.0)})
    work = tmp_path / "work"
    assert run(monkeypatch, "--work", work, "--data", data, "--methods", "cv_edges,nothing") == 0
    assert "there is no method nothing" in capsys.readouterr().out
    grid = rows(work / "grid.csv")
    assert [row["parameters"] for row in grid] == ["threshold=200.0", "threshold=8.0"]
    assert float(grid[0]["road"]) < 0.3
    assert float(grid[1]["road"]) > 0.9
    found = rows(work / "photographs.csv")
    assert [(row["folder"], row["chosen_on"]) for row in found] == [
        ("road", "road"), ("road", "both"), ("seeded_objects", "seeded_objects"), ("seeded_objects", "both"),
    ]  # fmt: skip
    assert {row["parameters"] for row in found} == {"threshold=8.0"}
    assert max(float(row["mean_iou"]) for row in found) < 0.3
    assert {row["images"] for row in found} == {"2"}
    starts = rows(work / "starts-road.csv"), rows(work / "starts-seeded_objects.csv")
    assert [float(table[0]["radius"]) for table in starts] == [6.0, photographs.SMALL_START]
    assert "| cv_edges | `threshold=8.0` |" in (work / "photographs.md").read_text(encoding="utf-8")


def test_an_image_that_fails_counts_zero(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for folder in photographs.SETS:
        seeds = data / folder / "seeds.csv"
        seeds.write_text(seeds.read_text(encoding="utf-8").replace(",60,45", ",600,45"), encoding="utf-8")
    monkeypatch.setitem(photographs.GRIDS, "freeform", {"contour.clearance": (0.0, 8.0)})
    assert run(monkeypatch, "--work", tmp_path / "work", "--data", data, "--methods", "freeform") == 0
    found = rows(tmp_path / "work" / "photographs.csv")
    assert {(row["failed"], float(row["mean_iou"]), row["median_ms"]) for row in found} == {("2", 0.0, "")}


def endless() -> None:
    while True:
        pass


def test_work_is_limited() -> None:
    assert photographs.limited(lambda: 5, 1) == 5
    assert photographs.limited(endless, 1) is None
