"""Pixel features: appearance at several scales, and relation to the start region."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Floats, Image, Mask, Plane
from ffseg.errors import SegmentationError
from ffseg.evidence.maps import of_blocks
from ffseg.evidence.openings import OPENING_FEATURES, open_areas
from ffseg.native import _core

WORKING_SIZE = 400
"""Pixels: longest side at which features are computed; larger images are first reduced by an integer factor."""

SCALES = (0.7, 1.5, 3.0, 6.0)
"""Reduced pixels: standard deviations of the Gaussian smoothing."""

GEODESIC_SCALES = SCALES[:3]
"""Scales at which barrier distances from the start are computed; at the coarsest scale borders merge."""

SCALE_FEATURES = (
    "light",
    "red",
    "blue",
    "slope_light",
    "slope_colour",
    "slope",
    "tensor1",
    "tensor2",
    "bend1",
    "bend2",
)
"""Planes of one scale in the order of the native core: smoothed L, a, b, gradient sizes, structure tensor, Hessian."""

COLOUR_FEATURES = (*SCALE_FEATURES[:3], "slope")
"""The planes of one scale that do not tell of shapes."""

RELATIVE_FEATURES = ("from_light", "from_red", "from_blue", "from_start")
"""L, a, b less their means in the start region, and their length in deviations."""

BARRIER_FEATURES = ("barrier", "hardness", "reached", "level", "plateau")
"""The least maximum of the gradient on a way from the start, and what share of the image it lets pass."""

PLACE_FEATURES = ("x", "y", "across", "along", "distance")
"""Place in the image, and seen from the middle of the start, in parts of the image's width (``y``: of its height)."""

DEVIATION_FLOOR = 1.5
"""Units of L, a, b added to the standard deviation inside the start: camera noise, which a small disc may underestimate."""

GRADIENT_STEP = 0.01
"""Units of L, a, b per pixel: quantisation of gradients for barrier distances; sensor noise is larger."""

GEODESIC_SCALE, GEODESIC_STEP, MIN_COST = 1.5, 0.1, 1
"""Scale of the gradients for geodesic distances, their coarser quantisation, and the cost of a pixel without gradient:
length counts a little."""


def _names(texture: tuple[str, ...], scales: tuple[float, ...]) -> tuple[str, ...]:
    return tuple(f"{name}@{scale:g}" for scale in scales for name in (*texture, *RELATIVE_FEATURES))


DEFAULT_FEATURES = (
    *_names(SCALE_FEATURES, SCALES),
    *(f"{name}@{scale:g}" for scale in GEODESIC_SCALES for name in BARRIER_FEATURES),
    "way",
    "likeness",
    *PLACE_FEATURES,
)
"""Names of the planes in their order, unless less or more is asked for."""

SHAPELESS_FEATURES = (
    *(f"{name}@{scale:g}" for scale in GEODESIC_SCALES for name in COLOUR_FEATURES),
    *(f"{name}@{GEODESIC_SCALES[0]:g}" for name in BARRIER_FEATURES),
    "likeness",
)
"""Names of those that tell of no shapes, directions or places, nor of the coarsest scale, nor of ways at any but the finest.
What is relative to the start is left to where it is needed (`write_relative`)."""

ALL_FEATURES = (*DEFAULT_FEATURES, *OPENING_FEATURES)
"""Names of all planes in their order."""


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Features of a reduced image.

    Attributes
    ----------
    planes : ndarray of float32, shape (F, h, w)
        One plane for each of ``names``, all finite.
    names : tuple of str
        ``ALL_FEATURES``, ``DEFAULT_FEATURES`` or ``SHAPELESS_FEATURES``.
    inside : ndarray of uint8, shape (h, w)
        1 in the start region.
    factor : int
        Pixels a side of the image that became one.
    shape : tuple of int
        (H, W) of the image.
    """

    planes: Plane
    names: tuple[str, ...]
    inside: Image
    factor: int
    shape: tuple[int, int]

    def __getitem__(self, name: str) -> Plane:
        """The plane of that name, shape (h, w)."""
        plane: Plane = self.planes[self.names.index(name)]
        return plane


def reduction(shape: tuple[int, ...], size: int = WORKING_SIZE) -> int:
    """The integer factor by which an image of this shape is reduced."""
    return max(1, -(-max(shape[:2]) // size))


def features(
    image: Image, start: Mask, size: int = WORKING_SIZE, names: tuple[str, ...] = DEFAULT_FEATURES, least: float = 0.0
) -> Features:
    """Features of an image and its start region.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey or BGR.
    start : ndarray of bool, shape (H, W)
        True in the start region: inside by definition.
    size : int
        Pixels a side that the reduced image may have.
    names : tuple of str
        What to look for: ``DEFAULT_FEATURES``, less (``SHAPELESS_FEATURES``), or more (``ALL_FEATURES``).
    least : float
        Reduced pixels; a start of a smaller area than the disc of this radius is widened to about that disc.

    Raises
    ------
    SegmentationError
        If no pixel is in the start region.
    """
    shape = (image.shape[0], image.shape[1])
    factor = reduction(shape, size)
    inside = broadened(reduced_region(start, factor), least)
    height, width = inside.shape
    planes = np.empty((len(names), height, width), np.float32)
    lab = np.empty((3, height, width), np.float32)
    _core.evidence_lab(np.ascontiguousarray(image), factor, lab)
    plain = names == SHAPELESS_FEATURES
    looks, look = (
        (len(COLOUR_FEATURES), _core.evidence_colour) if plain else (len(SCALE_FEATURES), _core.evidence_texture)
    )
    at = 0
    for scale in GEODESIC_SCALES if plain else SCALES:
        look(lab, scale, planes[at : at + looks])
        at += looks
        if not plain:
            colours = planes[at - looks : at - looks + 3]
            write_relative(colours, inside, colours, planes[at : at + len(RELATIVE_FEATURES)])
            at += len(RELATIVE_FEATURES)
    found = Features(planes, names, inside, factor, shape)
    for scale in GEODESIC_SCALES[:1] if plain else GEODESIC_SCALES:
        _core.evidence_barrier(
            found[f"slope@{scale:g}"], inside, GRADIENT_STEP, planes[at : at + len(BARRIER_FEATURES)]
        )
        at += len(BARRIER_FEATURES)
    _likeness(found)
    if not plain:
        geodesic(found[f"slope@{GEODESIC_SCALE:g}"], inside, found["way"])
        _place(found)
    if names == ALL_FEATURES:
        open_areas(image, inside, factor, planes[-len(OPENING_FEATURES) :])
    return found


def write_relative(lab: Plane, inside: Image, some: Plane, out: Plane) -> None:
    """Write ``RELATIVE_FEATURES`` of some pixels' L, a and b, by what these are in the start region of the whole plane."""
    _core.evidence_relative(lab, inside, DEVIATION_FLOOR, some, out)


def geodesic(slope: Plane, inside: Image, out: Plane) -> None:
    """Write the geodesic distance from the start, with gradients as cost."""
    _core.evidence_geodesic(slope, inside, GEODESIC_STEP, MIN_COST, out)


def reduced_region(region: Mask, factor: int) -> Image:
    """A region at the reduced size: blocks of which at least half lies inside or, if there are none, any part.

    Raises
    ------
    SegmentationError
        If the region is empty.
    """
    rows = np.flatnonzero(region.any(axis=1))
    if len(rows) == 0:
        raise SegmentationError("no pixel centre lies in the start region; make init.radius larger or move it inside")
    found = np.zeros(reduced_shape(region.shape, factor), np.uint8)
    top, bottom = rows[0] // factor, rows[-1] // factor + 1  # the rest holds none of it
    shares = reduced_mean(region[top * factor : bottom * factor].astype(np.float32), factor)
    inside = shares >= 0.5
    found[top:bottom] = inside if inside.any() else shares > 0
    return found


def broadened(inside: Image, least: float) -> Image:
    """A region enlarged to the area of a disc of radius `least`, by the pixels nearest to it."""
    reach = least - np.sqrt(np.count_nonzero(inside) / np.pi)
    if reach <= 0:
        return inside
    steps = int(np.ceil(reach))
    padded, found = np.pad(inside, steps), np.zeros_like(inside)
    for y in range(-steps, steps + 1):
        for x in range(-steps, steps + 1):
            if x * x + y * y <= (reach + 0.5) ** 2:
                found |= padded[steps + y :, steps + x :][: inside.shape[0], : inside.shape[1]]
    return found


def reduced_shape(shape: tuple[int, ...], factor: int) -> tuple[int, int]:
    """Rows and columns of the reduced image."""
    return -(-shape[0] // factor), -(-shape[1] // factor)


def reduced_mean(plane: Plane, factor: int) -> Plane:
    """Means over blocks of ``factor`` x ``factor`` pixels; blocks at the right and lower borders may be smaller."""
    counts = [np.minimum(np.arange(size, 0, -factor), factor) for size in plane.shape]
    return np.ascontiguousarray(of_blocks(np.add, plane, factor) / (counts[0][:, None] * counts[1]), np.float32)


def enlarged(plane: Plane, factor: int, shape: tuple[int, int], stride: int = 1) -> Plane:
    """A reduced plane at the size of the image, interpolated linearly between block centres.

    Parameters
    ----------
    plane : ndarray of float32, shape (ceil(h / stride), ceil(w / stride))
        Every ``stride``-th value each way of a plane of shape (h, w).
    shape : tuple of int
        (H, W) of the image.

    Returns
    -------
    ndarray of float32, shape (H, W)
    """
    whole = np.empty(shape, np.float32)
    _core.evidence_enlarge(np.ascontiguousarray(plane), factor, stride, whole)
    return whole


def startless_planes(image: Image, size: int, names: tuple[str, ...]) -> Plane:
    """Planes of these names, shape (len(names), h, w), as `features` makes them; of those that need a start, zeros."""
    factor = reduction(image.shape, size)
    height, width = reduced_shape(image.shape, factor)
    lab, looks = (np.empty((count, height, width), np.float32) for count in (3, len(SCALE_FEATURES)))
    _core.evidence_lab(np.ascontiguousarray(image), factor, lab)
    planes, place = np.zeros((len(names), height, width), np.float32), {name: at for at, name in enumerate(names)}
    for scale in SCALES:
        _core.evidence_texture(lab, scale, looks)
        for name, look in zip(SCALE_FEATURES, looks, strict=True):
            if f"{name}@{scale:g}" in place:
                planes[place[f"{name}@{scale:g}"]] = look
    for name, values in (("x", _shares(width)), ("y", _shares(height)[:, None])):
        if name in place:
            planes[place[name]] = values
    return planes


def _shares(size: int) -> Floats:
    """Places of columns or rows, in parts of so many."""
    found: Floats = (np.arange(size, dtype=np.float32) + np.float32(0.5)) / np.float32(size)
    return found


def _likeness(found: Features) -> None:
    """Log likelihood ratio of a pixel's colour, in the start over in the image, smoothed by one pixel."""
    light = found.names.index(f"light@{GEODESIC_SCALE:g}")
    ratio = np.empty_like(found["likeness"])
    _core.evidence_likelihood(found.planes[light : light + 3], found.inside, ratio)
    _core.evidence_blur(ratio, 1.0, found["likeness"])


def _place(found: Features) -> None:
    height, width = found.inside.shape
    across, along = from_middle(found.inside)
    found["x"][:], found["y"][:] = _shares(width), _shares(height)[:, None]
    found["across"][:], found["along"][:] = across, along[:, None]
    found["distance"][:] = distance_plane(across, along)


def from_middle(inside: Image) -> tuple[Floats, Floats]:
    """Places of columns and of rows from the middle of a region, in parts of the width."""
    middle = [np.float64(at.sum()) / np.float64(len(at)) for at in np.nonzero(inside > 0)[::-1]]
    across, along = (
        ((np.arange(size, dtype=np.float32) - place) / inside.shape[1]).astype(np.float32)
        for size, place in zip(inside.shape[::-1], middle, strict=True)
    )
    return across, along


def distance_plane(across: Floats, along: Floats) -> Plane:
    """Distances at each column and row."""
    return np.sqrt((across * across) + (along * along)[:, None])
