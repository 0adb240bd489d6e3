"""Regions in the annotation formats other programs read: COCO, LabelMe, GeoJSON.

All three count from the image's outer corner, as their readers and the SVG do: a coordinate is the contour's plus 0.5.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.regions import Region
from ffseg.io.masks import encode_mask

Document = dict[str, Any]

FLATNESS = 0.02
"""Pixels by which the polygons written may leave the curves: far below the fifth of a pixel to which COCO's reader
rounds them, and two pixels in a hundred along the contour for a reader that does not round."""

DECIMALS = 4
"""Digits behind the point, as in the SVG."""

LABELME_VERSION = "5.4.0"
"""The LabelMe format written: the first that knows masks beside polygons is 5.3."""


@dataclass(frozen=True, slots=True, eq=False)
class PaintedRegion:
    """A region as contours and as pixels.

    Attributes
    ----------
    region : Region
        One outer contour with its holes.
    mask : ndarray of bool, shape (H, W)
        The same region by the pixel-centre rule, in the size of its image.
    """

    region: Region
    mask: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class AnnotatedImage:
    """What is exported of one image.

    Attributes
    ----------
    file_name : str
        How the document names the image: for LabelMe the path from the JSON file to the image.
    width, height : int
        Pixels.
    regions : tuple of PaintedRegion
    label : str
        The class every region gets.
    """

    file_name: str
    width: int
    height: int
    regions: tuple[PaintedRegion, ...]
    label: str = "region"


def json_text(document: Document | list[Document]) -> str:
    """The document as one line of ASCII JSON and a line end: the same bytes for the same values."""
    return json.dumps(document, allow_nan=False, separators=(",", ":")) + "\n"


def coco_document(image: AnnotatedImage) -> Document:
    """COCO instances document of one image, to be stored as it is or merged with others (`merged_coco`).

    Returns
    -------
    dict
        Image, category and annotations have ids from 1. A region without holes is a polygon; one with holes is an
        uncompressed RLE, since COCO reads several polygons as a union. ``area`` and ``bbox`` are those of the mask.
        Regions without a pixel are left out: COCO knows no empty instance.

    Notes
    -----
    COCO's reader rounds polygons to fifths of a pixel, so the mask it makes of one differs from ours in about one pixel
    in twenty along the contour (overlap 0.997 for a disc of radius 40, 0.9995 for 200). RLE comes back pixel for pixel.
    """
    painted = [p for p in image.regions if p.mask.any()]
    return {
        "info": {"description": "Regions segmented by ffseg"},
        "images": [{"id": 1, "file_name": image.file_name, "width": image.width, "height": image.height}],
        "categories": [{"id": 1, "name": image.label, "supercategory": ""}],
        "annotations": [_coco_annotation(number, p) for number, p in enumerate(painted, start=1)],
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
    """LabelMe document of one image, without the image's own bytes.

    Returns
    -------
    dict
        A region without holes is a polygon shape; one with holes is a mask shape (LabelMe 5.3 or later), since
        LabelMe's polygons have none. Regions without a pixel are left out.

    Notes
    -----
    LabelMe's own conversion scripts paint a polygon's outline too: masks they make of polygons are larger by about half
    a pixel all round. Mask shapes come back pixel for pixel.
    """
    return {
        "version": LABELME_VERSION,
        "flags": {},
        "shapes": [_labelme_shape(image.label, painted) for painted in image.regions if painted.mask.any()],
        "imagePath": image.file_name,
        "imageData": None,
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
                "area_px": round(painted.region.area, DECIMALS),
                "holes": len(painted.region.holes),
            },
            "geometry": {"type": "Polygon", "coordinates": [_ring(c) for c in painted.region.contours]},
        }
        for number, painted in enumerate(image.regions, start=1)
    ]
    return {"type": "FeatureCollection", "features": features}


def run_lengths(mask: NDArray[np.bool_]) -> list[int]:
    """Uncompressed RLE counts as COCO defines them: down the columns, beginning with the zeros."""
    pixels = np.concatenate([[False], mask.ravel(order="F")])
    changes = np.flatnonzero(pixels[1:] != pixels[:-1])
    bounds: list[int] = np.diff(np.concatenate([[0], changes, [mask.size]])).tolist()
    return bounds


def _coco_annotation(number: int, painted: PaintedRegion) -> Document:
    left, top, right, bottom = _extent(painted.mask)
    return {
        "id": number,
        "image_id": 1,
        "category_id": 1,
        "iscrowd": 0,
        "area": int(np.count_nonzero(painted.mask)),
        "bbox": [left, top, right - left + 1, bottom - top + 1],
        "segmentation": _coco_segmentation(painted),
    }


def _coco_segmentation(painted: PaintedRegion) -> Document | list[list[float]]:
    if painted.region.holes:
        return {"size": list(painted.mask.shape), "counts": run_lengths(painted.mask)}
    return [[value for point in _vertices(painted.region.outer) for value in point]]


def _labelme_shape(label: str, painted: PaintedRegion) -> Document:
    shape: Document = {"label": label, "group_id": None, "description": "", "flags": {}, "mask": None}
    if not painted.region.holes:
        return shape | {"shape_type": "polygon", "points": _vertices(painted.region.outer)}
    left, top, right, bottom = _extent(painted.mask)
    png = encode_mask(painted.mask[top : bottom + 1, left : right + 1])
    return shape | {
        "shape_type": "mask",
        "points": [[left, top], [right, bottom]],  # the first and the last pixel inside, as LabelMe writes them
        "mask": base64.b64encode(png).decode("ascii"),
    }


def _extent(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """First and last column and row with a pixel: left, top, right, bottom."""
    columns, rows = (np.flatnonzero(mask.any(axis=axis)) for axis in (0, 1))
    return int(columns[0]), int(rows[0]), int(columns[-1]), int(rows[-1])


def _vertices(contour: FreeForm) -> list[list[float]]:
    """Flattened contour from the image's corner, rounded; never -0."""
    points: list[list[float]] = (np.round(contour.flatten(FLATNESS) + 0.5, DECIMALS) + 0.0).tolist()
    return points


def _ring(contour: FreeForm) -> Sequence[list[float]]:
    vertices = _vertices(contour)
    return [*vertices, *vertices[:1]]
