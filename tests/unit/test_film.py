"""Animations and film strips of an evolution."""

import base64
import io
import re
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from PIL import Image

import ffseg
from ffseg.batch.report.contours import read_contours
from ffseg.geometry.freeform import FreeForm
from ffseg.io.animation import FRAME_MS, LAST_MS, animation_bytes
from ffseg.io.snapshots import evenly_spaced, scaled_contour, scaled_down
from ffseg.io.strip import film_strip_svg
from ffseg.scene import Progress

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def evolution() -> tuple[np.ndarray, list[Progress]]:
    image = cv2.imread(str(ROOT / "samples" / "toy.png"))
    snapshots: list[Progress] = []
    ffseg.segment(image, ffseg.load_params("toy-full"), callback=snapshots.append)
    return image, snapshots


@pytest.mark.parametrize("kind", ["webp", "gif"])
def test_every_snapshot_is_a_frame(evolution: tuple[np.ndarray, list[Progress]], kind: str) -> None:
    image, snapshots = evolution
    film = Image.open(io.BytesIO(animation_bytes(image, snapshots, kind, 200)))
    assert (film.size, film.n_frames, film.info["loop"]) == ((200, 150), len(snapshots), 0)
    durations, greens = [], []
    for index in range(film.n_frames):
        film.seek(index)
        film.load()
        durations.append(film.info["duration"])
        pixels = np.asarray(film.convert("RGB")).astype(int)
        greens.append(int((pixels[..., 1] > pixels[..., 0] + 60).sum()))
    # GIF counts in hundredths of a second
    assert durations == [FRAME_MS] * (len(snapshots) - 1) + [LAST_MS]
    assert min(greens) > 0
    assert greens[-1] > 3 * greens[0]  # the outline has grown


def test_same_input_same_bytes(evolution: tuple[np.ndarray, list[Progress]]) -> None:
    image, snapshots = evolution
    assert animation_bytes(image, snapshots[:3], "webp", 100) == animation_bytes(image, snapshots[:3], "webp", 100)


def test_grey_images_and_no_enlarging() -> None:
    grey = np.full((30, 40), 128, np.uint8)
    snapshots = [Progress(0, (FreeForm.circle((20, 15), 8, 6, 3),))]
    assert Image.open(io.BytesIO(animation_bytes(grey, snapshots, "webp", 640))).size == (40, 30)


def test_contour_stays_on_its_edge_when_scaled() -> None:
    image = np.zeros((600, 800), np.uint8)
    image[150:450, 200:600] = 255  # corners at 200 and 600, pixel centres from 200 to 599
    small, scale = scaled_down(image, 200)
    box = scaled_contour(FreeForm.box(199.5, 149.5, 599.5, 449.5), scale).bounding_box
    columns = np.flatnonzero(small[75, :, 0])
    np.testing.assert_allclose(box, [[columns[0] - 0.5, 37.0], [columns[-1] + 0.5, 112.0]], atol=1e-12)


@pytest.mark.parametrize(("length", "count"), [(1, 6), (6, 6), (7, 6), (100, 6), (100, 2)])
def test_spread_keeps_first_and_last(length: int, count: int) -> None:
    snapshots = [Progress(index, ()) for index in range(length)]
    chosen = [snapshot.iteration for snapshot in evenly_spaced(snapshots, count)]
    assert len(chosen) == min(length, count)
    assert (chosen[0], chosen[-1]) == (0, length - 1)
    assert all(a < b for a, b in pairwise(chosen))


def test_film_strip_holds_the_exact_contours(evolution: tuple[np.ndarray, list[Progress]]) -> None:
    image, snapshots = evolution
    text = film_strip_svg(image, snapshots, 4, title="a <b> & c")
    root = ElementTree.fromstring(text)  # noqa: S314 - our own text
    name = "{http://www.w3.org/2000/svg}"
    assert root.findtext(f"{name}title") == "a <b> & c"
    captions = [item.text for item in root.iter(f"{name}text")]
    assert (len(captions), captions[0]) == (4, "iteration 0")
    assert captions[-1] == f"iteration {snapshots[-1].iteration}"
    last = list(root)[-1]
    found = read_contours(ElementTree.tostring(last, encoding="unicode").replace("ns0:", ""))
    expected = sorted(c.signed_area for c in snapshots[-1].contours)
    assert sorted(c.signed_area for c in found) == pytest.approx(expected, abs=0.5)
    assert [item.get("stroke") for item in last.iter(f"{name}path")].count("#f03c3c") == 4  # the toy's holes


def test_film_strip_carries_its_picture(evolution: tuple[np.ndarray, list[Progress]]) -> None:
    image, snapshots = evolution
    (embedded,) = re.findall(r'href="data:image/jpeg;base64,([^"]+)"', film_strip_svg(image, snapshots, 3))
    picture = cv2.imdecode(np.frombuffer(base64.b64decode(embedded), np.uint8), cv2.IMREAD_COLOR)
    small, _ = scaled_down(image, 400)
    # JPEG at quality 80 rings at black and white edges; the mean tells whether it is the image at all
    assert np.abs(picture.astype(int) - small.astype(int)).mean() < 4


@pytest.mark.parametrize("write", [animation_bytes, film_strip_svg])
def test_no_snapshot_is_an_error(write: object) -> None:
    with pytest.raises(ValueError, match="at least one snapshot"):
        write(np.zeros((4, 4), np.uint8), [])  # type: ignore[operator]


def test_film_of_a_tall_image_fits_its_format() -> None:
    image = np.full((20_000, 12), 90, np.uint8)
    snapshots = [Progress(0, (FreeForm.box(2, 2, 8, 8),))]
    assert Image.open(io.BytesIO(animation_bytes(image, snapshots))).size == (2, 4096)
