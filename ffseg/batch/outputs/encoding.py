"""Outputs of one image as bytes."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ffseg.arrays import Image
from ffseg.batch.outputs.table import Output
from ffseg.errors import SegmentationError
from ffseg.io.files import printable
from ffseg.io.overlays import Polyline, encode_overlay, jpeg_address
from ffseg.io.saving import ImageInfo
from ffseg.io.saving import encoded as saved
from ffseg.plugins import load
from ffseg.result import Segmentation
from ffseg.scene import Progress

if TYPE_CHECKING:
    from ffseg.freespace.outline import Ground

FILM_FRAMES = 120
"""Frames of an animation at most: eleven seconds, and bounded memory however long an evolution takes."""


@dataclass(slots=True, eq=False)
class SnapshotRecorder:
    """Keeps snapshots of an evolution, evenly: when too many have come, every second is dropped."""

    snapshots: list[Progress] = field(default_factory=list)
    step: int = 1
    num_seen: int = 0

    def __call__(self, snapshot: Progress) -> None:
        """Hear of the next snapshot."""
        if self.num_seen % self.step == 0:
            self.snapshots.append(snapshot)
            if len(self.snapshots) > FILM_FRAMES:
                del self.snapshots[1::2]
                self.step *= 2
        self.num_seen += 1


@dataclass(frozen=True, slots=True, eq=False)
class Context:
    """What an output may be made from beside the result.

    Attributes
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    name : str
        Relative name of the image.
    path : str
        Where it is: of a frame or a member of a tar file its name below that file.
    target : str
        Where the output will be stored.
    lines : sequence of Polyline
        For the overlay.
    snapshots : sequence of Progress
        For the animation; the result is added.
    ground : Ground, optional
        Free space of a camera's image in metres.
    camera : mapping
        How the camera stood, and how it moved since earlier images.
    label : str
        Class of every region.
    """

    image: Image
    name: str
    path: str
    target: str = ""
    lines: Sequence[Polyline] = ()
    snapshots: Sequence[Progress] = ()
    ground: Ground | None = None
    camera: Mapping[str, Any] = field(default_factory=dict)
    label: str = "region"


def encoded_output(kind: Output, result: Segmentation, context: Context) -> bytes:
    """The output of one kind.

    Raises
    ------
    SegmentationError
        If the function of a plug-in gives no bytes.
    """
    if not kind.encode:
        return saved(result, kind.name, ImageInfo(readable(context.name), context.image, label=context.label))
    data = load(kind.encode)(result, context)
    if not isinstance(data, bytes):
        raise SegmentationError(f"the output {kind.name} gave {type(data).__name__}, not bytes; mend its function")
    return data


def readable(name: str) -> str:
    """Name of a file as other programs can read it from JSON: bytes that are no UTF-8 are written out."""
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:
        return printable(name)
    return name


def contours(result: Segmentation, context: Context) -> bytes:
    """The contours as an SVG file."""
    return saved(result, "svg", ImageInfo(context.name))


def overlay(result: Segmentation, context: Context) -> bytes:
    """The image with its contours drawn, as a PNG file."""
    return encode_overlay(context.image, context.lines, result.mask)


def labelme(result: Segmentation, context: Context) -> bytes:
    """LabelMe document."""
    return saved(result, "labelme", as_labelme(context.target, context.path, context.image, context.label))


def as_labelme(document: str, path: str, image: Image, label: str) -> ImageInfo:
    """An image as LabelMe opens it: by the path from where the document is stored, or held by it without a file of its own."""
    behind = "" if os.path.isfile(path) else jpeg_address(image, _QUALITY)
    return ImageInfo(path_from(document, path), behind=behind, label=label)


def path_from(document: str, image: str) -> str:
    """Path of an image from where a document is stored, or its address, as LabelMe opens it: links are not followed."""
    folder = os.path.realpath(os.path.dirname(document))
    there = image if "://" in image else os.path.relpath(os.path.realpath(image), folder)
    return readable(there.replace(os.sep, "/"))


_QUALITY = 90
"""Of the picture behind a drawing: a tenth of what PNG takes, and no difference to be seen at twice its size."""


def drawing(result: Segmentation, context: Context) -> bytes:
    """The contours over the image as an SVG file that needs no other."""
    return saved(result, "svg", ImageInfo(context.name, behind=jpeg_address(context.image, _QUALITY)))


def film(result: Segmentation, context: Context) -> bytes:
    """The evolution as an animated WebP file."""
    from ffseg.io.animation import animation_bytes

    return animation_bytes(context.image, _frames(result, context))


def strip(result: Segmentation, context: Context) -> bytes:
    """Six snapshots of the evolution as an SVG file."""
    from ffseg.io.strip import film_strip_svg

    return film_strip_svg(context.image, _frames(result, context)).encode("utf-8")


def _frames(result: Segmentation, context: Context) -> list[Progress]:
    """Snapshots with the result as the last, in place of one the method may have given of it."""
    last = Progress(result.stats.iterations, tuple(result.contours))
    before = (snapshot for snapshot in context.snapshots if snapshot.iteration < last.iteration)
    return [*(snapshot for snapshot in before if snapshot.contours), last]


def coco_of_all(contents: Callable[[], Iterable[bytes]], _: str) -> Iterator[bytes]:
    """One COCO document of those of all images."""
    from ffseg.io.exports import merged_coco

    return merged_coco(lambda: map(json.loads, contents()))


def yolo_of_all(_: Callable[[], Iterable[bytes]], label: str) -> Iterator[bytes]:
    """The names of the classes of all YOLO labels, as a data set's YAML file has them."""
    yield f"names:\n  0: {json.dumps(readable(label), ensure_ascii=False)}\n".encode()
