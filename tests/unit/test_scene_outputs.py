"""What is written of the shared 800x600 scenes, read back by the programs that read it."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest
import shapely

from ffseg.api import segment
from ffseg.image.polygons import polygons
from ffseg.io.exports import AnnotatedImage, coco_document, geojson_document
from ffseg.io.svg import svg_document
from ffseg.parameters import load_params
from ffseg.result import Segmentation
from tests.crossings import self_intersections
from tests.real_data import data_folder

DATA = data_folder()
SCENES = DATA / "scenes"
# pycocotools 2.0.11 predates the copy keyword of NumPy 2's __array__
pytestmark = [
    pytest.mark.skipif(not SCENES.is_dir(), reason="the shared scenes are absent: set FFSEG_DATA"),
    pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning"),
]


@cache
def segmented(name: str, clearance: float = 0.0) -> Segmentation:
    image = cv2.imread(str(SCENES / f"{name}.png"), cv2.IMREAD_COLOR)
    start = {"init.center": [400, 300], "init.radius": 40, "contour.clearance": clearance}
    return segment(image, load_params(None, start))


@pytest.mark.parametrize("name", "abcd")
def test_resvg_paints_the_mask_within_half_a_pixel(name: str) -> None:
    resvg_py = pytest.importorskip("resvg_py", reason="resvg-py is not installed")
    found = segmented(name)
    height, width = found.mask.shape
    png = resvg_py.svg_to_bytes(svg_string=svg_document(found.contours, width, height))
    picture = cv2.imdecode(np.frombuffer(bytes(png), np.uint8), cv2.IMREAD_UNCHANGED)
    rows, columns = np.nonzero((picture[..., 3] >= 128) != found.mask)
    lines = shapely.MultiLineString([[*v, v[0]] for v in (c.flatten(1e-3) for c in found.contours)])
    distances = shapely.distance(lines, shapely.points(np.stack([columns, rows], axis=-1).astype(float)))
    assert (distances <= 0.5).all()


@pytest.mark.parametrize("name", "abcd")
def test_exports_open_in_their_readers(name: str) -> None:
    coco_mask = pytest.importorskip("pycocotools.mask", reason="pycocotools is not installed")
    found = segmented(name)
    height, width = found.mask.shape
    image = AnnotatedImage(f"{name}.png", width, height, polygons(found.mask, found.contours))
    annotations = coco_document(image)["annotations"]
    encoded = [coco_mask.frPyObjects(a["segmentation"], height, width) for a in annotations]
    merged = coco_mask.merge([part for e in encoded for part in (e if isinstance(e, list) else [e])])
    y, x = np.indices((height, width)) + 0.5
    shapes = [shapely.geometry.shape(f["geometry"]) for f in geojson_document(image)["features"]]
    inside = np.any([shapely.contains_xy(p, x.ravel(), y.ravel()) for p in shapes], axis=0).reshape(height, width)
    for mask in (coco_mask.decode(merged).astype(bool), inside):
        assert (mask & found.mask).sum() / (mask | found.mask).sum() >= 0.999
    assert sum(len(p.interiors) for p in shapes) == sum(c.signed_area < 0 for c in found.contours)


@pytest.mark.parametrize("name", "abcd")
def test_final_contours_do_not_cross(name: str) -> None:
    assert self_intersections(segmented(name).contours) == []


def test_the_leaky_scene_gives_the_same_contours_every_time() -> None:
    one, two = (segmented.__wrapped__("e") for _ in range(2))
    assert one.stats == two.stats
    for a, b in zip(one.contours, two.contours, strict=True):
        np.testing.assert_array_equal(a.control_points, b.control_points)
