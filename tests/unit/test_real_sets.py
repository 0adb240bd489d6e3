"""The campaign on real sets in short form: what it counts and notices."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ffseg.parameter_files import load_params
from tests import real_data
from tests.campaigns import real_images, real_invariance, real_sets
from tests.masks import write_image


def test_an_empty_variable_names_no_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """`FFSEG_DATA= pytest` would take the working directory for the images."""
    beside = real_data.ROOT.parent / "shared" / "data"
    for value, folder in ((None, beside), ("", beside), (str(tmp_path), tmp_path)):
        with monkeypatch.context() as patch:
            patch.delenv("FFSEG_DATA", raising=False)
            if value is not None:
                patch.setenv("FFSEG_DATA", value)
            assert real_data.data_folder() == folder


def photograph(step: int = 120, folder: str = "road") -> real_images.Photograph:
    """A disc of radius 30 brighter than its ground by `step`, with an ignored stripe at the left."""
    y, x = np.mgrid[:90, :120]
    inside = np.hypot(x - 60, y - 45) < 30
    image = np.where(inside, 60 + step, 60).astype(np.uint8)
    truth = np.where(inside, 255, 0).astype(np.uint8)
    truth[:, :20] = 128
    return real_images.Photograph(folder, "a.png", image, truth, (60.0, 45.0, 12.0))


def drawn(data: Path, folder: str, steps: tuple[int, ...], head: str = "image,seed_x,seed_y,inner_radius_px") -> None:
    """A set of images whose discs stand out by `steps`."""
    lines = [head]
    for index, step in enumerate(steps):
        one = photograph(step)
        write_image(data / folder / "images" / f"{index}.png", one.image)
        write_image(data / folder / "truth" / f"{index}.png", one.truth)
        lines.append(f"{index}.png,60,45,{24 if 'inner' in head else 12}")
    (data / folder / "seeds.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Two sets of two images; in the second of each the border of the disc is too faint to hold."""
    drawn(tmp_path, "road", (120, 1))
    drawn(tmp_path, "real_floors/omni", (120, 1), "image,x,y,radius")
    return tmp_path


def test_tables(data: Path, capsys) -> None:
    assert real_sets.main(data) == 0
    said = capsys.readouterr().out
    assert "left out: seeded_objects" in said
    table = {tuple(cells[:2]): cells[2:] for line in said.splitlines() if (cells := line.strip("| ").split(" | "))[2:]}
    names = ("road", "real_floors/omni", "all")
    assert list(table)[2:] == [(name, half) for name in names for half in real_sets.HALVES]
    assert [float(table["road", half][1]) > 0.9 for half in real_sets.HALVES] == [True, False]
    assert [row[0] for row in table.values()][2:] == ["1", "1", "1", "1", "2", "2"]
    assert real_sets.main(data, half="odd", settings=["edges.canny=[0.1,0.2]"]) == 0
    said = capsys.readouterr().out
    assert "even" not in said
    assert float(said.splitlines()[-1].split(" | ")[3]) > 0.9


def test_an_image_that_fails_counts_zero() -> None:
    outcome = real_images.evaluate(replace(photograph(), circle=(600.0, 45.0, 12.0)), load_params())
    assert (outcome.overlap, outcome.score) == (0.0, 0.0)
    assert "outside the image" in outcome.message


def test_spearman_with_ties() -> None:
    assert real_sets.spearman([1, 2, 3, 4], [10, 20, 30, 40]) == pytest.approx(1)
    assert real_sets.spearman([1, 2, 3, 4], [4, 3, 2, 1]) == pytest.approx(-1)
    # Ranks 1, 2.5, 2.5, 4 against 1, 3, 2, 4: covariance 4.5 / 4, variances 4.5 / 4 and 5 / 4.
    assert real_sets.spearman([0, 5, 5, 9], [1, 3, 2, 4]) == pytest.approx(4.5 / np.sqrt(4.5 * 5))
    assert np.isnan(real_sets.spearman([1, 1, 1], [1, 2, 3]))


@pytest.mark.parametrize("change", real_invariance.CHANGES, ids=lambda change: change.name)
def test_a_region_of_colours_survives_every_change(change: real_invariance.Change, monkeypatch) -> None:
    """With the segmenter replaced by one that cannot err, every change gives the region back."""
    one = photograph()
    monkeypatch.setattr(real_invariance, "region", lambda photo, params: photo.truth == 255)
    assert real_invariance.agreement(one, change, load_params()) == 1.0
    before = change.before(one)
    after = change.of(before)
    assert not np.array_equal(after.image, before.image) or after.circle != before.circle


def test_the_start_stays_in_the_region_when_moved() -> None:
    moved = next(change for change in real_invariance.CHANGES if change.name == "start moved").of(photograph())
    x, y, radius = moved.circle
    assert (x, y) != (60.0, 45.0)
    v, u = np.mgrid[:90, :120]
    assert (moved.truth[np.hypot(u - x, v - y) <= radius] == 255).all()
