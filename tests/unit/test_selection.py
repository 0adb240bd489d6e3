"""Which regions and holes are kept: the same in mask, contours, tables and exports."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from batches import table
from commands import Command
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ffseg.geometry.freeform import FreeForm
from ffseg.image.raster import rasterize
from ffseg.image.selection import count_regions, selected
from ffseg.parameter_files import load_params
from tests.masks import read_mask, write_image

SHAPE = (40, 60)


def region(**values: int):
    return load_params(None, {f"region.{key}": value for key, value in values.items()}).region


def circle(x: float, y: float, radius: float) -> FreeForm:
    return FreeForm.circle((x, y), radius, 8, 3)


def things() -> tuple[FreeForm, ...]:
    """A disc with two holes, a smaller disc, and what encloses no pixel: a region and a hole."""
    holes = [circle(12, 18, 2.2), circle(22, 20, 4.2), circle(15.5, 27.5, 0.4)]
    return (circle(17, 20, 14.3), *(hole.reversed() for hole in holes), circle(50, 20, 6.1), circle(40.5, 3.5, 0.4))


def areas(mask: np.ndarray, connectivity: int) -> list[int]:
    """Naive: pixels of the components, by flooding."""
    left, found = {(y, x) for y, x in zip(*np.nonzero(mask), strict=True)}, []
    steps = [(0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)][:connectivity]
    while left:
        front, size = [left.pop()], 0
        while front:
            y, x = front.pop()
            size += 1
            near = {(y + dy, x + dx) for dy, dx in steps} & left
            left -= near
            front += near
        found.append(size)
    return sorted(found, reverse=True)


def holes(mask: np.ndarray) -> list[int]:
    outside = ~np.pad(mask, 1)
    labels = cv2.connectedComponents(outside.astype(np.uint8), connectivity=8)[1]
    return areas(outside & (labels != labels[0, 0]), 8)


def test_what_encloses_no_pixel_is_dropped_and_nothing_else() -> None:
    mask = rasterize(things(), SHAPE)
    contours, kept = selected(things(), mask, region())
    assert kept is mask
    assert ([round(abs(c.signed_area)) for c in contours], count_regions(mask)) == ([642, 15, 55, 117], (2, 2))


@pytest.mark.parametrize(
    ("values", "count", "left"),
    [
        ({"largest": 1}, (1, 2), 3),
        ({"largest": 2}, (2, 2), 4),
        ({"min_area": 150}, (1, 2), 3),
        ({"fill_holes": 30}, (2, 1), 3),
        ({"fill_holes": 1000}, (2, 0), 2),
        ({"largest": 1, "fill_holes": 1000}, (1, 0), 1),
        ({"min_area": 10_000}, (0, 0), 0),
    ],
)
def test_contours_are_those_of_what_is_kept(values: dict[str, int], count: tuple[int, int], left: int) -> None:
    contours, mask = selected(things(), rasterize(things(), SHAPE), region(**values))
    assert (count_regions(mask), len(contours)) == (count, left)
    assert all(contour.degree == 3 for contour in contours)  # the curves themselves
    np.testing.assert_array_equal(rasterize(contours, SHAPE), mask)


def test_an_island_in_a_hole_that_is_filled_has_no_contour() -> None:
    """It stood beside the region that held it: two paths of one region."""
    outer, hole, island = (FreeForm.circle((50.0, 50.0), radius, 8, 3) for radius in (40.0, 20.0, 12.0))
    ring = (outer, hole.reversed(), island)
    mask = rasterize(ring, (100, 100))
    assert selected(ring, mask, region(fill_holes=2000))[0] == ring[:1]
    assert selected(ring, mask, region(fill_holes=20))[0] == ring


masks = arrays(np.bool_, st.tuples(st.integers(1, 14), st.integers(1, 14)))


@given(masks)
def test_counts_are_those_of_flooding(mask: np.ndarray) -> None:
    assert count_regions(mask) == (len(areas(mask, 4)), len(holes(mask)))


@given(masks, st.integers(0, 3), st.integers(0, 8), st.integers(0, 8))
def test_any_selection_shows_what_it_says(mask: np.ndarray, largest: int, least: int, fill: int) -> None:
    contours, kept = selected((), mask, region(largest=largest, min_area=least, fill_holes=fill))
    if largest or least or fill:
        np.testing.assert_array_equal(rasterize(contours, mask.shape), kept)
    wanted = [area for area in areas(mask, 4) if area >= least]
    sizes = areas(kept & mask, 4)
    assert sizes == (wanted[:largest] if largest else wanted)
    assert all(area >= fill for area in holes(kept))


def test_a_run_says_the_same_everywhere(tmp_path: Path, ffseg_command: Command) -> None:
    image = np.full((120, 160), 60, np.uint8)
    for x, radius, level in ((70, 45, 200), (60, 3, 60), (85, 9, 60)):
        cv2.circle(image, (x, 60), radius, level, -1)
    write_image(tmp_path / "a.png", image)
    start = ("--set", "init.center=[70,30]", "--set", "init.radius=8", "--export", "geojson,coco")
    kept = {(): 2, ("--fill-holes", "100"): 1, ("--largest", "1"): 2, ("--min-area", "99"): 2}
    for more, count in kept.items():
        out = tmp_path / "-".join(("out", *more))
        ffseg_command("run", tmp_path / "a.png", "--out", out, *start, *more, code=0)
        (row,) = table(out / "timings.csv")
        mask = read_mask(out / "masks" / "a.png")
        (feature,) = json.loads((out / "geojson" / "a.geojson").read_text("utf-8"))["features"]
        said = (int(row["components"]), int(row["holes"]), int(row["area_px"]))
        assert said == (1, count, int(mask.sum())) == (*count_regions(mask), feature["properties"]["area_px"])
        assert len(feature["geometry"]["coordinates"]) == 1 + count
        assert (out / "contours" / "a.svg").read_text("utf-8").count("M") == 1 + count
