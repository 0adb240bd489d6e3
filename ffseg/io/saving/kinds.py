"""What one result can be written as, told by the suffix of a file name."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ffseg.errors import OutputError
from ffseg.io.saving.source import Source

if TYPE_CHECKING:
    from ffseg.io.exports import AnnotatedImage, Document
    from ffseg.result import Segmentation


def encoded(result: Segmentation, kind: str, source: Source, suffix: str = ".png") -> bytes:
    """A result as the bytes of a file.

    Parameters
    ----------
    result : Segmentation
    kind : {"mask", "svg", "geojson", "coco", "labelme", "overlay"}
    source : Source
    suffix : str
        Format of an overlay.
    """
    if kind == "overlay":
        return _overlay(result, source, suffix)
    return KINDS[kind](result, source)


def annotated(result: Segmentation, name: str) -> AnnotatedImage:
    """What documents know of a result."""
    from ffseg.image.polygons import polygons
    from ffseg.io.exports import AnnotatedImage

    height, width = result.mask.shape
    return AnnotatedImage(name, width, height, polygons(result.mask, result.contours))


def documents(result: Segmentation, kind: str, name: str) -> Document:
    """A result as a COCO, LabelMe or GeoJSON document."""
    from ffseg.io import exports

    made = {"coco": exports.coco_document, "labelme": exports.labelme_document, "geojson": exports.geojson_document}
    return made[kind](annotated(result, name))


def _overlay(result: Segmentation, source: Source, suffix: str) -> bytes:
    from ffseg.io.overlays import encode_overlay, polylines

    image, shape = source.image, result.mask.shape
    fitting = isinstance(image, np.ndarray) and image.dtype == np.uint8 and image.shape in (shape, (*shape, 3))
    if image is None or not fitting:
        raise OutputError(f"an overlay needs the image that was segmented: uint8 of shape {shape} or {(*shape, 3)}")
    return encode_overlay(image, polylines(result.contours), result.mask, suffix)


def _mask(result: Segmentation, _: Source) -> bytes:
    from ffseg.io.masks import encode_mask

    return encode_mask(result.mask)


def _svg(result: Segmentation, source: Source) -> bytes:
    from ffseg.io.svg import svg_document

    height, width = result.mask.shape
    return svg_document(result.contours, width, height, source.name, source.behind).encode("utf-8")


def _document(kind: str) -> Callable[[Segmentation, Source], bytes]:
    def write(result: Segmentation, source: Source) -> bytes:
        from ffseg.io.exports import json_text

        return json_text(documents(result, kind, source.name)).encode("ascii")

    return write


KINDS: dict[str, Callable[[Segmentation, Source], bytes]] = {
    "mask": _mask,
    "svg": _svg,
    **{kind: _document(kind) for kind in ("geojson", "coco", "labelme")},
}
"""Encoders that need no image."""
