"""COCO, LabelMe, GeoJSON and YOLO, opened in the programs that read them."""

import base64
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from shapely.geometry import shape as shapely_shape

from ffseg.api import segment
from ffseg.geometry.freeform import FreeForm
from ffseg.image.polygons import FLATNESS, Polygon, polygons
from ffseg.image.raster import TOLERANCE, rasterize
from ffseg.io.exports import (
    AnnotatedImage,
    coco_document,
    geojson_document,
    json_text,
    labelme_document,
    merged_coco,
    run_lengths,
    yolo_text,
)
from ffseg.io.images import read_image
from ffseg.parameter_files import load_params
from tests.discs import overlap
from tests.real_data import data_folder

# pycocotools 2.0.11 predates the copy keyword of NumPy 2's __array__
pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")

Mask = NDArray[np.bool_]
SHAPE = (300, 400)


def circle(x: float, y: float, radius: float, degree: int = 3) -> FreeForm:
    return FreeForm.circle((x, y), radius, max(6, int(radius / 5)), degree)


def annotated(contours: list[FreeForm], name: str = "view.png", label: str = "region") -> AnnotatedImage:
    return AnnotatedImage(name, SHAPE[1], SHAPE[0], polygons(rasterize(contours, SHAPE), contours), label)


def pixels(region: Polygon, size: tuple[int, int] = SHAPE) -> Mask:
    """A region's mask in the size of its image."""
    mask, (x, y), (height, width) = np.zeros(size, np.bool_), region.origin, region.mask.shape
    mask[y : y + height, x : x + width] = region.mask
    return mask


def islands() -> AnnotatedImage:
    sea, lake = circle(199.6, 150.3, 140.2), circle(180, 140, 60.5).reversed()
    return annotated([sea, lake, circle(290, 150, 20, 2).reversed(), circle(182, 139, 30.7, 5)])


def disc() -> AnnotatedImage:
    return annotated([circle(199.6, 150.3, 140.2)])


def num_holes(mask: Mask) -> int:
    return int(cv2.connectedComponents((~np.pad(mask, 1)).astype(np.uint8), connectivity=4)[0]) - 2


def loaded_coco(document: dict[str, Any], folder: Path) -> Any:
    coco = pytest.importorskip("pycocotools.coco", reason="pycocotools is not installed")
    path = folder / "coco.json"
    path.write_text(json_text(document), encoding="utf-8")
    return coco.COCO(path)


def test_coco_regions_with_holes_come_back_pixel_for_pixel(tmp_path: Path) -> None:
    image = islands()
    coco = loaded_coco(coco_document(image), tmp_path)
    holed, _ = coco.loadAnns(coco.getAnnIds(imgIds=[1]))
    mask = coco.annToMask(holed).astype(bool)
    np.testing.assert_array_equal(mask, pixels(image.regions[0]))
    assert num_holes(mask) == 2
    mask_of = pytest.importorskip("pycocotools.mask")
    encoded = coco.annToRLE(holed)
    assert (mask_of.area(encoded), mask_of.toBbox(encoded).tolist()) == (holed["area"], holed["bbox"])


@pytest.mark.parametrize(("x", "y", "size"), [(199.6, 150.3, 140.2), (60, 60, 50), (60.5, 60.75, 50)])
def test_coco_polygons_are_the_mask_to_a_fifth_of_a_pixel(x: float, y: float, size: float, tmp_path: Path) -> None:
    image = annotated([circle(x, y, size)])
    coco = loaded_coco(coco_document(image), tmp_path)
    (annotation,) = coco.loadAnns(coco.getAnnIds())
    assert isinstance(annotation["segmentation"], list)
    mask, ours = coco.annToMask(annotation).astype(bool), pixels(image.regions[0])
    assert overlap(mask, ours) >= 0.999
    rows, columns = np.nonzero(mask != ours)
    radius = np.hypot(columns - x, rows - y)
    # the reader rounds vertices to 1/5 px and lines between them once more
    assert (np.abs(radius - size) <= 0.2 + 0.02).all()


def merge_coco(documents: list[dict[str, object]]) -> dict[str, object]:
    return json.loads(b"".join(merged_coco(lambda: documents)))


def test_coco_merge_counts_ids_through_and_joins_categories(tmp_path: Path) -> None:
    floor = annotated([circle(80, 80, 30)], "floor.png", "floor")
    merged = merge_coco([coco_document(islands()), coco_document(floor), coco_document(disc())])
    assert [image["id"] for image in merged["images"]] == [1, 2, 3]
    assert [a["id"] for a in merged["annotations"]] == [1, 2, 3, 4]
    assert [a["image_id"] for a in merged["annotations"]] == [1, 1, 2, 3]
    assert [a["category_id"] for a in merged["annotations"]] == [1, 1, 2, 1]
    assert [(c["id"], c["name"]) for c in merged["categories"]] == [(1, "region"), (2, "floor")]
    assert (merge_coco([merged]), merge_coco([])["images"]) == (merged, [])
    assert len(loaded_coco(merged, tmp_path).getAnnIds(catIds=[2])) == 1


@given(arrays(np.bool_, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_run_lengths_are_those_of_pycocotools(mask: Mask) -> None:
    mask_of = pytest.importorskip("pycocotools.mask", reason="pycocotools is not installed")
    counts = run_lengths(mask)
    assert sum(counts) == mask.size
    assert all(count > 0 for count in counts[1:])
    encoded = mask_of.frPyObjects({"size": list(mask.shape), "counts": counts}, *mask.shape)
    np.testing.assert_array_equal(mask_of.decode(encoded), mask)
    assert encoded == mask_of.encode(np.asfortranarray(mask, dtype=np.uint8))


def test_geojson_opens_in_shapely_with_its_holes() -> None:
    image = islands()
    document = json.loads(json_text(geojson_document(image)))
    y, x = np.indices(SHAPE) + 0.5  # pixel centres counted from the image's corner
    for feature, region in zip(document["features"], image.regions, strict=True):
        polygon = shapely_shape(feature["geometry"])
        assert polygon.is_valid
        assert len(polygon.interiors) == len(region.holes) == feature["properties"]["holes"]
        assert polygon.exterior.is_ccw
        assert not any(ring.is_ccw for ring in polygon.interiors)
        mask = shapely.contains_xy(polygon, x.ravel(), y.ravel()).reshape(SHAPE)
        np.testing.assert_array_equal(mask, pixels(region))
        assert feature["properties"]["area_px"] == mask.sum()
        assert all(ring[0] == ring[-1] for ring in feature["geometry"]["coordinates"])


def test_polygons_lie_on_the_curves() -> None:
    ring = disc().regions[0].outer
    radius = np.hypot(ring[:, 0] - 199.6, ring[:, 1] - 150.3)
    # the curve is a circle within 0.003 px; vertices lie where it is crossed, as far as it was flattened and simplified
    assert np.abs(radius - 140.2).max() <= 0.003 + TOLERANCE + FLATNESS
    assert len(ring) < 0.7 * 2 * np.pi * 140.2 * 4 / np.pi  # of the steps it crosses


def labelme_masks(shapes: list[dict[str, Any]], size: tuple[int, ...] = SHAPE) -> list[Mask]:
    """Masks of LabelMe shapes by its documented fields: polygons from the corner, masks with their box inclusive."""
    y, x = np.indices(size) + 0.5
    masks = []
    for entry in shapes:
        mask = np.zeros(size, dtype=bool)
        if entry["shape_type"] == "polygon":
            inside = shapely.contains_xy(shapely.Polygon(entry["points"]), x.ravel(), y.ravel())
            mask = inside.reshape(size)
        else:
            (left, top), (right, bottom) = entry["points"]
            png = np.frombuffer(base64.b64decode(entry["mask"]), np.uint8)
            mask[top : bottom + 1, left : right + 1] = cv2.imdecode(png, cv2.IMREAD_UNCHANGED) != 0
        masks.append(mask)
    return masks


def test_labelme_fields_give_the_masks() -> None:
    image = islands()
    document = json.loads(json_text(labelme_document(image)))
    assert {"version", "flags", "shapes", "imagePath", "imageData", "imageHeight", "imageWidth"} == set(document)
    assert (document["imagePath"], document["imageHeight"], document["imageWidth"]) == ("view.png", 300, 400)
    assert [entry["shape_type"] for entry in document["shapes"]] == ["mask", "polygon"]
    holed, island = labelme_masks(document["shapes"])
    np.testing.assert_array_equal(holed, pixels(image.regions[0]))
    assert num_holes(holed) == 2
    np.testing.assert_array_equal(island, pixels(image.regions[1]))


def test_labelme_opens_it(tmp_path: Path) -> None:
    label_file = pytest.importorskip("labelme._label_file", reason="labelme is not installed")
    cv2.imwrite(str(tmp_path / "view.png"), np.zeros(SHAPE, np.uint8))
    image = islands()
    (tmp_path / "view.json").write_text(json_text(labelme_document(image)), encoding="utf-8")
    loaded = label_file.LabelFile(str(tmp_path / "view.json"))
    assert [entry["label"] for entry in loaded.shapes] == ["region", "region"]
    np.testing.assert_array_equal(loaded.shapes[0]["mask"], image.regions[0].mask)


def test_regions_without_a_pixel_are_nowhere() -> None:
    speck = annotated([circle(50.5, 50.5, 0.3)])
    assert coco_document(speck)["annotations"] == labelme_document(speck)["shapes"] == []
    assert (geojson_document(speck)["features"], len(coco_document(annotated([]))["images"])) == ([], 1)


def judged(image: AnnotatedImage, shown: Mask) -> None:
    """Every polygon is valid and shows the pixels of its region, and all of them together the mask."""
    cocos = pytest.importorskip("pycocotools.mask", reason="pycocotools is not installed")
    y, x = np.indices(shown.shape) + 0.5
    seen = np.zeros(shown.shape, np.bool_)
    features = json.loads(json_text(geojson_document(image)))["features"]
    annotations = json.loads(json_text(coco_document(image)))["annotations"]
    for region, feature, annotation in zip(image.regions, features, annotations, strict=True):
        polygon, mine = shapely_shape(feature["geometry"]), pixels(region, shown.shape)
        assert polygon.is_valid, shapely.is_valid_reason(polygon)
        np.testing.assert_array_equal(shapely.contains_xy(polygon, x.ravel(), y.ravel()).reshape(shown.shape), mine)
        found = cocos.frPyObjects(annotation["segmentation"], *shown.shape)
        decoded = cocos.decode(cocos.merge(found) if isinstance(found, list) else found).astype(bool)
        assert overlap(decoded, mine) >= 0.995
        assert annotation["area"] == mine.sum()
        assert not (seen & mine).any()
        seen |= mine
    np.testing.assert_array_equal(seen, shown)
    shapes = labelme_masks(json.loads(json_text(labelme_document(image)))["shapes"], shown.shape)
    for region, mask in zip(image.regions, shapes, strict=True):
        np.testing.assert_array_equal(mask, pixels(region, shown.shape))
    for region, line in zip(image.regions, yolo_text(image).splitlines(), strict=True):
        label, *numbers = line.split()
        ring = np.array(numbers, float).reshape(-1, 2) * (image.width, image.height) - 0.5
        assert label == "0"
        assert len(ring) >= 3
        np.testing.assert_array_equal(rasterize([FreeForm(ring, 1)], shown.shape), pixels(region, shown.shape))


def test_yolo_cuts_off_what_leaves_the_image() -> None:
    mask = np.array([[0, 0, 0, 0, 0], [1, 1, 0, 0, 0], [1, 1, 1, 0, 0], [0, 0, 1, 1, 0], [0, 0, 0, 1, 1]], np.bool_)
    beyond = FreeForm(np.array([[21.0, 17], [0, 2], [0, 0]]), 1)
    judged(AnnotatedImage("a", 5, 5, polygons(mask, [beyond])), mask)


def test_yolo_knows_holes_as_its_readers_fill_them() -> None:
    image = islands()
    painted = np.zeros(SHAPE, np.uint8)
    for line in yolo_text(image).splitlines():
        ring = np.array(line.split()[1:], float).reshape(-1, 2) * (image.width, image.height)
        cv2.fillPoly(painted, [np.rint(ring - 0.5).astype(np.int32)], 1)  # whole pixels, and the outline too
    shown = np.logical_or.reduce([pixels(region) for region in image.regions])
    assert num_holes(shown) > 0
    assert overlap(painted > 0, shown) > 0.98
    assert yolo_text(annotated([])) == ""


@st.composite
def tangles(draw: st.DrawFn) -> tuple[Mask, list[FreeForm]]:
    """Contours that cross themselves and each other, run along pixel centres and leave the image, and their mask."""
    number = st.floats(-5, 45, width=32) | st.integers(-5, 45).map(float)
    contours = []
    for degree in draw(st.lists(st.integers(1, 6), max_size=4)):
        count = degree * draw(st.integers(3, 6))
        contours.append(FreeForm(draw(arrays(np.float64, (count, 2), elements=number)), degree))
    shape = draw(st.tuples(st.integers(1, 40), st.integers(1, 40)))
    return rasterize(contours, shape), contours


@given(tangles())
def test_any_contours_give_valid_polygons_of_their_mask(case: tuple[Mask, list[FreeForm]]) -> None:
    mask, contours = case
    judged(AnnotatedImage("a", mask.shape[1], mask.shape[0], polygons(mask, contours)), mask)


@given(arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12))))
def test_any_mask_gives_valid_polygons(mask: Mask) -> None:
    image = AnnotatedImage("a", mask.shape[1], mask.shape[0], polygons(mask))
    judged(image, mask)
    regions, _ = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
    holes, _ = cv2.connectedComponents((~np.pad(mask, 1)).astype(np.uint8), connectivity=8)
    assert (len(image.regions), sum(len(region.holes) for region in image.regions)) == (regions - 1, holes - 2)


PHOTOGRAPHS = sorted((data_folder() / "seeded_objects" / "images").glob("*.jpg"))


@pytest.mark.skipif(not PHOTOGRAPHS, reason="the photographs are absent: set FFSEG_DATA")
@pytest.mark.parametrize("path", PHOTOGRAPHS[::2], ids=lambda path: path.name)
def test_photographs_give_valid_polygons(path: Path) -> None:
    result = segment(read_image(path), load_params(None))
    height, width = result.mask.shape
    judged(AnnotatedImage("a", width, height, polygons(result.mask, result.contours)), result.mask)


@pytest.mark.parametrize("name", ['a"b\n<c>.png', "\udc80.png", "=cmd.png", "été.png"])
def test_any_name_survives(name: str) -> None:
    for document in (coco_document, labelme_document, geojson_document):
        text = json_text(document(annotated([circle(50, 50, 9)], name)))
        assert text.isascii()
        assert name in str(json.loads(text)).replace("\\n", "\n") or json.dumps(name) in text


def test_the_text_is_the_same_every_time() -> None:
    for document in (coco_document, labelme_document, geojson_document):
        assert json_text(document(islands())) == json_text(document(islands()))
        assert "-0.0" not in json_text(document(annotated([FreeForm.box(-0.5, -0.50001, 9, 9)])))
