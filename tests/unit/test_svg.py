"""SVG of contours: whole-text golden files, exact paths, hostile titles, and resvg's picture of them."""

import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from ffseg.geometry import bezier
from ffseg.geometry.freeform import FreeForm
from ffseg.image.raster import rasterize
from ffseg.io.svg import CUBIC_TOLERANCE, DECIMALS, escape, number, path_data, svg_document
from ffseg.native import _core
from tests import strategies as own

GOLDEN = Path(__file__).parent.parent / "golden"
SVG = "{http://www.w3.org/2000/svg}"


def islands(degree: int) -> list[FreeForm]:
    sea = FreeForm.circle((60.2, 50.7), 44.3, 15, degree)
    lake, island = FreeForm.circle((52, 47), 20, 9, degree).reversed(), FreeForm.circle((50, 46), 9.5, 7, degree)
    return [sea, lake, FreeForm.circle((84, 60), 8, 5, degree).reversed(), island]


@pytest.mark.parametrize("degree", range(1, 7))
def test_golden_files(degree: int, golden: Callable[[Path, str], None]) -> None:
    text = svg_document(islands(degree), 120, 100, f"islands of degree {degree}")
    golden(GOLDEN / f"islands-degree-{degree}.svg", text)


def test_document_of_a_box() -> None:
    assert svg_document([FreeForm.box(0, 0, 9, 4)], 10, 5) == (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<svg xmlns="http://www.w3.org/2000/svg" width="10" height="5" viewBox="0 0 10 5">\n'
        '<path fill-rule="evenodd" d="M0.5,0.5 L9.5,0.5 L9.5,4.5 L0.5,4.5 Z"/>\n'
        "</svg>\n"
    )


def test_document_without_regions_is_whole() -> None:
    root = ElementTree.fromstring(svg_document([], 3, 2))  # noqa: S314 - our own text
    assert (root.tag, root.attrib, len(root)) == (f"{SVG}svg", {"width": "3", "height": "2", "viewBox": "0 0 3 2"}, 0)


def test_one_path_per_region_with_its_holes() -> None:
    root = ElementTree.fromstring(svg_document(islands(3), 120, 100))  # noqa: S314
    paths = root.findall(f"{SVG}path")
    assert [path.attrib["fill-rule"] for path in paths] == ["evenodd"] * 2
    assert [path.attrib["d"].count("M") for path in paths] == [3, 1]


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-0.0, "0"), (-0.00001, "0"), (-0.00005001, "-0.0001"), (1.5, "1.5"), (100.0, "100"),
     (2 / 3, "0.6667"), (-20.0, "-20"), (1e15, "1000000000000000"), (1e-300, "0")],
)  # fmt: skip
def test_numbers(value: float, text: str) -> None:
    assert number(value) == text


@given(st.floats(-1e6, 1e6))
def test_numbers_read_back_within_their_rounding(value: float) -> None:
    text = number(value)
    assert abs(float(text) - value) <= 0.5 * 10.0**-DECIMALS * (1 + 1e-9) + 1e-9
    assert re.fullmatch(r"-?(0|[1-9]\d*)(\.\d*[1-9])?", text)
    assert text != "-0"


COORDINATES = st.one_of(
    st.floats(-1e4, 1e4),
    st.floats(-2e11, 2e11),  # both sides of what the native writer takes
    st.integers(-20000, 20000).map(lambda n: n / 1e4),
    st.integers(-40000, 40000).map(lambda n: n / 32),  # exact ties, to be rounded to even
    st.integers(-40000, 40000).map(lambda n: np.nextafter((2 * n + 1) / 2e4 - 0.5, (-1) ** n * np.inf)),  # nearly ties
)


@given(st.lists(st.tuples(COORDINATES, COORDINATES), min_size=6, max_size=6), st.integers(1, 3))
def test_paths_write_every_coordinate_as_number_does(points: list[tuple[float, float]], degree: int) -> None:
    numbers = re.split("[^-.0-9]+", path_data(FreeForm(np.array(points), degree)).strip("MZ "))
    expected = [number(value) for value in (np.array(points) + 0.5).ravel().tolist()]
    assert numbers == expected + (expected[:2] if degree > 1 else [])


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.1e11])
def test_native_path_refuses_what_it_cannot_write(value: float) -> None:
    with pytest.raises(ValueError, match="not finite or too far away"):
        _core.path_text(np.array([[0.0, 0.0], [value, 1.0]]), 1)


@pytest.mark.parametrize(("count", "degree"), [(0, 1), (4, 3), (4, 4), (4, 0)])
def test_native_path_refuses_what_is_no_contour(count: int, degree: int) -> None:
    with pytest.raises(ValueError, match="degree"):
        _core.path_text(np.zeros((count, 2)), degree)


@given(st.text())
def test_any_title_stays_text(title: str) -> None:
    hostile = f'</title><script>alert("1")</script>&amp;\x00\udc80{title}'
    text = svg_document([], 1, 1, hostile)
    root = ElementTree.fromstring(text.encode("utf-8"))  # noqa: S314
    assert [child.tag for child in root] == [f"{SVG}title"]
    expected = re.sub("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "\ufffd", hostile)
    assert root[0].text == expected.replace("\r\n", "\n").replace("\r", "\n")


def test_escape_covers_attributes() -> None:
    assert escape("\"'<&>") == "&quot;&#39;&lt;&amp;&gt;"


@given(own.troubled_contour(scaled=False))
def test_paths_carry_the_control_points(made: tuple[own.Points, int]) -> None:
    points, degree = made
    contour = FreeForm(points * 100, degree)
    data = path_data(contour)
    assert set(re.findall("[A-Z]", data)) <= {"M", "Z", {1: "L", 2: "Q"}.get(degree, "C")}
    if degree <= 3:
        looped = np.concatenate([contour.control_points, contour.control_points[: int(degree > 1)]])
        written = [[float(v) for v in pair.split(",")] for pair in re.findall(r"[-\d.]+,[-\d.]+", data)]
        np.testing.assert_allclose(np.array(written) - 0.5, looped, rtol=0, atol=0.500001 * 10.0**-DECIMALS)


@given(own.troubled_contour(scaled=False), st.sampled_from([1.0, 1e-3]))
def test_cubics_follow_higher_degrees(made: tuple[own.Points, int], tolerance: float) -> None:
    points, degree = made
    for patch in FreeForm(points * 100, degree).patches:
        cubics = bezier.as_cubics(patch, tolerance)
        t = np.linspace(0, 1, 33)
        along = (np.arange(len(cubics))[:, None] + t) / len(cubics)
        gap = bezier.evaluate(cubics[:, None], t) - bezier.evaluate(patch, along)
        assert np.hypot(gap[..., 0], gap[..., 1]).max() <= tolerance
        np.testing.assert_array_equal(cubics[1:, 0], cubics[:-1, -1])
        assert degree > 3 or len(cubics) == 1


def test_cubic_bound_is_tight_for_a_quartic() -> None:
    quartic = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [4.0, 16.0]])  # y = 16 t^4: off by 1 at t = 1/2
    assert (len(bezier.as_cubics(quartic, 1.0)), len(bezier.as_cubics(quartic, 0.999))) == (1, 2)
    assert len(bezier.as_cubics(quartic, CUBIC_TOLERANCE)) == 4


@pytest.mark.parametrize("degree", range(1, 7))
def test_resvg_paints_the_mask(degree: int) -> None:
    resvg_py = pytest.importorskip("resvg_py", reason="resvg-py is not installed")
    contours = islands(degree)
    png = resvg_py.svg_to_bytes(svg_string=svg_document(contours, 120, 100))
    picture = cv2.imdecode(np.frombuffer(bytes(png), np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (100, 120, 4)
    rows, columns = np.nonzero((picture[..., 3] >= 128) != rasterize(contours, (100, 120)))
    lines = shapely.MultiLineString([[*v, v[0]] for v in (c.flatten(1e-3) for c in contours)])
    distances = shapely.distance(lines, shapely.points(np.stack([columns, rows], axis=-1).astype(float)))
    assert (distances <= 0.5).all()
    assert picture[46, 50, 3] == 255  # the island
    assert picture[46, 35, 3] == 0  # the lake
