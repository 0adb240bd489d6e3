"""Pixel features: appearance at several scales, and relation to the start region."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Floats, Image, Indices, Mask, Plane
from ffseg.errors import SegmentationError
from ffseg.evidence.maps import blurred
from ffseg.image.appearance import TEXTURE, Appearance, reduced_shape
from ffseg.native import _core

SCALES = (0.7, 1.5, 3.0, 6.0)
"""Reduced pixels: standard deviations of the Gaussian smoothing."""

GEODESIC_SCALES = SCALES[:3]
"""Scales at which barrier distances from the start are computed; at the coarsest scale borders merge."""

COLOUR_FEATURES = (*TEXTURE[:3], "slope")
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


ALL_FEATURES = (
    *(f"{name}@{scale:g}" for scale in SCALES for name in (*TEXTURE, *RELATIVE_FEATURES)),
    *(f"{name}@{scale:g}" for scale in GEODESIC_SCALES for name in BARRIER_FEATURES),
    "way",
    "likeness",
    *PLACE_FEATURES,
)
"""Names of all planes in their order."""

TEXTURE_FEATURES = tuple(f"{name}@{scale:g}" for scale in SCALES for name in TEXTURE)
"""Names of those that are of no start and no place."""

SHAPELESS_FEATURES = (
    *(f"{name}@{scale:g}" for scale in GEODESIC_SCALES for name in COLOUR_FEATURES),
    *(f"{name}@{GEODESIC_SCALES[0]:g}" for name in BARRIER_FEATURES),
    "likeness",
)
"""Names of those that tell of no shapes, directions or places, nor of the coarsest scale, nor of ways at any but the finest.
What is relative to the start is left to where it is needed (`write_relative`)."""


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Features of a reduced image.

    Attributes
    ----------
    planes : dict of str to ndarray of float32, shape (h, w)
        All finite, by ``ALL_FEATURES`` or ``SHAPELESS_FEATURES``.
    colours : dict of float to ndarray of float32, shape (3, h, w)
        The planes of L, a and b at each scale, by that.
    inside : ndarray of uint8, shape (h, w)
        1 in the start region.
    factor : int
        Pixels a side of the image that became one.
    shape : tuple of int
        (H, W) of the image.
    """

    planes: dict[str, Plane]
    colours: dict[float, Plane]
    inside: Image
    factor: int
    shape: tuple[int, int]

    def __getitem__(self, name: str) -> Plane:
        """The plane of that name, shape (h, w)."""
        return self.planes[name]

    def of_pixels(self, names: tuple[str, ...], chosen: Indices) -> Floats:
        """Features of some pixels, counted row by row, shape (N, len(names))."""
        return np.stack([self.planes[name].ravel()[chosen] for name in names], axis=1)


def features(
    appearance: Appearance, start: Mask, names: tuple[str, ...] = ALL_FEATURES, least: float = 0.0
) -> Features:
    """Features of an image and its start region.

    Parameters
    ----------
    appearance : Appearance
        Of an image of shape (H, W) or (H, W, 3).
    start : ndarray of bool, shape (H, W)
        True in the start region: inside by definition.
    names : tuple of str
        What to look for: ``ALL_FEATURES`` or less, ``SHAPELESS_FEATURES``.
    least : float
        Reduced pixels; a start of a smaller area than the disc of this radius is widened to about that disc.

    Raises
    ------
    SegmentationError
        If no pixel is in the start region.
    """
    inside, plain = broadened(reduced_region(start, appearance.factor), least), names == SHAPELESS_FEATURES
    planes, scales = dict[str, Plane](), GEODESIC_SCALES if plain else SCALES
    for scale in scales:
        planes |= _colours(appearance, scale) if plain else _looks(appearance, scale, inside)
    for scale in GEODESIC_SCALES[:1] if plain else GEODESIC_SCALES:
        planes |= _at(scale, BARRIER_FEATURES, barriers(planes[f"slope@{scale:g}"], inside))
    if not plain:
        planes["way"] = np.empty(inside.shape, np.float32)
        geodesic(planes[f"slope@{GEODESIC_SCALE:g}"], inside, planes["way"])
    planes["likeness"] = _likeness(appearance, inside)
    if not plain:
        planes |= _places(inside)
    colours = {scale: appearance.smoothed(scale) for scale in scales}
    return Features(planes, colours, inside, appearance.factor, appearance.image.shape[:2])


def _at(scale: float, names: tuple[str, ...], planes: Iterable[Plane]) -> dict[str, Plane]:
    """Planes of a scale by their names."""
    return {f"{name}@{scale:g}": plane for name, plane in zip(names, planes, strict=True)}


def _colours(appearance: Appearance, scale: float) -> dict[str, Plane]:
    return _at(scale, COLOUR_FEATURES, (*appearance.smoothed(scale), appearance.slope(scale)))


def _looks(appearance: Appearance, scale: float, inside: Image) -> dict[str, Plane]:
    """Textures at a scale, and colours there compared with those in the start region."""
    texture, relative = appearance.texture(scale), np.empty((len(RELATIVE_FEATURES), *inside.shape), np.float32)
    colours = appearance.smoothed(scale)
    write_relative(colours, inside, colours, relative)
    return _at(scale, (*TEXTURE, *RELATIVE_FEATURES), (*texture, *relative))


def write_relative(lab: Plane, inside: Image, some: Plane, out: Plane) -> None:
    """Write ``RELATIVE_FEATURES`` of some pixels' L, a and b, by what these are in the start region of the whole plane."""
    _core.evidence_relative(lab, inside, DEVIATION_FLOOR, some, out)


def barriers(heights: Plane, start: Image, out: Plane | None = None) -> Plane:
    """What the minimax path from a start has to cross, a plane for each of ``BARRIER_FEATURES``."""
    planes = np.empty((len(BARRIER_FEATURES), *heights.shape), np.float32) if out is None else out
    _core.evidence_barrier(np.ascontiguousarray(heights), start, GRADIENT_STEP, planes)
    return planes


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


def reduced_mean(plane: Plane, factor: int) -> Plane:
    """Means over blocks of ``factor`` x ``factor`` pixels; blocks at the right and lower borders may be smaller.

    A slice a row of the blocks is added to the next, as `np.add.reduceat` takes five to ten times as long.
    """
    counts = [np.minimum(np.arange(size, 0, -factor), factor) for size in plane.shape]
    sums = plane
    for _ in range(2):  # rows, then columns
        before, sums = sums, sums[::factor].copy()
        for row in range(1, factor):
            part = before[row::factor]
            sums[: len(part)] += part
        sums = sums.T
    return np.ascontiguousarray(sums / (counts[0][:, None] * counts[1]), np.float32)


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


def startless_planes(appearance: Appearance, names: tuple[str, ...]) -> Plane:
    """Planes of these names, shape (len(names), h, w), as `features` makes them; of those that need a start, zeros."""
    height, width = appearance.shape
    planes = np.zeros((len(names), height, width), np.float32)
    known = {"x": _shares(width), "y": _shares(height)[:, None]}
    for scale in SCALES:
        known |= _at(scale, TEXTURE, appearance.texture(scale))
    for plane, name in zip(planes, names, strict=True):
        if name in known:
            plane[:] = known[name]
    return planes


def _shares(size: int) -> Floats:
    """Places of columns or rows, in parts of so many."""
    found: Floats = (np.arange(size, dtype=np.float32) + np.float32(0.5)) / np.float32(size)
    return found


def _likeness(appearance: Appearance, inside: Image) -> Plane:
    """Log likelihood ratio of a pixel's colour, in the start over in the image, smoothed by one pixel."""
    ratio = np.empty(inside.shape, np.float32)
    _core.evidence_likelihood(appearance.smoothed(GEODESIC_SCALE), inside, ratio)
    return blurred(ratio, 1.0)


def _places(inside: Image) -> dict[str, Plane]:
    height, width = inside.shape
    across, along = from_middle(inside)
    planes = np.empty((len(PLACE_FEATURES), height, width), np.float32)
    values = (_shares(width), _shares(height)[:, None], across, along[:, None], distance_plane(across, along))
    for plane, value in zip(planes, values, strict=True):
        plane[:] = value
    return dict(zip(PLACE_FEATURES, planes, strict=True))


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
