"""The report page without a browser: contours read back and packed, tables, names, links."""

import base64
import json
import os
import re
import shutil
import zlib
from pathlib import Path
from urllib.parse import unquote

import cv2
import numpy as np
import pytest
import runs
from hypothesis import given
from hypothesis import strategies as st

from ffseg.batch.report import folder as report_folder
from ffseg.batch.report.contours import UNITS, centroid, packed_components, packed_path, read_contours
from ffseg.batch.report.page import page, script_json
from ffseg.batch.report.thumbnails import thumbnail_of
from ffseg.batch.report.write import write_report
from ffseg.errors import UsageError
from ffseg.geometry.freeform import FreeForm
from ffseg.io.files import printable, unprintable
from ffseg.io.svg import DECIMALS, svg_document
from ffseg.io.tables import csv_table, meant_by, neutral

SIMPLE = runs.ROOT / "samples" / "simple.png"
HOSTILE = "</script><img src=x onerror=alert(1)>&amp;\"'.png"


def unpacked(text: str) -> list[dict[str, object]]:
    return list(json.loads(zlib.decompress(base64.b64decode(text), -15)))


def drawn_points(path: str) -> np.ndarray:
    """Control points of a packed path, by walking it as SVG says: each patch relative to where the pen stands."""
    head, letter, rest = re.fullmatch(r"M(.*?)([lqc])(.*)z", path).groups()  # type: ignore[union-attr]
    degree = "lqc".index(letter) + 1
    pen = np.array(head.split(), dtype=float)
    points = [pen]
    for patch in np.array(rest.split(), dtype=float).reshape(-1, degree, 2):
        points += list(pen + patch)
        pen = points[-1]
    return np.array(points) / UNITS - 0.5


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_svg_is_read_back(degree: int) -> None:
    outer = FreeForm.circle((50.25, 40.5), 30, 8, degree)
    hole = FreeForm.circle((45, 41), 9, 5, degree).reversed()
    found = read_contours(svg_document([outer, hole], 100, 80, title="a path d='M0,0'"))
    assert [contour.degree for contour in found] == [degree, degree]
    for contour, expected in zip(found, (outer, hole), strict=True):
        np.testing.assert_allclose(contour.control_points, expected.control_points, atol=0.51 * 10.0**-DECIMALS)


def test_high_degrees_are_read_as_the_cubics_they_were_written_as() -> None:
    found = read_contours(svg_document([FreeForm.circle((50, 40), 30, 4, 5)], 100, 80))
    assert found[0].degree == 3
    assert found[0].signed_area == pytest.approx(FreeForm.circle((50, 40), 30, 4, 5).signed_area, abs=1.0)


@pytest.mark.parametrize(
    "data", ["M0,0 A1,1 0 0 0 2,2 Z", "M0,0 L1,1 C1,2 3,4 5,6 Z", "M0,0 Z", "M0,0 L1,1);alert(1 Z"]
)
def test_other_paths_are_refused(data: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - any reason will do
        read_contours(f'<svg><path fill-rule="evenodd" d="{data}"/></svg>')


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_packed_path_is_the_contour_to_half_a_unit(degree: int) -> None:
    contour = FreeForm.circle((512.3, 300.7), 200, 60, degree)
    points = drawn_points(packed_path(contour))
    closed = np.concatenate([contour.control_points, contour.control_points[:1]])
    np.testing.assert_allclose(points, closed, atol=0.5 / UNITS + 1e-9)
    assert (points[0] == points[-1]).all()


def test_centroid_of_a_box_and_of_a_hole() -> None:
    assert centroid(FreeForm.box(10, 20, 30, 60)) == pytest.approx((20, 40))
    assert centroid(FreeForm.box(10, 20, 30, 60).reversed()) == pytest.approx((20, 40))
    assert centroid(FreeForm.polygon([(0, 0), (3, 0), (0, 3)])) == pytest.approx((1, 1))


def test_verdicts_find_their_hole_or_stand_alone() -> None:
    holes = [FreeForm.circle(center, 5, 8, 3).reversed() for center in ((20, 20), (60, 20))]
    contours = [FreeForm.box(0, 0, 100, 60).elevated(3), *holes]
    rows = [
        {"centroid_x": 60.4, "centroid_y": 20.3, "area_px": 79, "verdict": "obstacle", "max_altitude_m": 0.3},
        {"centroid_x": 80.0, "centroid_y": 50.0, "area_px": 40, "verdict": "false_obstacle", "matched_points": 4},
    ]
    parts = unpacked(packed_components(contours, rows))
    assert [part.get("verdict") for part in parts] == [None, None, "obstacle", "false_obstacle"]
    assert "d" not in parts[3]
    assert (parts[3]["at"], parts[3]["area"], parts[3]["points"]) == ([80.0, 50.0], -40.0, 4)


def test_json_cannot_end_its_script() -> None:
    text = script_json({"name": HOSTILE + "<!-- \u2028"})
    assert not set("<>&") & set(text)
    assert text.isascii()
    assert json.loads(text) == {"name": HOSTILE + "<!-- \u2028"}


def test_title_is_escaped_and_the_page_has_one_script() -> None:
    text = page(HOSTILE, {"images": []})
    assert text.count("<script") == 2  # the data and the program
    assert "<img" not in text.partition("<script")[0]
    assert "http://" not in text.replace("http://www.w3.org/2000/svg", "")
    assert "https://" not in text


def test_report_of_a_run(tmp_path: Path) -> None:
    results = runs.sample_run(tmp_path, failures=[(HOSTILE, "truncated: the data ends")])
    data = runs.data_of(write_report(tmp_path))
    assert (data["kind"], data["failed"]) == ("run", 1)
    images = data["images"]
    assert [image["name"] for image in images] == ["complex.png", "simple.png", "toy.png", HOSTILE]
    assert images[0]["rows"][0]["holes"] == sum(c.signed_area < 0 for c in results[0].contours)
    assert images[3]["rows"] == [{"status": "failed", "error": "truncated: the data ends", "method": "freeform"}]
    assert images[3]["pictures"] == {}
    areas = [part["area"] for part in unpacked(images[0]["contours"])]
    assert sorted(areas) == pytest.approx(sorted(c.signed_area for c in results[0].contours), abs=1.0)
    assert all((tmp_path / unquote(path)).is_file() for image in images for path in image["pictures"].values())
    assert set(images[0]["pictures"]) == {"image", "overlay", "mask"}
    assert images[0]["thumbnail"].startswith("data:image/webp;base64,")


def test_pictures_for_which_there_is_no_memory_are_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def starved(*_: object) -> None:
        raise MemoryError

    runs.sample_run(tmp_path)
    monkeypatch.setattr("ffseg.batch.report.thumbnails.decode_image", starved)
    assert {image["thumbnail"] for image in runs.data_of(write_report(tmp_path))["images"]} == {""}


def test_parameters_that_differ_are_marked(tmp_path: Path) -> None:
    runs.sample_run(tmp_path)
    lines = {key: (value, changed) for key, value, changed in runs.data_of(write_report(tmp_path))["parameters"]}
    assert (lines["contour.degree"], lines["init.center"]) == (("2", True), ('"auto"', False))


def test_odd_names_are_linked_to_their_files(tmp_path: Path) -> None:
    image, result = runs.sample("toy")
    stems = ["=cmd", "a b#c?d%41", "line\nbreak", "back\\slash", "\udcff\udcfe", "sub/é", "<b>"]
    for stem in stems:
        runs.write_outputs(tmp_path, stem, image, result)
    runs.write_tables(tmp_path, [runs.done_row(f"{stem}.jpg", result) for stem in stems], [])
    images = runs.data_of(write_report(tmp_path))["images"]
    assert [image["name"] for image in images][:2] == ["'=cmd.jpg", "a b#c?d%41.jpg"]
    for image, stem in zip(images, stems, strict=True):
        assert unquote(image["pictures"]["mask"], errors="surrogateescape") == f"masks/{stem}.png"
        assert image["contours"]


def test_unreadable_images_are_not_given_to_the_browser(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (tmp_path / "in").mkdir()
    for name in ("bomb.png", "blocked.png"):
        shutil.copy(SIMPLE, tmp_path / "in" / name)
    failures = {"bomb.png": "too-many-pixels: 10^9", "blocked.png": "segmentation: no room"}
    runs.write_tables(out, [runs.failed_row(*failure) for failure in failures.items()], [tmp_path / "in"])
    images = runs.data_of(write_report(out))["images"]
    assert [set(image["pictures"]) for image in images] == [set(), {"image"}]


def test_sources_can_be_named(tmp_path: Path) -> None:
    runs.sample_run(tmp_path)
    (tmp_path / "run.json").write_text("{}")
    assert "image" not in runs.data_of(write_report(tmp_path))["images"][0]["pictures"]
    images = runs.data_of(write_report(tmp_path, [str(runs.ROOT / "samples")]))["images"]
    assert (tmp_path / images[0]["pictures"]["image"]).samefile(runs.ROOT / "samples" / "complex.png")


def test_report_of_a_comparison(tmp_path: Path) -> None:
    rows = []
    for method, iou in (("freeform", 0.99), ("snake", 0.8)):
        rows.append(["a.png", method, 39, 100, 50, 2.0, 5.0, 8.0, iou, 0.1, 1.0, 2, "ok", ""])
        rows.append(["b.png", method, *[None] * 10, "failed", "truncated: x"])
    (tmp_path / "compare.csv").write_bytes(csv_table(runs.COMPARED, rows))
    (tmp_path / "panels").mkdir()
    shutil.copy(SIMPLE, tmp_path / "panels" / "a.png")
    data = runs.data_of(write_report(tmp_path))
    assert data["kind"] == "compare"
    assert [[row["method"] for row in image["rows"]] for image in data["images"]] == [["freeform", "snake"]] * 2
    assert data["images"][0]["pictures"] == {"panel": "panels/a.png"}


@pytest.mark.parametrize("content", ["{", "[" * 200_000], ids=["cut", "of endless depth"])
def test_a_run_json_that_is_none_is_named(content: str, tmp_path: Path) -> None:
    runs.sample_run(tmp_path)
    (tmp_path / "run.json").write_text(content)
    with pytest.raises(UsageError, match=r"run\.json is no JSON"):
        write_report(tmp_path)


@pytest.mark.parametrize("content", ["[1]", ""])
def test_a_run_json_without_parameters_shows_none(content: str, tmp_path: Path) -> None:
    runs.sample_run(tmp_path)
    (tmp_path / "run.json").write_text(content)
    assert runs.data_of(write_report(tmp_path))["parameters"] == []


def test_broken_contours_are_left_out(tmp_path: Path) -> None:
    runs.sample_run(tmp_path)
    (tmp_path / "contours" / "toy.svg").write_text('<svg><path d="M0,0 L1,1"/><path d="M0 Z"/></svg>')
    contours = [image["contours"] for image in runs.data_of(write_report(tmp_path))["images"]]
    assert [bool(text) for text in contours] == [True, True, False]


def test_thumbnails_are_embedded_up_to_a_size(tmp_path: Path) -> None:
    runs.sample_run(tmp_path)

    def embedded(size: int) -> int:
        return sum("thumbnail" in image for image in runs.data_of(write_report(tmp_path, (), size))["images"])

    assert (embedded(0), embedded(1)) == (0, 1)
    assert embedded(20_000_000) > 1


def test_a_thumbnail_has_the_levels_that_were_read() -> None:
    _, packed = cv2.imencode(".png", np.full((20, 30), 4000, np.uint16))  # of 12 bits
    shown = base64.b64decode(thumbnail_of(packed.tobytes()).partition(",")[2])
    assert cv2.imdecode(np.frombuffer(shown, np.uint8), 0).min() > 240


@pytest.mark.parametrize("content", ["", "a,b\n1,2\n", "\x00\x01"])
def test_a_table_of_nothing_is_named(content: str, tmp_path: Path) -> None:
    (tmp_path / "timings.csv").write_text(content)
    with pytest.raises(UsageError, match=r"timings\.csv is no table of images"):
        write_report(tmp_path)


def test_open_tags_are_looked_through_once() -> None:
    assert read_contours("<path " * 200_000) == ()  # 40 times longer for each that looked for its own end


@pytest.mark.parametrize("data", ["M0,0 L1e999,1 5,5 Z", "M0,0 L1e8,1 5,5 Z"])
def test_contours_beyond_any_image_are_refused(data: str) -> None:
    with pytest.raises(ValueError, match="farther away"):
        read_contours(f'<svg><path d="{data}"/></svg>')


def test_more_contours_than_asked_for_are_refused() -> None:
    square = "M0,0 L5,0 5,5 Z"
    assert len(read_contours(f'<path d="{square} {square}"/>', 2)) == 2
    with pytest.raises(ValueError, match="more than 1 contours"):
        read_contours(f'<path d="{square} {square}"/>', 1)


def test_folders_that_inputs_name_are_not_walked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runs.sample_run(tmp_path)
    image = runs.ROOT / "samples" / "complex.png"
    (tmp_path / "run.json").write_text(json.dumps({"inputs": ["/", "/**/*.png", f"{image.parent}/*.png", 7, None]}))
    for name in ("walk", "scandir", "listdir"):
        monkeypatch.setattr(os, name, None)
    images = runs.data_of(write_report(tmp_path))["images"]
    assert (tmp_path / images[0]["pictures"]["image"]).samefile(image)
    assert images[0]["contours"]


def test_names_that_lead_out_find_no_picture(tmp_path: Path) -> None:
    out, secret = tmp_path / "out", tmp_path / "secret.png"
    (out / "masks").mkdir(parents=True)
    (tmp_path / "in").mkdir()
    shutil.copy(SIMPLE, secret)
    names = ["../secret.png", str(secret), "../../secret.png", "a/../../secret.png", "nul\\u0000.png"]
    runs.write_tables(out, [runs.failed_row(name, "segmentation: x") for name in names], [tmp_path / "in"])
    (out / "timings.csv").write_text((out / "timings.csv").read_text().replace(",failed,", ",ok,"))
    images = runs.data_of(write_report(out))["images"]
    assert (len(images), [image["pictures"] for image in images]) == (len(names), [{}] * len(names))


@pytest.mark.parametrize(
    "text",
    [
        '{"parameters": {"a": NaN, "b": [Infinity]}, "seconds": NaN, "problems": [NaN], "counts": {"done": NaN}}',
        '{"problems": "one", "counts": [1], "versions": 3, "status": {"a": 1}, "started": [], "seconds": "x"}',
        '{"parameters": ' + '{"a":' * 400 + "1" + "}" * 400 + "}",
        '{"parameters": {"' + "k" * 200_000 + '": "' + "v" * 200_000 + '"}, "started": "' + "s" * 200_000 + '"}',
    ],
    ids=["no numbers", "other types", "deep", "lengthy"],
)
def test_odd_facts_of_a_run_are_shown_as_far_as_they_go(text: str, tmp_path: Path) -> None:
    runs.sample_run(tmp_path)
    (tmp_path / "run.json").write_text(text)
    data = runs.data_of(write_report(tmp_path))
    assert len(json.dumps(data["about"]) + json.dumps(data["parameters"])) < 10_000
    assert isinstance(data["about"]["problems"], list)
    assert isinstance(data["about"]["counts"], dict)


def test_long_cells_are_cut(tmp_path: Path) -> None:
    runs.write_tables(tmp_path, [runs.failed_row("a.png", "damaged: " + "x" * 200_000)], [])
    (image,) = runs.data_of(write_report(tmp_path))["images"]
    assert image["rows"][0]["error"] == "damaged: " + "x" * 991 + "..."


def test_tables_longer_than_a_page_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report_folder, "MAX_ROWS", 2)
    runs.sample_run(tmp_path)
    with pytest.raises(UsageError, match=r"timings\.csv has more than 2 rows"):
        write_report(tmp_path)


@given(name=st.text(st.characters(exclude_categories=())).map(lambda text: text.encode("utf-8", "replace").decode()))
def test_shown_names_are_told_back(name: str) -> None:
    assert unprintable(printable(name)) == name
    assert unprintable(printable("\udcff" + name + "\udc80")) == "\udcff" + name + "\udc80"
    assert name in [unprintable(text) for text in meant_by(neutral(printable(name)))]
