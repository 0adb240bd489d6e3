"""Regions in the annotation formats other programs read: COCO, LabelMe, GeoJSON, YOLO.

All count from the image's outer corner, as their readers and the SVG do: a coordinate is the contour's plus 0.5.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ffseg.arrays import Mask, Points
from ffseg.image.polygons import Polygon
from ffseg.io.masks import encode_mask

Document = dict[str, Any]

COARSE_AREA = 15.0
"""Square pixels for each pixel of outline, below which COCO gets run lengths even of a region without holes: its reader
rounds polygons to fifths of a pixel, which changes about a pixel in twenty along the outline. Of 1104 drawn regions above,
the least overlap was 0.9966; from half of this on, 0.990."""

DECIMALS = 4
"""Digits behind the point, as in the SVG."""

LABELME_VERSION = "5.4.0"
"""The LabelMe format written: the first that knows masks beside polygons is 5.3."""


@dataclass(frozen=True, slots=True, eq=False)
class AnnotatedImage:
    """What is exported of one image.

    Attributes
    ----------
    file_name : str
        How the document names the image: for LabelMe the path from the JSON file to the image.
    width, height : int
        Pixels.
    regions : tuple of Polygon
        As `ffseg.image.polygons.polygons` makes them.
    label : str
        The class every region gets.
    picture : str
        For LabelMe the picture's own file in base 64, where `file_name` is none that it could open.
    """

    file_name: str
    width: int
    height: int
    regions: tuple[Polygon, ...]
    label: str = "region"
    picture: str = ""


def json_text(document: Document | list[Document]) -> str:
    """The document as one line of ASCII JSON and a line end: the same bytes for the same values."""
    return json.dumps(document, allow_nan=False, separators=(",", ":")) + "\n"


def coco_document(image: AnnotatedImage) -> Document:
    """COCO instances document of one image, to be stored as it is or merged with others (`merged_coco`).

    Returns
    -------
    dict
        Image, category and annotations have ids from 1. A region without holes, and not too small or thin for what COCO's
        reader makes of polygons (`COARSE_AREA`), is a polygon; any other is an uncompressed RLE, which comes back pixel for
        pixel. ``area`` and ``bbox`` are those of the mask.
    """
    return {
        "info": {"description": "Regions segmented by ffseg"},
        "images": [{"id": 1, "file_name": image.file_name, "width": image.width, "height": image.height}],
        "categories": [{"id": 1, "name": image.label, "supercategory": ""}],
        "annotations": [
            _coco_annotation(number, region, image) for number, region in enumerate(image.regions, start=1)
        ],
    }


def merged_coco(documents: Callable[[], Iterable[Document]]) -> Iterator[bytes]:
    """One COCO document of many, in their order: ids are counted through, categories of one name become one.

    Parameters
    ----------
    documents : callable
        Gives the documents, anew at every call: they are gone through once for each part, and never held together.

    Returns
    -------
    iterator of bytes
        Pieces of the text of the document, as `json_text` writes it.
    """
    categories: dict[str, int] = {}
    yield b'{"info":{"description":"Regions segmented by ffseg"},"images":['
    yield from _joined(_merged_images(documents(), categories))
    rows = [{"id": number, "name": name, "supercategory": ""} for name, number in categories.items()]
    yield b'],"categories":' + json_text(rows).encode("ascii").rstrip() + b',"annotations":['
    yield from _joined(_merged_annotations(documents(), categories))
    yield b"]}\n"


def _joined(parts: Iterable[Document]) -> Iterator[bytes]:
    comma = b""
    for part in parts:
        yield comma + json_text(part).encode("ascii").rstrip()
        comma = b","


def _merged_images(documents: Iterable[Document], categories: dict[str, int]) -> Iterator[Document]:
    """Images with their new ids; the categories that come with them are added to `categories`."""
    count = 0
    for document in documents:
        for category in document["categories"]:
            categories.setdefault(category["name"], len(categories) + 1)
        for image in document["images"]:
            count += 1
            yield {**image, "id": count}


def _merged_annotations(documents: Iterable[Document], categories: Mapping[str, int]) -> Iterator[Document]:
    images = annotations = 0
    for document in documents:
        image_ids = {image["id"]: images + k for k, image in enumerate(document["images"], start=1)}
        images += len(image_ids)
        names = {category["id"]: category["name"] for category in document["categories"]}
        for annotation in document["annotations"]:
            annotations += 1
            ids = {
                "id": annotations,
                "image_id": image_ids[annotation["image_id"]],
                "category_id": categories[names[annotation["category_id"]]],
            }
            yield {**annotation, **ids}


def labelme_document(image: AnnotatedImage) -> Document:
    """LabelMe document of one image.

    Returns
    -------
    dict
        A region without holes is a polygon shape; one with holes is a mask shape (LabelMe 5.3 or later), since
        LabelMe's polygons have none.

    Notes
    -----
    LabelMe's own conversion scripts paint a polygon's outline too: masks they make of polygons are larger by about half
    a pixel all round. Mask shapes come back pixel for pixel.
    """
    return {
        "version": LABELME_VERSION,
        "flags": {},
        "shapes": [_labelme_shape(image.label, region) for region in image.regions],
        "imagePath": image.file_name,
        "imageData": image.picture or None,
        "imageHeight": image.height,
        "imageWidth": image.width,
    }


def geojson_document(image: AnnotatedImage) -> Document:
    """GeoJSON feature collection of one image, in pixels: a Polygon per region with its holes as inner rings.

    Returns
    -------
    dict
        Rings are closed; outer ones have positive shoelace area and holes negative, as RFC 7946 asks. Differs from it
        in that the coordinates are pixels with y down, not degrees.
    """
    features = [
        {
            "type": "Feature",
            "id": number,
            "properties": {
                "image": image.file_name,
                "label": image.label,
                "area_px": region.area,
                "holes": len(region.holes),
            },
            "geometry": {"type": "Polygon", "coordinates": [_closed(ring) for ring in region.rings]},
        }
        for number, region in enumerate(image.regions, start=1)
    ]
    return {"type": "FeatureCollection", "features": features}


def yolo_text(image: AnnotatedImage) -> str:
    """YOLO segmentation labels of one image: a line for each region, its class 0 and its outline in parts of the image.

    Notes
    -----
    The format knows one ring for a region and no holes: each hole is joined to the ring by a cut without width, from its
    rightmost point straight to the right. Readers that fill by either rule see the hole.
    """
    size = (image.width, image.height)
    lines = []
    for region in image.regions:
        ring = np.clip((_within(_joined_ring(region), size) + 0.5) / size, 0.0, 1.0)
        lines.append(" ".join(["0", *(f"{value:.{YOLO_DECIMALS}f}" for value in ring.reshape(-1).tolist())]) + "\n")
    return "".join(lines)


YOLO_DECIMALS = 7
"""Digits behind the point: less than a hundredth of a pixel at the longest side there is."""


def _within(ring: Points, size: tuple[int, int]) -> Points:
    """What of a ring lies in the image, cut off straight at each border (Sutherland and Hodgman 1974)."""
    for axis in (0, 1):
        for side, limit in ((-1, 0.5), (1, size[axis] - 0.5)):
            beyond = side * ring[:, axis] - limit
            after, following = np.roll(beyond, -1), np.roll(ring, -1, axis=0)
            crossing = (beyond > 0) != (after > 0)
            share = beyond / np.where(crossing, beyond - after, 1.0)
            both = np.stack([ring, ring + share[:, None] * (following - ring)], axis=1)
            ring = both[np.stack([beyond <= 0, crossing], axis=1)]
    return ring


def _joined_ring(region: Polygon) -> Points:
    """Outline of a region as one ring, with a cut from each hole to what lies to its right."""
    ring = region.outer
    for hole in sorted(region.holes, key=lambda one: float(one[:, 0].max()), reverse=True):
        first = int(hole[:, 0].argmax())
        x, y = hole[first]
        following = np.roll(ring, -1, axis=0)
        spans = (ring[:, 1] <= y) != (following[:, 1] <= y)
        low, high = ring[spans], following[spans]
        crossed = low[:, 0] + (high[:, 0] - low[:, 0]) * (y - low[:, 1]) / (high[:, 1] - low[:, 1])
        crossed[crossed <= x] = np.inf
        at, end = int(np.flatnonzero(spans)[crossed.argmin()]), np.array([[crossed.min(), y]])
        around = np.roll(hole, -first, axis=0)
        ring = np.concatenate([ring[: at + 1], end, around, around[:1], end, ring[at + 1 :]])
    return ring


def run_lengths(mask: Mask) -> list[int]:
    """Uncompressed RLE counts as COCO defines them: down the columns, beginning with the zeros."""
    pixels = np.concatenate([[False], mask.ravel(order="F")])
    changes = np.flatnonzero(pixels[1:] != pixels[:-1])
    bounds: list[int] = np.diff(np.concatenate([[0], changes, [mask.size]])).tolist()
    return bounds


def from_run_lengths(lengths: Sequence[int], shape: tuple[int, int]) -> Mask:
    """The mask of these run lengths.

    Raises
    ------
    ValueError
        If they are of another size.
    """
    return np.repeat(np.arange(len(lengths)) % 2 == 1, lengths).reshape(shape, order="F")


def _coco_annotation(number: int, region: Polygon, image: AnnotatedImage) -> Document:
    (x, y), (height, width) = region.origin, region.mask.shape
    return {
        "id": number,
        "image_id": 1,
        "category_id": 1,
        "iscrowd": 0,
        "area": region.area,
        "bbox": [x, y, width, height],
        "segmentation": _coco_segmentation(region, image),
    }


def _coco_segmentation(region: Polygon, image: AnnotatedImage) -> Document | list[list[float]]:
    length = np.hypot(*(region.outer - np.roll(region.outer, 1, axis=0)).T).sum()
    if not region.holes and region.area >= COARSE_AREA * length:
        return [[value for point in _vertices(region.outer) for value in point]]
    (x, y), (height, width) = region.origin, region.mask.shape
    mask = np.zeros((image.height, image.width), np.bool_)
    mask[y : y + height, x : x + width] = region.mask
    return {"size": [image.height, image.width], "counts": run_lengths(mask)}


def _labelme_shape(label: str, region: Polygon) -> Document:
    shape: Document = {"label": label, "group_id": None, "description": "", "flags": {}, "mask": None}
    if not region.holes:
        return shape | {"shape_type": "polygon", "points": _vertices(region.outer)}
    (x, y), (height, width) = region.origin, region.mask.shape
    return shape | {
        "shape_type": "mask",
        "points": [[x, y], [x + width - 1, y + height - 1]],  # first and last pixel inside, as LabelMe writes them
        "mask": base64.b64encode(encode_mask(region.mask)).decode("ascii"),
    }


def _vertices(ring: Points) -> list[list[float]]:
    """Vertices from the image's corner, rounded; never -0."""
    points: list[list[float]] = (np.round(ring + 0.5, DECIMALS) + 0.0).tolist()
    return points


def _closed(ring: Points) -> Sequence[list[float]]:
    vertices = _vertices(ring)
    return [*vertices, *vertices[:1]]
