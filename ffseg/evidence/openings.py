"""Open areas: what can be reached from the start without crossing an edge, through passages of several widths."""

from __future__ import annotations

import numpy as np

from ffseg.arrays import Image, Plane
from ffseg.evidence.maps import dilated, of_blocks
from ffseg.image.edges import edge_map
from ffseg.native import _core
from ffseg.parameters import Edges

PASSAGE_WIDTHS = (1, 3, 5, 9)
"""Widths in reduced pixels; a narrower passage between edges is shut."""

SMOOTHING = 3.0
"""Reduced pixels; standard deviation of the planes that tell of the neighbourhood."""

OPENING_FEATURES = (*(f"open{width}" for width in PASSAGE_WIDTHS), *(f"open{width}~" for width in PASSAGE_WIDTHS))
"""Names of the planes in their order: 1 on open areas and 0 elsewhere, then the same smoothed."""


def open_areas(image: Image, inside: Image, factor: int, out: Plane) -> None:
    """Write the planes that ``OPENING_FEATURES`` names.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    inside : ndarray of uint8, shape (h, w)
        Nonzero in the start region, which is open itself.
    factor : int
        Pixels a side of the image that became one.
    out : ndarray of float32, shape (len(OPENING_FEATURES), h, w)

    Notes
    -----
    Edges are found in the whole image, with the thresholds of the defaults; a reduced pixel with an edge in it is a wall.
    On reduced images faint borders are lost: their edges teach hardly anything.
    """
    walls = _reduced_any(edge_map(image, Edges()).edges, factor)
    planes = np.empty((5, *inside.shape), np.float32)
    for place, width in enumerate(PASSAGE_WIDTHS):
        shut = dilated(walls, width)
        _core.evidence_barrier(shut.astype(np.float32), inside, 1.0, planes)
        reached = dilated(((planes[0] == 0) & (shut == 0)).astype(np.uint8), width)
        out[place] = reached | (inside > 0)
        _core.evidence_blur(out[place], SMOOTHING, out[place + len(PASSAGE_WIDTHS)])


def _reduced_any(edges: Image, factor: int) -> Image:
    """1 where a block of ``factor`` x ``factor`` pixels holds an edge."""
    return np.minimum(of_blocks(np.maximum, edges, factor), np.uint8(1))
