"""The result every segmenter returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ffseg.geometry.freeform import FreeForm
from ffseg.image.edges import EdgeMap
from ffseg.parameters import Parameters


@dataclass(frozen=True, slots=True, eq=False)
class Progress:
    """A snapshot of an evolution, handed to a callback."""

    iteration: int
    contours: tuple[FreeForm, ...]


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


class Segmenter(Protocol):
    """Evolves start contours on an edge map."""

    def __call__(
        self,
        edge_map: EdgeMap,
        starts: tuple[FreeForm, ...],
        params: Parameters,
        callback: Callable[[Progress], None] | None = None,
        every: int = 10,
    ) -> tuple[tuple[FreeForm, ...], Stats]:
        """Return the final contours and their counts."""
