"""Formats that a result can be saved in, chosen by file suffix, and its representation in a notebook."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from ffseg.arrays import Image
from ffseg.errors import OutputError, SegmentationError
from ffseg.image.checked import Pixels, taken_image
from ffseg.io.tables import counted
from ffseg.parameters import Levels

if TYPE_CHECKING:
    from ffseg.io.exports import AnnotatedImage, Document
    from ffseg.result import Segmentation

SUFFIXES = {
    ".png": "mask",
    ".svg": "svg",
    ".geojson": "geojson",
    ".json": "coco",
    ".txt": "yolo",
    ".jpg": "overlay",
    ".jpeg": "overlay",
    ".webp": "overlay",
}
"""Kind of a file by its suffix."""
_PICTURE_SIDE = 640
"""Pixels: a picture that fits beside the code of a notebook."""
_INSIDE, _OUTSIDE = 235, 70
"""Grey levels of a region and of what surrounds it, apart from each other and from the lines on a light or dark page."""


@dataclass(frozen=True, slots=True, eq=False)
class ImageInfo:
    """What a result was made of.

    Attributes
    ----------
    name : str
        Stands in titles and documents.
    image : ndarray of uint8, shape (H, W) or (H, W, 3), or None
        Needed for an overlay.
    behind : str
        Address of an image that an SVG shows behind its contours, and LabelMe in place of the one that is named.
    label : str
        Class that documents give to every region.
    """

    name: str = ""
    image: Image | None = None
    behind: str = ""
    label: str = "region"


NO_INFO = ImageInfo()


def kind_of(path: str, kinds: Sequence[str] = ()) -> str:
    """Kind of output a file name asks for.

    Raises
    ------
    OutputError
        If the suffix stands for none, or not for one of `kinds`.
    """
    suffix = os.path.splitext(path)[1].lower()
    known = {end: kind for end, kind in SUFFIXES.items() if not kinds or kind in kinds}
    if kinds and "overlay" in kinds:  # whose format is not taken for the mask's where nothing else is meant
        known = {".png": "overlay"} | known
    if kinds and "cutout" in kinds:
        known = {".png": "cutout", ".webp": "cutout"}
    if suffix not in known:
        named = ", ".join(f"{end} ({kind})" for end, kind in known.items())
        wrong = f"the suffix {suffix} stands for no output" if suffix else "there is no suffix"
        raise OutputError(f"{path or 'the name of the output is empty'}: {wrong}; write one of {named}")
    return known[suffix]


_BEGINNINGS = {
    "svg": rb'<\?xml version="1\.0" encoding="UTF-8"\?>\n<svg xmlns="[^"]+" width="\d+" height="\d+" viewBox="[\d ]+">\n<title>',
    "geojson": rb'{"type":"FeatureCollection","features":\[({"type":"Feature","id":1,"properties":{"image":|\])',
    "coco": rb'{"info":{"description":"Regions segmented by ffseg"}',
    "labelme": rb'{"version":"[\d.]+","flags":{},"shapes":\[',
    "yolo": rb"0( [01]\.\d{7}){6}",
    "model": rb"ffmodel 1\n",
    "settings": rb"# ffseg tune ",
    "before and after": rb'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>ffseg tune</title>',
    "report": rb'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<meta http-equiv="Content-Security-Policy"',
}
"""How files begin that `encoded`, `learn`, `tune` and `report` write; other programs write them otherwise."""
_HEAD_BYTES = 512
"""Bytes of a file that tell how it begins."""


def is_own(path: str, kind: str) -> bool:
    """Whether a file may be replaced as what ffseg wrote of this kind, of whatever image; one that is empty may."""
    if kind not in _BEGINNINGS:  # what is drawn on a picture does not show
        from ffseg.io.masks import holds_other_than_mask  # loads OpenCV

        return not holds_other_than_mask(path)
    try:
        with Path(path).open("rb") as file:
            begins = file.read(_HEAD_BYTES)
    except OSError:  # to be told when it is written
        return True
    return not begins or re.match(_BEGINNINGS[kind], begins) is not None


def encoded(result: Segmentation, kind: str, source: ImageInfo, suffix: str = ".png") -> bytes:
    """A result as the bytes of a file.

    Parameters
    ----------
    kind : {"mask", "svg", "geojson", "coco", "labelme", "yolo", "overlay", "cutout"}
    suffix : str
        Format of an overlay or cut-out.
    """
    from ffseg.io.exports import json_text, yolo_text
    from ffseg.io.masks import encode_mask
    from ffseg.io.overlays import encode_cutout, encode_overlay, polylines
    from ffseg.io.svg import svg_document

    height, width = result.mask.shape
    if kind == "mask":
        return encode_mask(result.mask)
    if kind == "svg":
        return svg_document(result.contours, width, height, source.name, source.behind).encode("utf-8")
    if kind == "yolo":
        return yolo_text(annotated_image(result, "")).encode("ascii")
    if kind not in ("overlay", "cutout"):
        return json_text(documents(result, kind, source.name, source.label, source.behind)).encode("ascii")
    image = source.image
    if image is None or image.shape[:2] != (height, width):
        shape = result.mask.shape
        raise OutputError(f"the {kind} needs the image that was segmented, of shape {shape} or {(*shape, 3)}")
    if kind == "cutout":
        return encode_cutout(image, result.mask, suffix)
    return encode_overlay(image, polylines(result.contours), result.mask, suffix)


def annotated_image(result: Segmentation, name: str, label: str = "region") -> AnnotatedImage:
    """What documents know of a result."""
    from ffseg.image.polygons import polygons
    from ffseg.io.exports import AnnotatedImage

    height, width = result.mask.shape
    return AnnotatedImage(name, width, height, polygons(result.mask, result.contours), label)


def documents(result: Segmentation, kind: str, name: str, label: str = "region", behind: str = "") -> Document:
    """A result as a COCO, LabelMe or GeoJSON document."""
    from ffseg.io import exports

    made = {"coco": exports.coco_document, "labelme": exports.labelme_document, "geojson": exports.geojson_document}
    return made[kind](replace(annotated_image(result, name, label), picture=behind.partition(",")[2]))


class Savable:
    """Mixed into `Segmentation`."""

    __slots__ = ()

    def save_mask(self, path: str | os.PathLike[str]) -> None:
        """Write the mask as a PNG file: 255 inside, 0 outside.

        Raises
        ------
        OutputError
            If the suffix is not .png, or the file cannot be written.
        """
        self._save(path, "mask")

    def save_svg(self, path: str | os.PathLike[str], title: str = "", behind: str = "") -> None:
        """Write the exact contours as an SVG file of the image's size.

        Parameters
        ----------
        behind : str
            Name of the image file, relative to the SVG, or address, to be shown behind the contours.

        Raises
        ------
        OutputError
            If the suffix is not .svg or `behind` is no name, or the file cannot be written.
        """
        from urllib.parse import quote  # 2 ms that importing ffseg should not cost

        if not isinstance(behind, str):  # perhaps the image itself
            raise OutputError(f"behind is of type {type(behind).__name__}; give the name of an image file")
        if not re.match("[a-z][a-z0-9+.-]+:", behind):  # no address, but a name
            behind = quote(behind, errors="surrogateescape")
        self._save(path, "svg", ImageInfo(title, behind=behind))

    def save_cutout(
        self, path: str | os.PathLike[str], image: Pixels, *, rgb: bool = False, levels: Levels = "auto"
    ) -> None:
        """Write the image inside the region, transparent elsewhere: PNG or WebP by the suffix.

        Parameters and errors are those of `save_overlay`.
        """
        self._save(path, "cutout", _with_image(image, rgb, levels))

    def save_overlay(
        self, path: str | os.PathLike[str], image: Pixels, *, rgb: bool = False, levels: Levels = "auto"
    ) -> None:
        """Write the image with the region tinted and its contours drawn: PNG, JPEG or WebP by the suffix.

        Parameters
        ----------
        image : ndarray of uint8, uint16 or float, shape (H, W) or (H, W, 3)
            The one that was segmented, as `ffseg.segment` took it.
        rgb : bool
            Its channels are red, green, blue.
        levels : tuple of float or "auto"
            Of black and white, as the ``input.range`` that it was segmented with.

        Raises
        ------
        OutputError
            For another suffix or an image of another size, or if the file cannot be written.
        """
        self._save(path, "overlay", _with_image(image, rgb, levels))

    def to_geojson(self, name: str = "", label: str = "region") -> Document:
        """GeoJSON feature collection in pixels: a Polygon per region with its holes; `name` stands for the image."""
        return documents(self._result(), "geojson", name, label)

    def to_coco(self, name: str = "", label: str = "region") -> Document:
        """COCO document of one image called `name`: an annotation of category `label` per region."""
        return documents(self._result(), "coco", name, label)

    def __repr__(self) -> str:
        result = self._result()
        height, width = result.mask.shape
        regions = counted(result.num_regions, "region")
        return (
            f"<Segmentation of {width} x {height} px: {np.count_nonzero(result.mask)} px inside, {regions}, "
            f"{counted(result.num_holes, 'hole')}; {result.stats.stop_reason} after "
            f"{counted(result.stats.iterations, 'iteration')}>"
        )

    def _repr_png_(self) -> bytes:
        """What a notebook shows: the region light on dark, with its contours."""
        from ffseg.io.overlays import Polyline, encode_overlay, polylines

        result = self._result()
        step = -(-max(result.mask.shape) // _PICTURE_SIDE)
        canvas = np.where(result.mask[::step, ::step], np.uint8(_INSIDE), np.uint8(_OUTSIDE))
        lines = [Polyline(line.points / step, line.kind) for line in polylines(result.contours)]
        return encode_overlay(canvas, lines)

    def _result(self) -> Segmentation:
        return cast("Segmentation", self)

    def _save(self, path: str | os.PathLike[str], kind: str, source: ImageInfo = NO_INFO) -> None:
        from ffseg.io.files import write_bytes_atomic

        text = os.fspath(path)
        suffix = os.path.splitext(text)[1].lower()
        kind_of(text, (kind,))
        write_bytes_atomic(text, encoded(self._result(), kind, source, suffix))


def _with_image(image: Pixels, rgb: bool, levels: Levels) -> ImageInfo:
    try:
        return ImageInfo(image=taken_image(image, rgb, levels))
    except SegmentationError as error:
        raise OutputError(f"the picture needs the image that was segmented: {error}") from None
