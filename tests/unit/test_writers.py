"""Masks, tables and overlays as bytes."""

import csv
import io
import os
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from ffseg.errors import ParameterError
from ffseg.io.images import Limits
from ffseg.io.masks import encode_mask, load_mask
from ffseg.io.overlays import COLOURS, Polyline, draw_overlay, encode_overlay
from ffseg.io.tables import csv_table, neutral
from tests.masks import read_mask, write_image


def test_mask_is_8_bit_grey_of_0_and_255_and_reads_back(tmp_path: Path) -> None:
    mask = np.random.default_rng(3).random((13, 17)) < 0.4
    data = encode_mask(mask)
    image = Image.open(io.BytesIO(data))
    assert image.mode == "L"
    np.testing.assert_array_equal(np.asarray(image), np.where(mask, 255, 0))
    (tmp_path / "m.png").write_bytes(data)
    np.testing.assert_array_equal(read_mask(tmp_path / "m.png"), mask)


def test_mask_of_a_parameter_counts_every_level_but_0(tmp_path: Path) -> None:
    for highest in (np.uint8(255), np.uint16(300)):
        write_image(tmp_path / "m.png", np.array([[0, 1], [128, highest]], highest.dtype))
        mask = load_mask("domain.mask", str(tmp_path / "m.png"))
        assert mask is not None
        assert mask.tolist() == [[0, 255], [255, 255]]
    assert load_mask("domain.mask", None) is None


def test_mask_of_a_parameter_is_read_behind_the_gate_and_within_the_limits(tmp_path: Path) -> None:
    (tmp_path / "m.png").write_bytes(encode_mask(np.ones((9, 9), np.bool_)))
    os.mkfifo(tmp_path / "pipe")
    for name, limits, words in (
        ("pipe", None, "a named pipe"), ("m.png", Limits(max_pixels=80), "9x9 pixels"), ("", None, "a folder"),
    ):  # fmt: skip
        with pytest.raises(ParameterError, match=f"^init.mask: .*{words}"):
            load_mask("init.mask", str(tmp_path / name), limits)


@pytest.mark.parametrize("name", ["photo.png", "mask.jpg"])
def test_photographs_and_soft_masks_are_no_masks_of_a_parameter(name: str, tmp_path: Path) -> None:
    """Every level but 0 would count: all of a photograph, and what JPEG leaves round the edges."""
    rows, columns = np.mgrid[:90, :120]
    disc = (rows - 45) ** 2 + (columns - 60) ** 2 < 900
    levels = np.where(disc, 255, 0) if name == "mask.jpg" else 2 * rows + disc
    Image.fromarray(levels.astype(np.uint8)).save(tmp_path / name, quality=60)
    with pytest.raises(ParameterError, match=rf"^domain\.mask: .*{name} holds \d+ levels, as a photograph"):
        load_mask("domain.mask", str(tmp_path / name))


def test_mask_of_a_transposed_view_is_not_scrambled() -> None:
    mask = np.arange(12).reshape(3, 4).T % 5 == 0
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(encode_mask(mask)))) == 255, mask)


FORMULAS = ["=1+1", "+1", "-2+3", "@SUM(A1)", " =1+1", "   -2", "\u00a0@SUM(A1)", "\u3000+1"]
OTHERS = [" a=1", "a -1", "\t=1", " ", "1 = 1"]


@pytest.mark.parametrize("text", [*FORMULAS, *OTHERS])
def test_cells_that_look_like_formulas_are_neutralised_and_no_others(text: str) -> None:
    """A control character is written as such, so that what follows it begins no cell."""
    row = list(csv.reader(io.StringIO(csv_table(["a"], [[text]]).decode())))[1]
    assert row == [f"'{text}" if text in FORMULAS else text.replace("\t", "\\u0009")]


def test_a_formula_and_one_behind_an_apostrophe_are_two_cells() -> None:
    assert len({neutral(text) for text in ("=a", "'=a", "''=a", "' =a", " '=a")}) == 5


def test_numbers_keep_their_value() -> None:
    table = csv_table(["a", "b", "c", "d", "e"], [[-1, -0.1, None, float("nan"), np.float64(0.1).item()]]).decode()
    assert table == "a,b,c,d,e\n-1,-0.1,,,0.1\n"


@given(st.lists(st.text(st.characters(exclude_categories=["Cs"])), min_size=1, max_size=4))
def test_table_reads_back_with_a_csv_reader_one_line_a_row(cells: list[str]) -> None:
    text = csv_table([f"c{i}" for i in range(len(cells))], [cells]).decode("utf-8")
    assert text.count("\n") == 2
    row = list(csv.reader(io.StringIO(text, newline="")))[1]
    shown = [re.sub(r"[\x00-\x1f\x7f]", lambda hit: f"\\u{ord(hit.group()):04x}", cell) for cell in cells]
    assert row == [f"'{cell}" if cell.lstrip()[:1] in ("=", "+", "-", "@") and cell.strip() else cell for cell in shown]


def test_row_of_wrong_length_is_an_error() -> None:
    with pytest.raises(ValueError, match="3 cells"):
        csv_table(["a", "b"], [[1, 2, 3]])


def _nearest_kind(pixel: np.ndarray) -> str:
    candidates = {**COLOURS, "image": (90, 90, 90)}
    return min(candidates, key=lambda kind: float(np.abs(pixel - np.array(candidates[kind], float)).sum()))


def test_overlay_draws_each_kind_in_its_colour_and_leaves_the_image_alone() -> None:
    image = np.full((40, 60), 90, np.uint8)
    square = np.array([[5.0, 5], [25, 5], [25, 25], [5, 25]])
    drawn = draw_overlay(image, [Polyline(square, "outer"), Polyline(square + np.array([30, 5]), "obstacle")])
    assert _nearest_kind(drawn[5, 15]) == "outer"  # antialiasing leaves a little of the image on the line
    assert (_nearest_kind(drawn[10, 45]), tuple(drawn[15, 15])) == ("obstacle", (90, 90, 90))
    assert (image == 90).all()


def test_overlay_line_lies_on_its_coordinates() -> None:
    image = np.zeros((21, 21, 3), np.uint8)
    line = Polyline(np.array([[2.0, 10], [18, 10], [18, 10]]), "outer")
    rows = np.flatnonzero(draw_overlay(image, [line])[:, 10].any(axis=1))
    assert rows.mean() == 10


def test_overlay_survives_far_points_and_colour_images_are_copied() -> None:
    image = np.zeros((20, 20, 3), np.uint8)
    encode_overlay(image, [Polyline(np.array([[-1e300, 5], [1e300, 5], [5, 1e18]]), "outer")])
    draw_overlay(image, [Polyline(np.array([[1.0, 5], [9, 5], [5, 9]]), "false")])
    assert not image.any()
