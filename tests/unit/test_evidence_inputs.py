"""Maps beside images: how they are found, read, refused, and known when a run goes on."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from commands import Command

from ffseg import api
from ffseg.batch.plan.beside import find_evidence
from ffseg.batch.plan.discover import discover
from ffseg.batch.workers.pictures import read_evidence
from ffseg.errors import ImageReadError, UsageError
from ffseg.rendering.pairs import CAMERA_YAML
from tests.discs import disc_of
from tests.masks import read_mask

SHAPE = (60, 80)
INSIDE = disc_of(SHAPE)(40, 30, 20)
"""What is inside of two even images, which only a map can tell."""
SHOWN = ("--set", "init.radius=8")
Words = tuple[str | Path, ...]


@pytest.fixture
def asked(tmp_path: Path) -> Words:
    """A run over the images, but for their maps."""
    (tmp_path / "in").mkdir()
    for name in ("a", "b"):
        cv2.imwrite(str(tmp_path / "in" / f"{name}.png"), np.full((*SHAPE, 3), 120, np.uint8))
    return ("run", tmp_path / "in", "--out", tmp_path / "out", "--evidence")


def written(folder: Path, kind: str = "png", inside: np.ndarray = INSIDE) -> Path:
    folder.mkdir(exist_ok=True)
    for name in ("a", "b"):
        if kind == "npy":
            np.save(folder / f"{name}.npy", inside.astype(np.float64))
        elif kind == "tiff16":
            cv2.imwrite(str(folder / f"{name}.tiff"), inside.astype(np.uint16) * np.uint16(65535))
        else:
            cv2.imwrite(str(folder / f"{name}.png"), inside.astype(np.uint8) * np.uint8(255))
    return Path(shutil.make_archive(str(folder), "tar", folder)) if kind == "tar" else folder


@pytest.mark.parametrize("kind", ["png", "tiff16", "npy", "tar"])
def test_run_takes_maps_and_sees_them_change(tmp_path: Path, kind: str, asked: Words, ffseg_command: Command) -> None:
    command = (*asked, written(tmp_path / "maps", kind), "--json", *SHOWN)
    ffseg_command(*command, code=0)
    assert np.count_nonzero(read_mask(tmp_path / "out" / "masks" / "a.png") ^ INSIDE) <= 0.03 * INSIDE.sum()
    assert json.loads(ffseg_command(*command).stdout)["counts"]["unchanged"] == 2
    written(tmp_path / "maps", kind, np.roll(INSIDE, 3, axis=1))
    again = json.loads(ffseg_command(*command).stdout)["counts"]
    assert (again["done"], again["unchanged"]) == (2, 0)


@pytest.mark.usefixtures("asked")
def test_compare_and_segment_take_maps(tmp_path: Path, ffseg_command: Command) -> None:
    maps = written(tmp_path / "maps")
    judged = ("--truth", maps, "--methods", "freeform,levelset", "--min-iou", "0.95")
    ffseg_command("compare", tmp_path / "in", "--out", tmp_path / "out", "--evidence", maps, *judged, *SHOWN, code=0)
    image, mask = tmp_path / "in" / "a.png", tmp_path / "a-mask.png"
    ffseg_command("segment", image, mask, "--evidence", maps / "a.png", *SHOWN, code=0)
    assert np.count_nonzero(read_mask(mask) ^ INSIDE) <= 0.03 * INSIDE.sum()


def test_a_map_of_another_size_fails_its_image(tmp_path: Path, asked: Words, ffseg_command: Command) -> None:
    maps = written(tmp_path / "maps")
    cv2.imwrite(str(maps / "b.png"), np.zeros((5, 5), np.uint8))
    assert ffseg_command(*asked, maps).returncode == 3
    assert "the map of evidence has 5 x 5 pixels, the image 80 x 60" in (tmp_path / "out" / "timings.csv").read_text()


def test_an_image_without_a_map_is_refused_before_any(tmp_path: Path, asked: Words, ffseg_command: Command) -> None:
    maps = written(tmp_path / "maps")
    (maps / "b.png").unlink()
    assert "b.png has no map of its name" in ffseg_command(*asked, maps, code=2).stderr
    assert not (tmp_path / "out").exists()
    with pytest.raises(UsageError, match="there is no folder"):
        find_evidence(discover([str(tmp_path / "in")]), str(tmp_path / "none"))


def test_maps_and_a_camera_are_refused_with_the_remedy(tmp_path: Path, asked: Words, ffseg_command: Command) -> None:
    (tmp_path / "camera.yaml").write_text(CAMERA_YAML)
    done = ffseg_command(*asked, written(tmp_path / "maps"), "--camera", tmp_path / "camera.yaml", code=2)
    said = " ".join(done.stderr.split())
    assert "--evidence and --camera do not go together" in said
    assert "leave out one of them, or name the network or .ffmodel that made the maps as edges.model" in said
    assert not (tmp_path / "out").exists()


def test_levels_become_shares(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.array([[0, 51, 255]], np.uint8))
    cv2.imwrite(str(tmp_path / "b.png"), np.array([[0, 13107, 65535]], np.uint16))
    np.save(tmp_path / "c.npy", np.array([[0, 0.2, 1]], np.float16))
    for name in ("a.png", "b.png", "c.npy"):
        np.testing.assert_allclose(read_evidence(str(tmp_path / name)), [[0, 0.2, 1]], atol=1e-4)  # half precision


@pytest.mark.parametrize(
    ("values", "why"),
    [
        (np.array([[np.nan]]), "from 0 to 1"),
        (np.array([[2.0]]), "from 0 to 1"),
        (np.array([[-0.1]]), "from 0 to 1"),
        (np.array([0.5]), "one value for each pixel"),
        (np.zeros((0, 3)), "one value for each pixel"),
        (np.array([["x"]]), "from 0 to 1"),
        (np.array([[1]], np.int64), "its int64 values are none of bool, uint8"),
        (np.array([[object()]]), "no NumPy array file"),
    ],
)
def test_arrays_that_are_no_maps_are_refused(tmp_path: Path, values: np.ndarray, why: str) -> None:
    np.save(tmp_path / "a.npy", values, allow_pickle=True)
    with pytest.raises(ImageReadError, match=why) as caught:
        read_evidence(str(tmp_path / "a.npy"))
    assert "a.npy" in str(caught.value)
    assert caught.value.reason == "evidence"


@pytest.mark.parametrize("data", [b"", b"\x93NUMPY", b"\x93NUMPY\x01\x00\x76\x00{'descr'", b"PK\x03\x04"])
def test_broken_arrays_are_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.npy").write_bytes(data)
    with pytest.raises(ImageReadError, match=r"a\.npy"):
        read_evidence(str(tmp_path / "a.npy"))


def test_a_mask_of_0_and_1_is_no_map(tmp_path: Path) -> None:
    """It was a map that is sure of the outside everywhere, and so the image's own edges decided, without a word."""
    mask = np.eye(3, dtype=np.uint8)
    for name, levels in (("a.png", mask), ("b.png", mask.astype(np.uint16))):
        cv2.imwrite(str(tmp_path / name), levels)
        with pytest.raises(ImageReadError, match=rf"{name} .* nothing but 0 and 1, .* multiply it by (255|65535)$"):
            read_evidence(str(tmp_path / name))
    np.save(tmp_path / "a.npy", mask)
    with pytest.raises(ImageReadError, match="nothing but 0 and 1"):
        read_evidence(str(tmp_path / "a.npy"))
    cv2.imwrite(str(tmp_path / "even.png"), np.zeros((3, 3), np.uint8))
    assert not read_evidence(str(tmp_path / "even.png")).any()


def test_a_map_that_tells_of_no_region_is_named() -> None:
    image, start = np.full((*SHAPE, 3), 120, np.uint8), {"init.radius": 8}
    low, high = np.full(SHAPE, 0.2, np.float32), np.full(SHAPE, 0.2, np.float32)
    high[20:40, 20:60] = 0.8
    said = (
        "the map of evidence nowhere crosses the probability 0.5 at which the region ends: the image's own edges decide"
    )
    assert said in api.segment(image, start, evidence=low).messages
    assert said not in api.segment(image, start, evidence=high).messages
    higher = api.segment(image, {**start, "region.probability": 0.9}, evidence=high).messages
    assert said.replace("0.5", "0.9") in higher
    assert said not in api.segment(image, {**start, "edges.evidence": "edges"}, evidence=low).messages


def test_a_coloured_map_is_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.array([[[1, 2, 3]]], np.uint8))
    with pytest.raises(ImageReadError, match="save it in grey"):
        read_evidence(str(tmp_path / "a.png"))


def test_damaged_headers_of_arrays_are_refused_by_name(tmp_path: Path) -> None:
    """One with a bracket too few ended `ffseg segment` as something unexpected: it is parsed as Python."""
    np.save(tmp_path / "a.npy", np.full((5, 6), 0.5, np.float32))
    good, random = (tmp_path / "a.npy").read_bytes(), np.random.default_rng(7)
    cases = [good.replace(b"(5, 6)", b"(5, 6 "), good.replace(b"(5, 6)", b"9**99 ")]
    for _ in range(300):
        case = bytearray(good)
        for place in random.integers(0, 128, 3):
            case[place] = random.integers(0, 256)
        cases.append(bytes(case))
    refused = 0
    for case in cases:
        (tmp_path / "a.npy").write_bytes(case)
        try:
            assert read_evidence(str(tmp_path / "a.npy")).dtype == np.float32
        except ImageReadError as error:
            refused += "a.npy cannot be used: " in str(error)
    assert refused > 200


def test_an_array_of_truth_values_is_a_map(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.eye(3, dtype=np.bool_))
    assert np.array_equal(read_evidence(str(tmp_path / "a.npy")), np.eye(3, dtype=np.float32))
