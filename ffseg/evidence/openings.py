"""Open areas: what can be reached from the start without crossing an edge, through passages of several widths."""

from __future__ import annotations

import numpy as np

from ffseg.arrays import Image, Plane
from ffseg.image.parts import dilated, parts_holding
from ffseg.native import _core

PASSAGE_WIDTHS = (1, 3, 5, 9)
"""Widths in reduced pixels; a narrower passage between edges is shut."""

SMOOTHING = 3.0
"""Reduced pixels; standard deviation of the planes that tell of the neighbourhood."""

OPENING_FEATURES = (*(f"open{width}" for width in PASSAGE_WIDTHS), *(f"open{width}~" for width in PASSAGE_WIDTHS))
"""Names of the planes in their order: 1 on open areas and 0 elsewhere, then the same smoothed."""


def open_areas(walls: Image, inside: Image) -> Plane:
    """The planes that ``OPENING_FEATURES`` names, shape (len(OPENING_FEATURES), h, w).

    Parameters
    ----------
    walls : ndarray of uint8, shape (h, w)
        1 where a reduced pixel holds an edge of the whole image: on reduced images faint borders are lost, and their edges
        teach hardly anything.
    inside : ndarray of uint8, shape (h, w)
        Nonzero in the start region, which is open itself.
    """
    out, start = np.empty((len(OPENING_FEATURES), *inside.shape), np.float32), inside > 0
    for place, width in enumerate(PASSAGE_WIDTHS):
        free = dilated(walls, width) == 0
        reached = parts_holding(free | start, start) & free
        out[place] = (dilated(reached.view(np.uint8), width) > 0) | start
        _core.evidence_blur(out[place], SMOOTHING, out[place + len(PASSAGE_WIDTHS)])
    return out
