"""The value that the steps of a segmentation pass on, and the outcome of a method."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image
from ffseg.camera.footprint import Footprint
from ffseg.errors import ParameterError, SegmentationError
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.regions import oriented
from ffseg.image.edges import EdgeMap
from ffseg.image.raster import rasterize
from ffseg.parameters import Box, Parameters
from ffseg.plugins import Method


@dataclass(frozen=True, slots=True, eq=False)
class Progress:
    """A snapshot of an evolution, handed to a callback.

    Examples
    --------
    >>> seen = []
    >>> result = ffseg.segment(ffseg.read_image("pictures/toy.png"), callback=seen.append)
    >>> seen[0].iteration, seen[0].contours, seen[-1].iteration == result.stats.iterations
    (0, (<FreeForm of degree 3: 13 patches, signed area 5026.6 px^2>,), True)
    """

    iteration: int
    contours: tuple[FreeForm, ...]


@dataclass(frozen=True, slots=True)
class Stats:
    """Counts of one segmentation (0 where a method has no such count); ``stop_reason`` says why it ended.

    Examples
    --------
    >>> stats = ffseg.segment(ffseg.read_image("pictures/toy.png")).stats
    >>> stats.initial_points, stats.final_points == 3 * stats.patches, stats.stop_reason
    (39, True, 'converged')
    """

    iterations: int = 0
    splits: int = 0
    prunes: int = 0
    flips: int = 0
    merges: int = 0
    initial_points: int = 0
    final_points: int = 0
    patches: int = 0
    stop_reason: str = "converged"


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a method found: contours, or a mask whose outlines are then traced.

    Attributes
    ----------
    contours : tuple of FreeForm, or None
        Outer ones with positive signed area, holes negative.
    mask : ndarray of bool or uint8, shape (H, W), or None
        Nonzero inside; needed when there are no contours.
    stats : Stats

    Raises
    ------
    ParameterError
        If the contours are none and there is no mask, or the stats are none.

    Examples
    --------
    >>> bright = np.zeros((60, 80), bool)
    >>> bright[10:50, 20:60] = True
    >>> image = 200 * bright.astype(np.uint8)
    >>> result = ffseg.segment(image, {"init.radius": 8}, method=lambda scene: ffseg.Outcome(mask=bright))
    >>> int(result.mask.sum()), result.contours[0].signed_area > 0
    (1600, True)
    """

    contours: tuple[FreeForm, ...] | None = None
    stats: Stats = Stats()
    mask: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        found: object = self.contours
        are_contours = isinstance(found, Sequence) and all(isinstance(one, FreeForm) for one in found)
        if not (are_contours or (found is None and self.mask is not None)):
            raise ParameterError(
                "the contours of an ffseg.Outcome are no tuple of ffseg.FreeForm; give those, or a mask"
            )
        stats: object = self.stats
        if not isinstance(stats, Stats):
            raise ParameterError(
                f"the stats of an ffseg.Outcome are of type {type(stats).__name__}; give ffseg.Stats()"
            )


NO_EDGES = EdgeMap(np.empty((0, 0), np.uint16), np.empty((0, 0), np.uint8), None, (0.0, 0.0))
"""What is known of the edges before the evidence is asked."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Everything known about an image while it is segmented: its inputs, and the results of the steps so far.

    Edge sources and methods of your own take it as their one argument.

    Attributes
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey or BGR.
    params : Parameters
    method : Method or None
        Row of the method; None stands for ``params.method`` until the first step has looked it up.
    edges : EdgeMap
        What stops a contour; empty until it is known.
    edges_given : bool
        Whether the edges are the caller's own, which take the place of ``edges.source``.
    starts : tuple of FreeForm
        Start contours of degree ``params.contour.degree``, outer ones with positive area; those given the other way
        round are turned (`ffseg.geometry.regions.oriented`).
    domain : ndarray of uint8, shape (H, W), or None
        Nonzero where the contour may go; None means the whole image.
    disc : ndarray of uint8, shape (H, W), or None
        The valid disc of a mirror or fisheye, found where no domain is given. It bounds the contour only: thresholds
        stay those of the image.
    start_mask, background : ndarray of uint8, shape (H, W), or None
        Nonzero inside the start regions; nonzero at what lies outside the region.
    appearance : object, optional
        What ffseg's own models see of the image wherever a start may lie, where one has looked for a start.
    evidence : ndarray of float32, shape (H, W), or None
        From 0 to 1: probability of inside, or edge strength, as ``edges.evidence`` says.
    center : tuple of float, or None
        What ``init.center: auto`` stands for, where it is not the image centre.
    robot : float
        Radius of the disc round `center` in which a camera sees its own robot, pixels; 0: none.
    options : object, optional
        The method's own section of parameters, where it has one outside `params` (peers have).
    altitudes : ndarray of float64, shape (K, 4)
        Matched interest points of a camera pair: x and y in pixels, altitude in metres, radius of the zone in pixels.
    footprint : Footprint, optional
        The robot on the ground that the image shows: passages it cannot take count as closed.
    callback : callable, optional
        Wants a `Progress` at the start, after every `every` iterations, and at the end.
    every : int
    draft : bool
        Whether it is looked at while the hand moves: what takes long may be done less well.
    factor : int
        By which the picture that was given is larger (`ffseg.enlargement`); sentences tell places in that one.

    Examples
    --------
    >>> scene = ffseg.Scene(ffseg.read_image("pictures/toy.png"))
    >>> scene.shape, scene.params.method, scene.starts
    ((600, 800), 'freeform', ())
    """

    image: Image
    params: Parameters = field(default_factory=Parameters)
    method: Method | None = None
    edges: EdgeMap = NO_EDGES
    edges_given: bool = False
    starts: tuple[FreeForm, ...] = ()
    domain: Image | None = None
    disc: Image | None = None
    start_mask: Image | None = None
    background: Image | None = None
    appearance: object = None
    evidence: NDArray[np.float32] | None = None
    center: tuple[float, float] | None = None
    robot: float = 0.0
    options: object = None
    altitudes: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 4)))
    footprint: Footprint | None = None
    callback: Callable[[Progress], None] | None = None
    every: int = 10
    draft: bool = False
    factor: int = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "starts", oriented(self.starts))

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) of the image."""
        return (self.image.shape[0], self.image.shape[1])

    @property
    def limits(self) -> Image | None:
        """Nonzero where the contour may go: the domain or, where none is given, the valid disc; None means the whole image."""
        return self.disc if self.domain is None else self.domain

    @property
    def fixed(self) -> bool:
        """Whether the starts must stay where they are, as those round a camera: they are not moved off edges."""
        return self.center is not None and self.params.init.center == "auto"

    @property
    def pointed(self) -> bool:
        """Whether somebody has pointed at the first of the starts, which grow; nobody points at the middle of an image."""
        init, grows = self.params.init, self.params.contour.balloon >= 0
        return grows and self.start_mask is None and (init.center != "auto" or bool(init.circles))

    @property
    def covered(self) -> tuple[FreeForm, ...]:
        """Starts in which a camera sees its own robot: what is seen there says nothing of the ground round it."""
        return self.starts if self.fixed else ()

    @property
    def shuts_passages(self) -> bool:
        """Whether passages that are too narrow are closed, so that contours end there without an edge."""
        return self.params.contour.clearance > 0 or self.footprint is not None

    @property
    def boxes(self) -> tuple[Box, ...]:
        """Boxes that contain the object, everything outside being background; none if a mask gives the starts."""
        return self.params.init.boxes if self.start_mask is None else ()

    @property
    def clicked_outside(self) -> bool:
        """Whether points, circles or a mask outside the region are given (boxes do not count)."""
        return bool(self.params.init.background) or self.background is not None

    @property
    def has_rivals(self) -> bool:
        """Whether something lies outside of which the edges do not know: what clicks have taught them, they do."""
        return self.params.region.border == "outside" or (self.clicked_outside and self.edges.source != "hints")

    @property
    def has_hints(self) -> bool:
        """Whether more than one start is given, from which the source ``hints`` learns what this image shows."""
        corrects = bool(self.boxes and self.params.init.circles)
        several = len(self.starts) > 1 and self.params.contour.balloon >= 0  # what closes in is each about one object
        return several or self.clicked_outside or corrects

    def start_region(self) -> NDArray[np.bool_]:
        """Pixels whose centre lies in a start contour, shape (H, W)."""
        return rasterize(self.starts, self.shape)


class Segmenter(Protocol):
    """A method: finds a region from start contours.

    Examples
    --------
    >>> def start_only(scene: ffseg.Scene) -> ffseg.Outcome:
    ...     return ffseg.Outcome(scene.starts)
    >>> ffseg.segment(ffseg.read_image("pictures/toy.png"), method=start_only).contours
    (<FreeForm of degree 3: 13 patches, signed area 5026.6 px^2>,)
    """

    def __call__(self, scene: Scene) -> Outcome:
        """Return what is found in one image."""


MAX_SIDE = 65_535
"""Pixels; the native core keeps places as 16-bit numbers."""
MAX_MARCHING_SIDE = 32_767
"""Pixels; the level set and the snake need one bit more."""


def check_sides(shape: tuple[int, ...], most: int = MAX_SIDE, method: str = "ffseg") -> None:
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


class NothingThereError(SegmentationError):
    """The region is empty, as a model of many things tells of none; the text says so."""


class BlockedStartError(SegmentationError):
    """No sample of any start can move; the text is the remedy."""
