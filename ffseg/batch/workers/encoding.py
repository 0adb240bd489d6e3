"""Outputs of one image as bytes."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ffseg.batch.workers import outputs
from ffseg.batch.workers.outputs import OutputKind
from ffseg.formats.masks import encode_mask
from ffseg.formats.overlays import Polyline, encode_overlay
from ffseg.formats.svg import svg_document
from ffseg.image.raster import rasterize
from ffseg.segmenters.base import Progress, Segmentation

if TYPE_CHECKING:
    from ffseg.formats.exports import AnnotatedImage

FILM_FRAMES = 120
"""Frames of an animation at most: eleven seconds, and bounded memory however long an evolution takes."""


@dataclass(slots=True, eq=False)
class Film:
    """Keeps snapshots of an evolution, evenly: when too many have come, every second is dropped."""

    snapshots: list[Progress] = field(default_factory=list)
    step: int = 1
    heard: int = 0

    def __call__(self, snapshot: Progress) -> None:
        """Hear of the next snapshot."""
        if self.heard % self.step == 0:
            self.snapshots.append(snapshot)
            if len(self.snapshots) > FILM_FRAMES:
                del self.snapshots[1::2]
                self.step *= 2
        self.heard += 1


@dataclass(frozen=True, eq=False)
class Made:
    """All that the outputs of one image are made from.

    Attributes
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    result : Segmentation
    lines : sequence of Polyline
        For the overlay.
    name : str
        Relative name of the image.
    path : str
        Where it is.
    snapshots : sequence of Progress
        For the animation; the result is added.
    """

    image: NDArray[np.uint8]
    result: Segmentation
    lines: Sequence[Polyline]
    name: str
    path: str
    snapshots: Sequence[Progress] = ()

    def encoded(self, kind: OutputKind, target: str) -> bytes:
        """The output of one kind that will be stored at `target`."""
        return _ENCODERS[kind](self, target)

    @cached_property
    def annotated(self) -> AnnotatedImage:
        """What exports know of the image."""
        from ffseg.formats.exports import AnnotatedImage, PaintedRegion
        from ffseg.geometry.regions import group_regions

        height, width = self.image.shape[:2]
        regions = group_regions(self.result.contours)
        painted = tuple(PaintedRegion(region, rasterize(region.contours, (height, width))) for region in regions)
        return AnnotatedImage(self.name, width, height, painted)

    @cached_property
    def film(self) -> list[Progress]:
        """Snapshots with the result as the last, in place of one the segmenter may have given of it."""
        last = Progress(self.result.stats.iterations, tuple(self.result.contours))
        before = (snapshot for snapshot in self.snapshots if snapshot.iteration < last.iteration)
        return [*(snapshot for snapshot in before if snapshot.contours), last]


def _mask(made: Made, _: str) -> bytes:
    return encode_mask(made.result.mask)


def _contours(made: Made, _: str) -> bytes:
    height, width = made.image.shape[:2]
    return svg_document(made.result.contours, width, height, made.name).encode("utf-8")


def _overlay(made: Made, _: str) -> bytes:
    return encode_overlay(made.image, made.lines, made.result.mask)


def _coco(made: Made, _: str) -> bytes:
    from ffseg.formats.exports import coco_document, json_text

    return json_text(coco_document(made.annotated)).encode("ascii")


def _labelme(made: Made, target: str) -> bytes:
    from dataclasses import replace

    from ffseg.formats.exports import json_text, labelme_document

    folder = os.path.realpath(os.path.dirname(target))  # LabelMe opens the path from there, without following links
    image = os.path.relpath(os.path.realpath(made.path), folder).replace(os.sep, "/")
    return json_text(labelme_document(replace(made.annotated, file_name=image))).encode("ascii")


def _geojson(made: Made, _: str) -> bytes:
    from ffseg.formats.exports import geojson_document, json_text

    return json_text(geojson_document(made.annotated)).encode("ascii")


def _film(made: Made, _: str) -> bytes:
    from ffseg.formats.film.animation import animation_bytes

    return animation_bytes(made.image, made.film)


def _strip(made: Made, _: str) -> bytes:
    from ffseg.formats.film.strip import film_strip_svg

    return film_strip_svg(made.image, made.film).encode("utf-8")


_ENCODERS: dict[OutputKind, Callable[[Made, str], bytes]] = {
    outputs.MASK: _mask,
    outputs.CONTOURS: _contours,
    outputs.OVERLAY: _overlay,
    outputs.COCO: _coco,
    outputs.LABELME: _labelme,
    outputs.GEOJSON: _geojson,
    outputs.FILM: _film,
    outputs.STRIP: _strip,
}
