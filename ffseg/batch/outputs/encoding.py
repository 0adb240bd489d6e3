"""Outputs of one image as bytes."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ffseg.batch.outputs.table import Output, resolve
from ffseg.io.files import printable
from ffseg.io.masks import encode_mask
from ffseg.io.overlays import Polyline, encode_overlay, jpeg_address
from ffseg.io.svg import svg_document
from ffseg.result import Segmentation
from ffseg.scene import Progress

if TYPE_CHECKING:
    from ffseg.io.exports import AnnotatedImage

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

    def encoded(self, kind: Output, target: str) -> bytes:
        """The output of one kind that will be stored at `target`."""
        data: bytes = resolve(kind.encode)(self, target)
        return data

    @cached_property
    def annotated(self) -> AnnotatedImage:
        """What exports know of the image."""
        from ffseg.io.saving.kinds import annotated

        return annotated(self.result, _readable(self.name))

    @cached_property
    def film(self) -> list[Progress]:
        """Snapshots with the result as the last, in place of one the segmenter may have given of it."""
        last = Progress(self.result.stats.iterations, tuple(self.result.contours))
        before = (snapshot for snapshot in self.snapshots if snapshot.iteration < last.iteration)
        return [*(snapshot for snapshot in before if snapshot.contours), last]


def _readable(name: str) -> str:
    """Name of a file as other programs can read it from JSON: bytes that are no UTF-8 are written out."""
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:
        return printable(name)
    return name


def mask(made: Made, _: str) -> bytes:
    """The region as a PNG file."""
    return encode_mask(made.result.mask)


def contours(made: Made, _: str) -> bytes:
    """The contours as an SVG file."""
    height, width = made.image.shape[:2]
    return svg_document(made.result.contours, width, height, made.name).encode("utf-8")


def overlay(made: Made, _: str) -> bytes:
    """The image with its contours drawn, as a PNG file."""
    return encode_overlay(made.image, made.lines, made.result.mask)


def coco(made: Made, _: str) -> bytes:
    """COCO document of the image."""
    from ffseg.io.exports import coco_document, json_text

    return json_text(coco_document(made.annotated)).encode("ascii")


def labelme(made: Made, target: str) -> bytes:
    """LabelMe document of the image, which names it by the path from `target`."""
    from dataclasses import replace

    from ffseg.io.exports import json_text, labelme_document

    folder = os.path.realpath(os.path.dirname(target))  # LabelMe opens the path from there, without following links
    image = _readable(os.path.relpath(os.path.realpath(made.path), folder).replace(os.sep, "/"))
    return json_text(labelme_document(replace(made.annotated, file_name=image))).encode("ascii")


def geojson(made: Made, _: str) -> bytes:
    """GeoJSON document of the image."""
    from ffseg.io.exports import geojson_document, json_text

    return json_text(geojson_document(made.annotated)).encode("ascii")


_QUALITY = 90
"""Of the picture behind a drawing: a tenth of what PNG takes, and no difference to be seen at twice its size."""


def drawing(made: Made, _: str) -> bytes:
    """The contours over the image as an SVG file that needs no other."""
    height, width = made.image.shape[:2]
    behind = jpeg_address(made.image, _QUALITY)
    return svg_document(made.result.contours, width, height, made.name, behind).encode("utf-8")


def film(made: Made, _: str) -> bytes:
    """The evolution as an animated WebP file."""
    from ffseg.io.animation import animation_bytes

    return animation_bytes(made.image, made.film)


def strip(made: Made, _: str) -> bytes:
    """Six snapshots of the evolution as an SVG file."""
    from ffseg.io.strip import film_strip_svg

    return film_strip_svg(made.image, made.film).encode("utf-8")


def coco_of_all(contents: Callable[[], Iterable[bytes]]) -> Iterator[bytes]:
    """One COCO document of those of all images."""
    from ffseg.io.exports import merged_coco

    return merged_coco(lambda: map(json.loads, contents()))
