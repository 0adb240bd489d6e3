"""Evolutions of the free form on small edge maps, as the native core offers them, with a plain setting of all options."""

import numpy as np
from numpy.typing import NDArray

from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed, unpacked
from ffseg.image.raster import rasterize
from ffseg.native import _core

SHAPE = (140, 180)
Edges = NDArray[np.uint8]


def evolution(
    starts: list[FreeForm], edges: Edges | None = None, domain: Edges | None = None, **more: object
) -> _core.Evolution:
    """An evolution in open ground with fixed patches, unless said otherwise."""
    options = _core.EvolutionOptions()
    options.degree, options.split_threshold, options.balloon = starts[0].degree, 40.0, 2.0
    options.refine, options.topology, options.max_iterations = False, True, 1000
    options.clearance, options.settle, options.ridge_low = 0.0, 4.0, 32.0
    for name, value in more.items():
        setattr(options, name, value)
    return _core.Evolution(*packed(starts), np.zeros(SHAPE, np.uint8) if edges is None else edges, domain, options)


def contours(made: _core.Evolution, degree: int = 3) -> tuple[FreeForm, ...]:
    return unpacked(*made.contours(), degree)


def areas(made: _core.Evolution, degree: int = 3) -> list[float]:
    return sorted(contour.signed_area for contour in contours(made, degree))


def region(made: _core.Evolution, degree: int = 3, shape: tuple[int, int] = SHAPE) -> NDArray[np.bool_]:
    return rasterize(contours(made, degree), shape)


def box(left: float, top: float, right: float, bottom: float, patches: int) -> FreeForm:
    """A box whose corners are joints, with so many straight cubic patches to a side."""
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    side = np.linspace(0, 1, 3 * patches + 1)[:-1, None]
    return FreeForm(
        np.concatenate([a + side * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]), 3
    )
