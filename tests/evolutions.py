"""Evolutions of the free form on small edge maps, as the native core offers them, with a plain setting of all options."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed, unpacked
from ffseg.image.raster import rasterize
from ffseg.native import _core

SHAPE = (140, 180)
FLAT = np.zeros(SHAPE, np.uint16)
"""A gradient without a ridge."""
Edges = NDArray[np.uint8]


def evolution(
    starts: list[FreeForm], edges: Edges | None = None, domain: Edges | None = None, *, iterations: int = 0,
    gradient: NDArray[np.uint16] | None = None, **more: object,
) -> _core.Evolution:  # fmt: skip
    """An evolution in open ground with fixed patches, unless said otherwise; settled where a gradient is given."""
    options = _core.EvolutionOptions()
    options.degree, options.split_threshold, options.balloon = starts[0].degree, 40.0, 2.0
    options.refine, options.topology, options.max_iterations = False, True, 1000
    options.clearance, options.settle, options.ridge_low = 0.0, 4.0, 32.0
    for name, value in more.items():
        setattr(options, name, value)
    made = _core.Evolution(*packed(starts), np.zeros(SHAPE, np.uint8) if edges is None else edges, domain, options)
    if iterations:
        made.advance(iterations)
    if gradient is not None:
        made.settle(gradient)
    return made


def contours(made: _core.Evolution, degree: int = 3) -> tuple[FreeForm, ...]:
    return unpacked(*made.contours(), degree)


def areas(made: _core.Evolution, degree: int = 3) -> list[float]:
    return sorted(contour.signed_area for contour in contours(made, degree))


def region(made: _core.Evolution, degree: int = 3, shape: tuple[int, int] = SHAPE) -> NDArray[np.bool_]:
    return rasterize(contours(made, degree), shape)


def ring(radius: float, center: tuple[float, float] = (90.0, 70.0)) -> Edges:
    """A thin circle of edge pixels, 8-connected as Canny's are."""
    edges, angles = np.zeros(SHAPE, np.uint8), np.arange(int(16 * radius)) * 2 * np.pi / int(16 * radius)
    column, row = np.rint(center + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)).astype(int).T
    edges[row, column] = 255
    return edges


def around(angles: ArrayLike, radii: ArrayLike, degree: int = 3, at: tuple[float, float] = (90.0, 70.0)) -> FreeForm:
    """A contour through places round a centre."""
    return FreeForm.from_samples(at + np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1), degree)


def box(left: float, top: float, right: float, bottom: float, patches: int) -> FreeForm:
    """A box whose corners are joints, with so many straight cubic patches to a side."""
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    side = np.linspace(0, 1, 3 * patches + 1)[:-1, None]
    return FreeForm(
        np.concatenate([a + side * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]), 3
    )
