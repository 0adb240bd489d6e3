"""What a method sees, what it returns, and the result every segmentation has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ffseg.camera.footprint import Footprint
from ffseg.errors import SegmentationError
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.regions import oriented
from ffseg.image.edges import EdgeMap
from ffseg.image.raster import rasterize
from ffseg.io.saving.savable import Savable
from ffseg.parameters import Parameters


@dataclass(frozen=True, slots=True, eq=False)
class Progress:
    """A snapshot of an evolution, handed to a callback."""

    iteration: int
    contours: tuple[FreeForm, ...]


@dataclass(frozen=True, slots=True)
class Stats:
    """Counts of one segmentation, zero where a method has no such thing; ``stop_reason`` says why it ended."""

    iterations: int = 0
    splits: int = 0
    prunes: int = 0
    flips: int = 0
    merges: int = 0
    initial_points: int = 0
    final_points: int = 0
    patches: int = 0
    stop_reason: str = "converged"


@dataclass(frozen=True, slots=True)
class Timings:
    """Milliseconds of wall time spent in the edge map, the evolution and in all."""

    edges_ms: float
    evolve_ms: float
    total_ms: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Segmentation(Savable):
    """The region a segmenter found.

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
        How sure the result is, from 0 to 1: the IoU that the prior lets expect, else the share of the boundary on
        clear edges.
    thresholds : tuple of float
        The (low, high) Canny thresholds that were used, in grey levels per pixel.
    """

    mask: NDArray[np.bool_]
    contours: tuple[FreeForm, ...]
    stats: Stats
    timings: Timings
    messages: tuple[str, ...] = ()
    source: str = ""
    score: float = 0.0
    thresholds: tuple[float, float] = (0.0, 0.0)

    @property
    def num_holes(self) -> int:
        """Inner contours."""
        return sum(contour.signed_area < 0 for contour in self.contours)


def _no_altitudes() -> NDArray[np.float64]:
    return np.empty((0, 4))


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """All that a method may look at.

    Attributes
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey or BGR.
    edges : EdgeMap
        What stops a contour; its ``domain`` is where the contour may go.
    starts : tuple of FreeForm
        Start contours of degree ``params.contour.degree``, outer ones with positive area; those given the other way
        round are turned (`ffseg.geometry.regions.oriented`).
    params : Parameters
    options : object, optional
        The method's own section of parameters, where it has one outside `params` (peers have).
    altitudes : ndarray of float64, shape (K, 4)
        Matched interest points of a camera pair: x and y in pixels, altitude in metres, radius of the zone in pixels.
    callback : callable, optional
        Wants a `Progress` at the start, after every `every` iterations, and at the end.
    every : int
    fixed : bool
        The starts stand where they must, as round a camera that sees itself: they are not moved off edges.
    footprint : Footprint, optional
        The robot on the ground that the image shows: passages it cannot take count as closed.
    """

    image: NDArray[np.uint8]
    edges: EdgeMap
    starts: tuple[FreeForm, ...]
    params: Parameters
    options: object = None
    altitudes: NDArray[np.float64] = field(default_factory=_no_altitudes)
    callback: Callable[[Progress], None] | None = None
    every: int = 10
    fixed: bool = False
    footprint: Footprint | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "starts", oriented(self.starts))

    @property
    def domain(self) -> NDArray[np.uint8] | None:
        """Nonzero where the contour may go, shape (H, W); None means the whole image."""
        return self.edges.domain

    def start_region(self) -> NDArray[np.bool_]:
        """Pixels whose centre lies in a start contour, shape (H, W)."""
        return rasterize(self.starts, self.edges.gradient.shape)


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a method found: contours, or a mask whose outlines are traced for it.

    Attributes
    ----------
    contours : tuple of FreeForm, or None
        Outer ones with positive signed area, holes negative.
    mask : ndarray of bool, shape (H, W), or None
        Needed when there are no contours.
    stats : Stats
    """

    contours: tuple[FreeForm, ...] | None
    stats: Stats = Stats()
    mask: NDArray[np.bool_] | None = None


LONGEST_SIDE = 65_535
"""Pixels; the native core keeps places as 16-bit numbers."""
LONGEST_MARCH = 32_767
"""Pixels; the level set and the snake need one bit more."""


def check_sides(shape: tuple[int, ...], most: int = LONGEST_SIDE, method: str = "ffseg") -> None:
    """Refuse an image with a side longer than a method takes.

    Raises
    ------
    SegmentationError
    """
    height, width = shape[:2]
    if max(height, width) > most:
        raise SegmentationError(
            f"the image has {width} x {height} pixels, {method} takes at most {most} a side; "
            "scale it down or cut it into pieces"
        )


class BlockedStartError(SegmentationError):
    """No sample of any start can move; the text is the remedy."""


class Segmenter(Protocol):
    """A method: finds a region from start contours."""

    def __call__(self, view: View) -> Outcome:
        """Return what is found in one image."""
