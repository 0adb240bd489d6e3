"""Annotation files of other programs as masks, and what ffseg exports read back."""

import base64
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pycocotools import mask as coco_mask

from ffseg.errors import UsageError
from ffseg.image.polygons import polygons
from ffseg.io.exports import AnnotatedImage, coco_document, json_text, labelme_document
from ffseg.io.labels import read_labels
from ffseg.pipeline import outlines_of

SHAPE = (30, 40)


def write(folder: Path, document: object, name: str = "labels.json") -> Path:
    path = folder / name
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def ring() -> np.ndarray:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    distance = np.hypot(x - 18, y - 14)
    return (distance < 11) & (distance > 4) | (x > 35)


@pytest.mark.parametrize("document", [coco_document, labelme_document])
def test_what_is_exported_comes_back_pixel_for_pixel(document, tmp_path: Path) -> None:
    mask = ring()
    image = AnnotatedImage("sub/a.png", SHAPE[1], SHAPE[0], polygons(mask, outlines_of(mask)), "road")
    path = tmp_path / "own.json"
    path.write_text(json_text(document(image)))
    labels = read_labels(path).named(["sub/a.png"])
    for label in ("road", ""):
        assert np.array_equal(labels.mask("sub/a.png", label, SHAPE), mask)
    assert labels.mask("sub/a.png", "kerb", SHAPE) is None
    assert labels.classes() == {"road"}
    assert labels.mask("b.png", "", SHAPE) is None
    other = read_labels(path).named(["other/a.png"])
    assert np.array_equal(other.mask("other/a.png", "", SHAPE), mask), "the only image of that name"


def labelme(name: str, left: int, **more: object) -> dict[str, object]:
    shape = {"label": "r", "shape_type": "rectangle", "points": [[left, 2], [left + 4, 8]]}
    return {"imagePath": name, "shapes": [shape], **more}


def test_regions_of_images_that_share_a_name_stay_apart(tmp_path: Path) -> None:
    """Those of one folder were painted into the images of the other as well."""
    places = {"x": "a.png", "y": "../../photos/y/a.png", "z": "..\\images\\b.png"}
    for number, (place, name) in enumerate(places.items()):
        (tmp_path / place).mkdir()
        write(tmp_path / place, labelme(name, 5 * number), "any.json")
    found = read_labels(tmp_path)
    names = ["x/a.png", "y/a.png", "b.png", "c.png"]
    for number, name in enumerate(names[:3]):
        assert np.array_equal(found.named(names).mask(name, "", SHAPE), box(5 * number, 2, 5 * number + 4, 8))
    assert found.without(names) == []
    assert found.named(["a.png"]).regions == {}, "either could be meant"
    assert found.without(["a.png", "b.png"]) == ["x/a.png", "../photos/y/a.png"]
    one = read_labels(write(tmp_path, labelme("a.png", 3)))
    assert one.named(names).regions == {}, "both could be meant"
    assert one.without(names) == ["a.png"]


def test_an_ellipse_is_turned_as_it_says(tmp_path: Path) -> None:
    shape = {"name": "ellipse", "cx": 20, "cy": 15, "rx": 12, "ry": 4, "theta": np.pi / 2}
    entry = {"filename": "a.png", "regions": [{"shape_attributes": shape, "region_attributes": {"k": "r"}}]}
    mask = read_labels(write(tmp_path, {"a": entry})).mask("a.png", "r", SHAPE)
    rows, columns = np.nonzero(mask)
    assert (np.ptp(rows), np.ptp(columns)) == (23, 7)


@pytest.mark.parametrize("kind", ["point", "line", "linestrip"])
def test_what_encloses_nothing_keeps_no_region_from_being_read(kind: str, tmp_path: Path) -> None:
    document = labelme("a.png", 3)
    document["shapes"].append({"label": "r", "shape_type": kind, "points": [[1, 1]] * (1 if kind == "point" else 2)})
    found = read_labels(write(tmp_path, document))
    assert np.array_equal(found.mask("a.png", "r", SHAPE), box(3, 2, 7, 8))
    assert [*found.odd] == ["a.png"]


@pytest.mark.parametrize("size", [(30, 41), (31, 40), (40, 30)])
def test_regions_of_another_size_are_refused(size: tuple[int, int], tmp_path: Path) -> None:
    one = read_labels(write(tmp_path, labelme("a.png", 3, imageHeight=size[0], imageWidth=size[1])))
    image = {"id": 1, "file_name": "a.png", "height": size[0], "width": size[1]}
    coco = {"images": [image], "annotations": [{"image_id": 1, "bbox": [3, 2, 7, 6]}]}
    for found in (one, read_labels(write(tmp_path, coco))):
        with pytest.raises(UsageError, match=f"drawn on {size[1]}x{size[0]} pixels, the image has 40x30"):
            found.mask("a.png", "", SHAPE)


def test_a_polygon_that_crosses_itself_keeps_both_parts(tmp_path: Path) -> None:
    bow = {"label": "r", "points": [[0, 0], [40, 30], [40, 0], [0, 30]]}
    found = read_labels(write(tmp_path, {"imagePath": "a.png", "shapes": [bow]})).mask("a.png", "", SHAPE)
    assert found is not None
    assert found[:, :10].sum() == found[:, 30:].sum() > 0


@given(st.integers(0, 2**32 - 1), st.floats(0.05, 0.95))
def test_short_run_lengths_are_those_of_coco(tmp_path_factory: pytest.TempPathFactory, seed: int, share: float) -> None:
    mask = cv2.blur(np.random.default_rng(seed).random(SHAPE), (3, 5)) < share
    packed = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
    segmentation = {"size": list(SHAPE), "counts": packed["counts"].decode()}
    document = {
        "images": [{"id": 7, "file_name": "a.jpg"}],
        "annotations": [{"image_id": 7, "category_id": 1, "segmentation": segmentation}],
    }
    path = write(tmp_path_factory.mktemp("coco"), document)
    assert np.array_equal(read_labels(path).mask("a.jpg", "", SHAPE), mask)


def box(left: int, top: int, right: int, bottom: int) -> np.ndarray:
    found = np.zeros(SHAPE, np.bool_)
    found[top:bottom, left:right] = True
    return found


def test_polygons_of_coco_are_painted_all(tmp_path: Path) -> None:
    parts = [[3, 4, 15, 4, 15, 20, 3, 20], [20, 10, 39, 10, 39, 28, 20, 28]]
    document = {
        "images": [{"id": 7, "file_name": "a.jpg"}],
        "annotations": [{"image_id": 7, "category_id": 1, "segmentation": parts}],
    }
    found = read_labels(write(tmp_path, document)).mask("a.jpg", "", SHAPE)
    assert np.array_equal(found, box(3, 4, 15, 20) | box(20, 10, 39, 28))


def test_shapes_of_every_program_are_painted_where_they_stand(tmp_path: Path) -> None:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    part = base64.b64encode(cv2.imencode(".png", np.ones((4, 6), np.uint8))[1].tobytes()).decode()
    document = {
        "imagePath": "a.png",
        "shapes": [
            {"label": "r", "shape_type": "rectangle", "points": [[10, 8], [3, 2]]},
            {"label": "c", "shape_type": "circle", "points": [[20, 15], [20, 21]]},
            {"label": "m", "shape_type": "mask", "points": [[30, 20], [35, 23]], "mask": part},
            {"label": "o", "shape_type": "mask", "points": [[-2, -3], [3, 0]], "mask": part},
            {"label": "o", "shape_type": "mask", "points": [[37, 28], [42, 31]], "mask": part},
        ],
    }
    found = read_labels(write(tmp_path, document))
    assert np.array_equal(found.mask("a.png", "r", SHAPE), box(3, 2, 10, 8))
    assert np.array_equal(found.mask("a.png", "m", SHAPE), box(30, 20, 36, 24))
    assert np.array_equal(found.mask("a.png", "o", SHAPE), box(0, 0, 4, 1) | box(37, 28, 40, 30))
    disc = found.mask("a.png", "c", SHAPE)
    distance = np.hypot(x + 0.5 - 20, y + 0.5 - 15)
    assert disc[distance < 5.98].all()
    assert not disc[distance > 6].any()
    rect = {"name": "rect", "x": 3, "y": 2, "width": 7, "height": 6}
    triangle = {"name": "polygon", "all_points_x": [0, 40, 0], "all_points_y": [0, 0, 30]}
    regions = [{"shape_attributes": rect, "region_attributes": {"kind": "r"}}, {"shape_attributes": triangle}]
    regions += [{"shape_attributes": {**triangle, "name": "polyline"}, "region_attributes": {"kind": "line"}}]
    for place in (  # lists, and objects of VIA 1
        {"a.png1": {"filename": "a.png", "regions": regions}},
        {"a.png1": {"filename": "a.png", "regions": {"0": regions[0]}}},
    ):
        for document in (place, {"_via_img_metadata": place}):
            assert np.array_equal(read_labels(write(tmp_path, document)).mask("a.png", "r", SHAPE), box(3, 2, 10, 8))
    both = read_labels(write(tmp_path, {"a.png1": {"filename": "a.png", "regions": regions}}))
    assert np.array_equal(both.mask("a.png", "", SHAPE), box(3, 2, 10, 8) | ((x + 0.5) / 40 + (y + 0.5) / 30 < 1))
    coco = {
        "images": [{"id": 1, "file_name": "a.png"}], "categories": [{"id": 3, "name": "box"}],
        "annotations": [{"image_id": 1, "category_id": 3, "bbox": [3, 2, 7, 6], "segmentation": []}],
    }  # fmt: skip
    assert np.array_equal(read_labels(write(tmp_path, coco)).mask("a.png", "box", SHAPE), box(3, 2, 10, 8))


BAD = [
    [], 3, {"shapes": [{}], "imagePath": "a"}, {"annotations": [{"image_id": 1}], "images": []}, {"a": 1},
    {"a": {"regions": [1]}},
    {"imagePath": "a", "shapes": [{"label": "x", "points": [1, 1, 2, 2]}]}, {},
    {"images": [{"id": 1, "file_name": "a"}],
     "annotations": [{"image_id": 1, "segmentation": {"size": [2, 2], "counts": [5, -1]}}]},
    {"images": [{"id": 1, "file_name": "a.png"}],
     "annotations": [{"image_id": 1, "segmentation": {"size": [2, np.inf], "counts": [4]}}]},
    {"a.png": {"filename": "a.png", "regions": [
        {"shape_attributes": {"name": "circle", "cx": 1, "cy": 1, "r": np.inf}, "region_attributes": {}}]}},
]  # fmt: skip


def test_what_encloses_nothing_or_claims_a_huge_image_costs_itself(tmp_path: Path) -> None:
    side = 1 << 20
    document = {
        "images": [{"id": 1, "file_name": "a.png"}, {"id": 2, "file_name": "huge.png"}],
        "annotations": [
            {"image_id": 1, "keypoints": [4, 4, 2]}, {"image_id": 1, "segmentation": [[1, 1, 9, 9]]},
            {"image_id": 1, "bbox": [3, 2, 7, 6]},
            {"image_id": 2, "segmentation": {"size": [side, side], "counts": [0, side * side]}},
        ],
    }  # fmt: skip
    found = read_labels(write(tmp_path, document))
    assert np.array_equal(found.mask("a.png", "", SHAPE), box(3, 2, 10, 8))
    with pytest.raises(UsageError, match="run lengths of 1048576x1048576 pixels"):
        found.mask("huge.png", "", SHAPE)


@pytest.mark.parametrize("document", BAD)
def test_what_is_no_annotation_is_refused(document: object, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"labels\.json is no file of LabelMe, COCO or VIA"):
        read_labels(write(tmp_path, document))


def test_other_sizes_and_files_that_are_none_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.json").write_text("{")
    (tmp_path / "none").mkdir()
    for path, said in (
        ("text.json", "is no file of LabelMe"),
        ("absent.json", "there is no such file"),
        ("none", "no .json file"),
    ):
        with pytest.raises(UsageError, match=said):
            read_labels(tmp_path / path)
    runs = {
        "images": [{"id": 1, "file_name": "a"}],
        "annotations": [{"image_id": 1, "segmentation": {"size": [2, 2], "counts": [1, 3]}}],
    }
    with pytest.raises(UsageError, match="a region of a cannot be read"):
        read_labels(write(tmp_path, runs)).mask("a", "", SHAPE)
