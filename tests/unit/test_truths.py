"""True masks: what is inside is told, never guessed, and a wrong mask is what gets the blame."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from batches import make_images, run_batch, table
from PIL import Image

from ffseg.batch.workers.pictures import read_truth
from ffseg.errors import ImageReadError
from tests.masks import write_image

INSIDE = np.zeros((12, 16), np.bool_)
INSIDE[3:9, 4:12] = True
VOID = np.zeros_like(INSIDE)
VOID[2, 4:12] = True


def stored(folder: Path, levels: np.ndarray) -> str:
    path = folder / "truth.png"
    cv2.imwrite(str(path), levels)
    return str(path)


def expected(*, void: bool = False) -> np.ndarray:
    levels = np.where(INSIDE, 255, 0).astype(np.uint8)
    if void:
        levels[VOID] = 128
    return levels


@pytest.mark.parametrize(
    ("one", "void"), [(255, 128), (1, 0), (np.uint16(1), 0), (np.uint16(65535), np.uint16(128 * 257))]
)
def test_levels_that_speak_for_themselves(one: int, void: int, tmp_path: Path) -> None:
    levels = np.where(INSIDE, one, 0).astype(np.asarray(one).dtype if isinstance(one, np.uint16) else np.uint8)
    levels[VOID] = void
    np.testing.assert_array_equal(read_truth(stored(tmp_path, levels), (12, 16)), expected(void=void > 0))


def test_a_truth_of_one_bit_is_read(tmp_path: Path) -> None:
    Image.fromarray(INSIDE).save(tmp_path / "truth.png")
    np.testing.assert_array_equal(read_truth(str(tmp_path / "truth.png"), (12, 16)), expected())


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("number", [1, 2, 7, 128])
def test_a_class_number_is_inside_when_it_is_named(number: int, dtype: type, tmp_path: Path) -> None:
    levels = np.where(INSIDE, number, 3).astype(dtype)
    levels[VOID] = 255
    path = stored(tmp_path, levels)
    np.testing.assert_array_equal(read_truth(path, (12, 16), number), expected(void=True))
    with pytest.raises(ImageReadError, match=r"truth\.png holds the levels .*--truth-label K") as caught:
        read_truth(path, (12, 16))
    assert caught.value.reason == "truth"


def test_a_truth_in_which_nothing_counts_is_none(tmp_path: Path) -> None:
    with pytest.raises(ImageReadError, match=r"truth\.png has no pixel that counts: all are 128"):
        read_truth(stored(tmp_path, np.full((12, 16), 128, np.uint8)), (12, 16))


def test_soft_edges_are_told_from_class_numbers(tmp_path: Path) -> None:
    soft = np.linspace(0, 255, 192).astype(np.uint8).reshape(12, 16)  # a brush that fades
    with pytest.raises(ImageReadError, match=r"holds 192 levels, as a soft brush or JPEG leaves .* hard brush"):
        read_truth(stored(tmp_path, soft), (12, 16))
    with pytest.raises(ImageReadError, match=r"holds the levels 0, 1, 2, 3, 4, 5, \.\.\."):
        read_truth(stored(tmp_path, (soft // 8).astype(np.uint8)), (12, 16))  # 32 of them


def test_a_jpeg_has_no_class_numbers(tmp_path: Path) -> None:
    """A mask of two levels saved as JPEG holds a dozen: they were taken for classes, and --truth-label was the advice."""
    path = tmp_path / "truth.jpg"
    cv2.imwrite(str(path), expected(void=True))
    with pytest.raises(ImageReadError, match="as a soft brush or JPEG leaves at edges; .* save it as PNG"):
        read_truth(str(path), (12, 16))


def test_a_truth_drawn_on_a_transparent_layer(tmp_path: Path) -> None:
    """White strokes on transparent white, as some paint programs store them, were read as all inside."""
    layer = np.full((12, 16, 4), 255, np.uint8)
    layer[~INSIDE, 3] = 0
    with pytest.raises(ImageReadError, match="under transparent pixels; .* without transparency") as caught:
        read_truth(stored(tmp_path, layer), (12, 16))
    assert caught.value.reason == "truth"
    layer[~INSIDE, :3] = 0
    np.testing.assert_array_equal(read_truth(stored(tmp_path, layer), (12, 16)), expected())


def test_a_truth_of_another_size_says_what_it_should_be(tmp_path: Path) -> None:
    with pytest.raises(ImageReadError, match="has 16x12, the image 32x24 pixels; it must have the image's size"):
        read_truth(stored(tmp_path, expected()), (24, 32))


def test_a_truth_in_colours_counts_only_where_it_is_plain(tmp_path: Path) -> None:
    levels = np.zeros((12, 16, 3), np.uint8)
    levels[INSIDE] = (0, 0, 255)
    np.testing.assert_array_equal(read_truth(stored(tmp_path, levels), (12, 16)), expected())
    levels[INSIDE] = (0, 0, 128)  # the first class in the palette of many data sets
    with pytest.raises(ImageReadError, match="in colour"):
        read_truth(stored(tmp_path, levels), (12, 16))
    with pytest.raises(ImageReadError, match="need a grey image"):
        read_truth(stored(tmp_path, levels), (12, 16), 1)


def test_a_bad_truth_is_blamed_on_the_truth(tmp_path: Path) -> None:
    make_images(tmp_path / "in", ["a.png", "b.png"])
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "a.png").write_text("not an image")
    (tmp_path / "truth" / "b.png").write_bytes(b"")
    run_batch(tmp_path / "in", tmp_path / "out", truth=str(tmp_path / "truth"))
    errors = [row["error"] for row in table(tmp_path / "out" / "timings.csv")]
    assert all(error.startswith(f"truth: the true mask {tmp_path}/truth/") for error in errors)
    assert "not-an-image" in errors[0]
    assert "empty" in errors[1]


def test_truths_of_0_and_1_are_scored_like_0_and_255(tmp_path: Path) -> None:
    make_images(tmp_path / "in", ["a.png", "b.png"])
    overlaps = []
    for level, label in ((255, {}), (1, {}), (5, {"truth_label": 5})):
        folder = tmp_path / str(level)
        for name in ("a.png", "b.png"):
            write_image(folder / name, np.where(INSIDE, level, 0).astype(np.uint8))
        run_batch(tmp_path / "in", folder / "out", truth=str(folder), **label)
        overlaps.append([row["iou"] for row in table(folder / "out" / "timings.csv")])
    assert overlaps[0] == overlaps[1] == overlaps[2]
    assert all(float(overlap) > 0 for overlap in overlaps[0])
