"""A camera's own image: what stays where it is in all images of a camera that moves, and the dark round its mirror."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image, Mask, Plane
from ffseg.errors import SegmentationError
from ffseg.image.checked import Pixels, taken_image
from ffseg.image.disc import Disc, valid_disc
from ffseg.image.parts import connected_parts
from ffseg.image.resized import copy_of
from ffseg.parameters import Levels

MIN_IMAGES = 5
"""With fewer images, edges of the scene may coincide by chance."""

WORKING_SIZE = 480
"""Pixels of the longer side of the reduced images; the outline is known to half of one of these."""

SIGMA = 1.0
"""Reduced pixels: standard deviation of the Gaussian before the gradient."""

FAINT_EDGE, CLEAR_EDGE = 0.4, 1.0
"""Units of L, a, b per reduced pixel: least gradient of an edge in one image, and least median gradient at which an
outline begins."""

NOISE_LEVEL = 0.2
"""The same unit: below it the direction of a gradient is unreliable."""

STABLE_FRACTION, WEAK_STABLE_FRACTION = 0.9, 0.65
"""Fractions of the images in which an edge keeps its place and direction: where an outline begins, and where it continues."""

MAX_GAP = 6
"""Reduced pixels: longest gap of an outline."""

MIN_SURE_FRACTION = 0.4
"""Least fraction of an outline that is sure (outlines of the camera's own parts mostly 0.5 to 1, kerbs along a drive 0
to 0.5)."""

MIN_LENGTH = 0.06
"""Least length of an outline, as a fraction of the longer side."""

BLUR_WIDTH = 3
"""Reduced pixels beside an outline within which the contrast across it may vary."""

MIN_AREA = 0.002
"""Least area of a part, as a fraction of the image."""

QUIET_FRACTION = 0.12
"""A part belongs to the camera if the fraction of it on which edges change is at most this, relative to the part that
changes most."""

MOVED_FRACTION = 0.15
"""The camera has moved if edges change on at least this fraction of the part that changes most (moving 0.19 to 0.7;
standing up to 0.12)."""

LARGE_AREA = 0.05
"""Least area of the part that changes most, as a fraction of the image."""

SCENE, OWN = 1, 2


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """What all images say of each reduced pixel."""

    stays: Plane  # share of the images with an edge here, of one direction
    strength: Plane  # median gradient
    lively: Mask  # where edges come and go
    disc: Disc | None  # of the mirror or fisheye, in the image's pixels


def own_image(images: Iterable[Pixels], *, rgb: bool = False, levels: Levels = "auto") -> Mask:
    """Where a camera sees itself or nothing.

    Parameters
    ----------
    images : iterable of ndarray of uint8, uint16 or float, shape (H, W) or (H, W, 3)
        As `segment` takes them: at least five of one size, from a camera that has moved between them. About 24
        are enough.
    rgb : bool
        Their channels are red, green, blue.
    levels : tuple of float or "auto"
        Of black and white, as ``input.range``.

    Returns
    -------
    ndarray of bool, shape (H, W)
        True on the camera's own image; nowhere if there is none.

    Raises
    ------
    SegmentationError
        If there are too few images, they differ in size, or the camera has not moved.

    Notes
    -----
    Not in the paper. An edge stays if nearly all images have one there, to a pixel, in one
    direction; whether it is bright on one side or the other does not matter, as the scene behind it changes (the largest
    eigenvalue of the mean structure tensor, each normed, of pixels beside a crest). Such edges part the image; of the
    parts, those in which nothing comes and goes are the camera's. The limit between both runs along the crest of
    the median gradient (a watershed). The disc that `valid_disc` finds in most of the images bounds what they show.

    Examples
    --------
    A mount below a scene that moves past:

    >>> scene = ffseg.read_image("pictures/complex.png")
    >>> images = [np.roll(scene, 40 * step, axis=1) for step in range(20)]
    >>> for image in images:
    ...     image[450:] = 90
    >>> own = ffseg.own_image(images)
    >>> bool(own[500, 400]), bool(own[100, 200])
    (True, False)
    """
    if isinstance(images, np.ndarray) and (images.ndim < 3 or (images.ndim == 3 and images.shape[2] in (3, 4))):
        raise SegmentationError(f"images is one of shape {images.shape}; give a list of several")
    shape, seen = _look(taken_image(image, rgb, levels) for image in images)
    kinds = _parted(seen)
    dark = np.zeros(shape, np.bool_) if seen.disc is None else seen.disc.mask(shape) == 0
    if not (kinds == OWN).any():
        return dark
    relief = cv2.cvtColor(np.clip(20 * seen.strength, 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)
    relief, markers = (cv2.copyMakeBorder(plane, 1, 1, 1, 1, cv2.BORDER_REPLICATE) for plane in (relief, kinds))
    flooded = cv2.watershed(relief, markers)[1:-1, 1:-1]  # which leaves the outermost pixels out
    own = np.where(
        connected_parts(flooded != SCENE, corners=True).at_least(MIN_AREA * flooded.size), np.uint8(255), np.uint8(0)
    )
    return dark | (cv2.resize(own, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR) >= 128)


def _look(images: Iterable[Image]) -> tuple[tuple[int, int], _Seen]:
    """Height and width of the images, and what they say together."""
    shape: tuple[int, int] | None = None
    tensor: Plane = np.zeros((3, 1, 1), np.float32)
    strengths, discs = list[Plane](), list[Disc | None]()
    for number, image in enumerate(images, 1):
        height, width = image.shape[:2]
        if (height, width) != (shape or (height, width)):
            raise SegmentationError(f"image {number} has {width} x {height} pixels, another size than those before it")
        shape = height, width
        x, y = _gradient(_reduced(image))
        strength = np.hypot(x, y)
        weight = (_beside_crests(x, y) / (strength**2 + NOISE_LEVEL**2)).astype(np.float32)
        tensor = cast("Plane", tensor + np.stack([x * x, y * y, x * y]) * weight)
        strengths.append(strength)
        discs.append(valid_disc(image))
    if shape is None or len(strengths) < MIN_IMAGES:
        raise SegmentationError(f"{len(strengths)} images are too few; take {MIN_IMAGES} or more of one camera")
    xx, yy, xy = tensor / np.float32(len(strengths))
    stays = (xx + yy) / 2 + np.sqrt((xx - yy) ** 2 / 4 + xy**2)
    middle, upper = np.quantile(np.stack(strengths), (0.5, 0.9), axis=0)
    return shape, _Seen(stays, middle.astype(np.float32), upper - middle >= CLEAR_EDGE, _usual(discs))


def _usual(discs: list[Disc | None]) -> Disc | None:
    found = [(disc.x, disc.y, disc.radius) for disc in discs if disc is not None]
    return Disc(*np.median(found, axis=0).tolist()) if 2 * len(found) > len(discs) else None


def _reduced(image: Image) -> Plane:
    """L, a, b of the image, reduced by a whole factor."""
    small, _ = copy_of(image, WORKING_SIZE)
    colour = small if small.ndim == 3 else cv2.cvtColor(small, cv2.COLOR_GRAY2BGR)
    return cast("Plane", cv2.cvtColor(colour.astype(np.float32) / 255, cv2.COLOR_BGR2LAB))


def _gradient(lab: Plane) -> tuple[Plane, Plane]:
    """Of the channel in which it is largest, pixel by pixel."""
    smooth = cv2.GaussianBlur(lab, (0, 0), SIGMA)
    x, y = (cast("Plane", cv2.Sobel(smooth, cv2.CV_32F, *way, ksize=3, scale=0.125)) for way in ((1, 0), (0, 1)))
    largest = (x**2 + y**2).argmax(axis=2)[..., None]
    return np.take_along_axis(x, largest, 2)[..., 0], np.take_along_axis(y, largest, 2)[..., 0]


def _beside_crests(x: Plane, y: Plane) -> Mask:
    x_levels, y_levels = (np.clip(256 * plane, -32768, 32767).astype(np.int16) for plane in (x, y))
    crests = cv2.Canny(x_levels, y_levels, 256 * FAINT_EDGE, 256 * FAINT_EDGE, L2gradient=True)
    return cv2.dilate(crests, np.ones((3, 3), np.uint8)) > 0


def _outlines(seen: _Seen) -> Mask:
    """Edges that stay: long ones that are sure somewhere, their gaps closed."""
    number, labels, found, _ = cv2.connectedComponentsWithStats((seen.stays >= WEAK_STABLE_FRACTION).astype(np.uint8))
    sure = np.bincount(labels[(seen.stays >= STABLE_FRACTION) & (seen.strength >= CLEAR_EDGE)], minlength=number)
    long = found[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1) >= MIN_LENGTH * max(labels.shape)
    kept = (sure >= MIN_SURE_FRACTION * found[:, cv2.CC_STAT_AREA]) & long
    kept[0] = False
    half = MAX_GAP // 2
    padded = np.pad(kept[labels].astype(np.uint8), half, mode="edge")  # an outline ends at the image's border
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * half + 1, 2 * half + 1))
    return cv2.morphologyEx(padded, cv2.MORPH_CLOSE, disc)[half:-half, half:-half] > 0


def _parted(seen: _Seen) -> NDArray[np.int32]:
    """`SCENE` and `OWN` on the parts between the outlines, 0 on these and on specks."""
    open_ground = (~_outlines(seen)).astype(np.uint8)
    open_parts = connected_parts(open_ground)
    labels, areas = open_parts.labels, open_parts.areas
    deep = cv2.distanceTransform(open_ground, cv2.DIST_L1, 3) > BLUR_WIDTH
    inner, changed = (np.bincount(labels[mask], minlength=len(areas)) for mask in (deep, deep & seen.lively))
    lively: NDArray[np.float64] = changed / np.maximum(inner, 1)
    counted = (areas >= MIN_AREA / 4 * labels.size) & (inner > 0)  # the limit is still to be added
    liveliest = lively[counted & (areas >= LARGE_AREA * labels.size)].max(initial=0)
    if liveliest < MOVED_FRACTION:
        raise SegmentationError("what the images show hardly changes; take some between which the camera has moved")
    kinds = np.where(lively >= QUIET_FRACTION * liveliest, SCENE, OWN) * counted
    found: NDArray[np.int32] = kinds[labels].astype(np.int32)
    return found
