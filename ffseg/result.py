"""The result of a segmentation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ffseg.geometry.freeform import FreeForm
from ffseg.image.selection import count_regions
from ffseg.io.saving import Savable
from ffseg.scene import Stats


@dataclass(frozen=True, slots=True)
class Timings:
    """Milliseconds of wall time spent in the edge map, the evolution and in all.

    Examples
    --------
    >>> timings = ffseg.segment(ffseg.read_image("pictures/toy.png")).timings
    >>> timings.edges_ms + timings.evolve_ms <= timings.total_ms
    True
    """

    edges_ms: float
    evolve_ms: float
    total_ms: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Segmentation(Savable):
    """The result of a segmentation.

    Attributes
    ----------
    mask : ndarray of bool, shape (H, W)
        True where the pixel centre lies in the region.
    contours : tuple of FreeForm
        Closed contours of the region; outer ones have positive signed area, holes negative.
    stats : Stats
    timings : Timings
    messages : tuple of str
        What was done otherwise than asked, such as a start that had to be moved.
    source : str
        The edge source that decided: for ``auto`` either ``gradient`` or ``prior``; ``given`` for edges of the caller's.
    score : float
        How sure the result is, from 0 to 1: the IoU that the evidence lets expect, else the share of the boundary on
        clear edges; low where there is a doubt.
    doubts : tuple of str
        Why nobody can be sure: ``empty``, ``filled`` (the region fills its domain), ``border`` (it ends at the border nearly
        all round), ``early`` (the contour was stopped), ``start`` (the start lies across an edge or the domain's limit).
    thresholds : tuple of float
        The (low, high) Canny thresholds that were used, in grey levels per pixel.

    Examples
    --------
    >>> result = ffseg.segment(ffseg.read_image("pictures/toy.png"))
    >>> result.source, result.score, [contour.signed_area > 0 for contour in result.contours]
    ('gradient', 1.0, [True, False, False, False, False])
    """

    mask: NDArray[np.bool_]
    contours: tuple[FreeForm, ...]
    stats: Stats
    timings: Timings
    messages: tuple[str, ...] = ()
    source: str = ""
    score: float = 0.0
    thresholds: tuple[float, float] = (0.0, 0.0)
    doubts: tuple[str, ...] = ()

    @property
    def num_regions(self) -> int:
        """Regions that the mask shows: pixels that hang together over their sides."""
        return count_regions(self.mask)[0]

    @property
    def num_holes(self) -> int:
        """Holes that the mask shows: pixels outside that hang together over sides or corners, and not with the border."""
        return count_regions(self.mask)[1]
