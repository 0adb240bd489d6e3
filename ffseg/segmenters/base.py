"""The result every segmenter returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ffseg.geometry.freeform import FreeForm


@dataclass(frozen=True, slots=True)
class Stats:
    """Counts of one segmentation; ``stop_reason`` says why it ended."""

    iterations: int
    splits: int
    prunes: int
    flips: int
    merges: int
    initial_points: int
    final_points: int
    patches: int
    stop_reason: str


@dataclass(frozen=True, slots=True)
class Timings:
    """Milliseconds of wall time spent in the edge map, the evolution and in all."""

    edges_ms: float
    evolve_ms: float
    total_ms: float


@dataclass(frozen=True, slots=True, eq=False)
class Segmentation:
    """The region a segmenter found.

    Attributes
    ----------
    mask : ndarray of bool, shape (H, W)
        True where the pixel centre lies in the region.
    contours : tuple of FreeForm
        Closed contours of the region; outer ones have positive signed area, holes negative.
    stats : Stats
    timings : Timings
    """

    mask: NDArray[np.bool_]
    contours: tuple[FreeForm, ...]
    stats: Stats
    timings: Timings
