"""Regions drawn in other programs: annotation files of LabelMe, COCO and VIA, read as masks."""

from __future__ import annotations

import base64
import binascii
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ffseg.arrays import Mask
from ffseg.errors import FfsegError, ImageReadError, UsageError
from ffseg.geometry.freeform import FreeForm
from ffseg.image.raster import rasterize
from ffseg.io.exports import from_run_lengths
from ffseg.io.files import printable, read_bytes
from ffseg.io.images import decode_image

Paint = Callable[[Mask], None]
"""Sets the pixels of one region in the mask of an image."""

MAX_BYTES = 1 << 28
CIRCLE_CORNERS = 64
"""Of the polygon that stands for a circle or an ellipse: it leaves one of 100 px by 0.1 px."""


@dataclass(slots=True)
class Labels:
    """What a file says of each image.

    Attributes
    ----------
    regions : dict
        By the image's name as the file has it, then by label: how its regions are painted.
    sizes : dict
        (H, W) of the images as the file has them, where it says.
    odd : dict
        Images in which `mask` met a region that holds no pixel, or all of them, as keys.
    """

    regions: dict[str, dict[str, list[Paint]]] = field(default_factory=dict)
    sizes: dict[str, tuple[int, int]] = field(default_factory=dict)
    odd: dict[str, None] = field(default_factory=dict)

    def add(self, image: str, label: str, paint: Paint) -> None:
        """Add a region."""
        self.regions.setdefault(image, {}).setdefault(label, []).append(paint)

    def named(self, names: Sequence[str]) -> Labels:
        """The same of images that have these relative names, under these.

        An image and what the file has belong together where the ends of their paths have most in common, each of all
        the others: what is called ``a.png`` is of no image where there are ``x/a.png`` and ``y/a.png``.
        """
        pairs = self._pairs(names)
        return Labels(
            {name: self.regions[key] for name, key in pairs.items()},
            {name: self.sizes[key] for name, key in pairs.items() if key in self.sizes},
        )

    def without(self, names: Sequence[str]) -> list[str]:
        """What the file calls the images that belong to none of these."""
        known = set(self._pairs(names).values())
        return [key for key in self.regions if key not in known]

    def classes(self) -> set[str]:
        """Labels of all regions."""
        return {label for labelled in self.regions.values() for label in labelled}

    def _pairs(self, names: Sequence[str]) -> dict[str, str]:
        """What the file calls the images of these names, where image and entry are nearest to each other alone."""
        images, entries = _by_ends(names), _by_ends(self.regions)
        nearest = {name: _nearest(name, entries) for name in names}
        return {
            name: keys[0] for name, keys in nearest.items() if len(keys) == 1 and _nearest(keys[0], images) == [name]
        }

    def mask(self, name: str, label: str, shape: tuple[int, int]) -> Mask | None:
        """Regions of a label in an image, or of all labels where it is empty; None where the file has none.

        Parameters
        ----------
        name : str
            Relative name with ``/``.
        shape : tuple of int
            (H, W) of the image.

        Raises
        ------
        UsageError
            If a region, or the size that the file says, does not fit the image.
        """
        labelled = self.regions.get(name, {})
        paints = [paint for key, all_of_it in labelled.items() if label in ("", key) for paint in all_of_it]
        if not paints:
            return None
        height, width = self.sizes.get(name, shape)
        if (height, width) != shape:
            sizes = f"drawn on {width}x{height} pixels, the image has {shape[1]}x{shape[0]}"
            raise UsageError(f"the regions of {printable(name)} were {sizes}; export them again")
        mask = np.zeros(shape, np.bool_)
        try:
            for paint in paints:
                part = np.zeros(shape, np.bool_)
                paint(part)
                mask |= part
                if not part.any() or part.all():
                    self.odd[name] = None
        except (ValueError, TypeError, KeyError, IndexError, FfsegError, binascii.Error) as error:
            raise UsageError(f"a region of {printable(name)} cannot be read ({error}); export it again") from error
        return mask


def _by_ends(names: Iterable[str]) -> dict[str, list[str]]:
    """Paths by every end of theirs, from a slash on."""
    found: dict[str, list[str]] = {}
    for name in names:
        for end in _ends(name):
            found.setdefault(end, []).append(name)
    return found


def _nearest(name: str, others: Mapping[str, list[str]]) -> list[str]:
    """Those paths whose ends have most in common with a path."""
    return next((others[end] for end in _ends(name) if end in others), [])


def _ends(name: str) -> list[str]:
    parts = name.split("/")
    return ["/".join(parts[place:]) for place in range(len(parts))]


def read_labels(path: str | os.PathLike[str]) -> Labels:
    """Read a file of LabelMe, COCO or VIA, or a folder of LabelMe files."""
    labels = Labels()
    if os.path.isdir(path):
        names = sorted(
            os.path.join(place, one) for place, _, files in os.walk(path) for one in files if one.endswith(".json")
        )
        if not names:
            raise UsageError(
                f"{printable(path)} holds no .json file; name a file of LabelMe, COCO or VIA, or a folder of LabelMe's"
            )
    else:
        names = [os.fspath(path)]
    for name in names:
        try:
            beside = os.path.dirname(os.path.relpath(name, path)) if os.path.isdir(path) else ""
            _read(json.loads(read_bytes(name, MAX_BYTES)), labels, beside)
        except ImageReadError as error:
            raise UsageError(f"{printable(name)}: {error}") from error
        except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError) as error:
            raise UsageError(
                f"{printable(name)} is no file of LabelMe, COCO or VIA ({error}); export it again"
            ) from error
    return labels


def _read(document: Any, labels: Labels, beside: str) -> None:  # noqa: ANN401 - whatever the file holds
    if "shapes" in document:
        image = _name(f"{beside}/{document['imagePath']}".lstrip("/"))
        _size(document, "imageHeight", "imageWidth", labels, image)
        for shape in document["shapes"]:
            labels.add(image, str(shape["label"]), _labelme(shape))
    elif "annotations" in document:
        images = {one["id"]: _name(str(one["file_name"])) for one in document["images"]}
        for one in document["images"]:
            _size(one, "height", "width", labels, images[one["id"]])
        names = {one["id"]: str(one["name"]) for one in document.get("categories", ())}
        for one in document["annotations"]:
            labels.add(images[one["image_id"]], names.get(one.get("category_id"), ""), _coco(one))
    else:
        entries: Mapping[str, Any] = document.get("_via_img_metadata", document)
        if not document:
            raise ValueError("it is empty")
        for entry in entries.values():
            regions = entry["regions"]
            for region in regions.values() if isinstance(regions, dict) else regions:  # an object, of VIA 1
                words = [value for value in region.get("region_attributes", {}).values() if isinstance(value, str)]
                labels.add(_name(str(entry["filename"])), words[0] if words else "", _via(region["shape_attributes"]))


def _name(path: str) -> str:
    return os.path.normpath(path.replace("\\", "/"))


def _size(document: Mapping[str, Any], height: str, width: str, labels: Labels, image: str) -> None:
    """Keep the size that a file says of an image."""
    if isinstance(document.get(height), int) and isinstance(document.get(width), int):
        labels.sizes[image] = (document[height], document[width])


def polygon(points: Any) -> Paint:  # noqa: ANN401 - rows of two numbers, checked here
    """Paint the pixels whose centres lie in a polygon of which (0, 0) is the image's corner; in one of two points none does."""
    corners = np.asarray(points, np.float64)
    if corners.ndim != 2 or corners.shape[1] != 2 or not np.isfinite(corners).all():
        raise ValueError("a polygon needs points of two numbers")
    if len(corners) < 3:
        return _nothing

    def paint(mask: Mask) -> None:
        for ring in (corners, corners[::-1]):  # one that crosses itself has parts of both directions
            mask |= rasterize((FreeForm(ring - 0.5, 1),), mask.shape)

    return paint


def _rectangle(left: float, top: float, right: float, bottom: float) -> Paint:
    return polygon([[left, top], [right, top], [right, bottom], [left, bottom]])


def _ellipse(x: float, y: float, wide: float, high: float, turned: float = 0.0) -> Paint:
    if not np.isfinite([x, y, wide, high, turned]).all():
        raise ValueError("a circle needs a centre and a radius that are finite")
    turns = np.arange(CIRCLE_CORNERS) * (2 * np.pi / CIRCLE_CORNERS)
    across, down = wide * np.cos(turns), high * np.sin(turns)
    cosine, sine = np.cos(turned), np.sin(turned)
    return polygon(np.stack([x + cosine * across - sine * down, y + sine * across + cosine * down], axis=1))


def _nothing(_mask: Mask) -> None:
    """Paint what a point or a line encloses."""


def _labelme(shape: Mapping[str, Any]) -> Paint:
    points, kind = shape["points"], shape.get("shape_type", "polygon")
    if kind == "polygon":
        return polygon(points)
    if kind not in ("rectangle", "circle", "mask"):
        return _nothing
    (x0, y0), (x1, y1) = points
    if kind == "rectangle":
        return _rectangle(x0, y0, x1, y1)
    if kind == "circle":
        radius = float(np.hypot(x1 - x0, y1 - y0))
        return _ellipse(x0, y0, radius, radius)
    pixels = decode_image(base64.b64decode(shape["mask"]))
    part = (pixels if pixels.ndim == 2 else pixels.max(axis=2)) > 0  # LabelMe writes 0 and 1
    left, top = round(x0), round(y0)

    def paint(mask: Mask) -> None:
        seen = part[max(0, -top) :, max(0, -left) :]
        window = mask[max(0, top) :, max(0, left) :][: seen.shape[0], : seen.shape[1]]
        window |= seen[: window.shape[0], : window.shape[1]]

    return paint


def _coco(annotation: Mapping[str, Any]) -> Paint:
    found = annotation.get("segmentation")
    if isinstance(found, dict):
        height, width = (int(one) for one in found["size"])
        counts = found["counts"]
        lengths = _unpacked(counts) if isinstance(counts, str) else [int(one) for one in counts]
        if sum(lengths) != height * width or min(lengths) < 0:
            raise ValueError(f"run lengths of {sum(lengths)} pixels in an image of {height * width}")

        def paint(mask: Mask) -> None:
            if mask.shape != (height, width):  # told before memory is taken: a file may say any
                raise ValueError(f"run lengths of {width}x{height} pixels")
            mask |= from_run_lengths(lengths, (height, width))

        return paint
    if found:
        parts = [polygon(np.reshape(one, (-1, 2))) for one in found]

        def paint_all(mask: Mask) -> None:
            for part in parts:
                part(mask)

        return paint_all
    if "bbox" not in annotation:  # but keypoints
        return _nothing
    x, y, width, height = annotation["bbox"]
    return _rectangle(x, y, x + width, y + height)


def _unpacked(text: str) -> list[int]:
    """Run lengths of COCO's compressed form: five bits a character, each length but three as the change since two before."""
    lengths: list[int] = []
    value = shift = 0
    for character in text:
        code = ord(character) - 48
        value |= (code & 31) << shift
        shift += 5
        if not code & 32:
            value -= (1 << shift) if code & 16 else 0
            lengths.append(value + (lengths[-2] if len(lengths) > 2 else 0))
            value = shift = 0
    return lengths


def _via(shape: Mapping[str, Any]) -> Paint:
    kind = shape["name"]
    if kind == "polygon":
        return polygon(np.stack([shape["all_points_x"], shape["all_points_y"]], axis=1))
    if kind == "rect":
        return _rectangle(shape["x"], shape["y"], shape["x"] + shape["width"], shape["y"] + shape["height"])
    if kind == "circle":
        return _ellipse(shape["cx"], shape["cy"], shape["r"], shape["r"])
    if kind == "ellipse":
        return _ellipse(shape["cx"], shape["cy"], shape["rx"], shape["ry"], float(shape.get("theta", 0)))
    return _nothing
