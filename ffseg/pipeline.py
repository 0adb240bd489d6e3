"""The one function that runs any method: edge map, start contours, the method, mask."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ffseg.camera.footprint import Footprint
from ffseg.errors import ParameterError, SegmentationError
from ffseg.evidence.auto import Decision, decide, trusted
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import unpacked
from ffseg.image.checked import checked_image
from ffseg.image.disc import valid_disc
from ffseg.image.edges import EdgeMap, Scene, edges_from_source, source_of
from ffseg.image.raster import rasterize
from ffseg.methods.base import (
    BlockedStartError,
    Outcome,
    Progress,
    Segmentation,
    Segmenter,
    Timings,
    View,
    check_sides,
)  # fmt: skip
from ffseg.native import _core
from ffseg.parameters import Parameters
from ffseg.plugins import METHODS, Method, load
from ffseg.starts.given import circle_start, start_contours

TELLING = ("evidence", "model")
"""Sources that tell what is inside, whatever the image's own edges are."""

GROWING = ("freeform", "levelset")
"""Methods that take several starts and merge what grows from them."""


def segmenter(name: str) -> Segmenter:
    """The method of that name, or the function that ``module:function`` names.

    Raises
    ------
    ParameterError
        If there is none.
    SegmentationError
        If its package is not installed.
    """
    if name not in METHODS and ":" not in name:
        raise ParameterError(f"method: there is no segmenter '{name}'; choose one of {', '.join(METHODS)}")
    row = METHODS.get(name, Method(name))
    if not row.installed:
        raise SegmentationError(f"method {name} needs the package {row.package}; install it, or ffseg[peers]")
    if row.module:
        load(f"{row.module}:__name__")  # its loading is not its time
    try:
        found: Segmenter = load(row.home)
    except ValueError as error:
        raise ParameterError(f"method: {error}") from error
    if not callable(found):
        raise ParameterError(f"method: {name} is no function; name one that takes a view")
    return found


def segment(  # noqa: PLR0913 - everything that is particular to one image has its name here
    image: NDArray[np.uint8],
    params: Parameters,
    method: str | Segmenter | None = None,
    *,
    edges: EdgeMap | None = None,
    domain: NDArray[np.uint8] | None = None,
    start_mask: NDArray[np.uint8] | None = None,
    background: NDArray[np.uint8] | None = None,
    evidence: NDArray[np.float32] | None = None,
    center: tuple[float, float] | None = None,
    altitudes: NDArray[np.float64] | None = None,
    footprint: Footprint | None = None,
    options: object = None,
    callback: Callable[[Progress], None] | None = None,
) -> Segmentation:
    """Segment one image: edge map, start contours, evolution, mask.

    As `ffseg.segment`, whose parameters these are, of a parameter set and of arrays that need no check: masks of uint8,
    evidence from 0 to 1. It reads no file: without a domain the contour may go everywhere, and so on.

    Raises
    ------
    SegmentationError
        If the image cannot be segmented as asked.
    ParameterError
        If there is no such method.
    """
    name = method or params.method
    shape = _checked_shape(image, domain)
    if name in METHODS and METHODS[str(name)].module and options is None:
        from ffseg.methods.peers import configured

        params, options = configured(params, str(name))
    run = segmenter(name) if isinstance(name, str) else name
    if isinstance(name, str) and name != params.method:
        params = replace(params, method=name)  # what is asked of the view's parameters is true of the method
    if params.edges.model is not None and start_mask is None and center is None:
        from ffseg.evidence.source import with_model_start

        params = with_model_start(image, params)
    starts = start_contours(shape, params, start_mask, center)
    begin = perf_counter()
    source = _source(params, edges, evidence)
    if edges is None:
        edges = edges_of(image, starts, params, domain, evidence)
        if name in GROWING and edges.walled:
            starts = (*starts, *_parts(edges, starts, params))
    elif domain is not None and edges.domain is not domain:
        edges = _within(edges, domain)
    edges = _bounded(edges, starts, params, background)
    edges_ms = (perf_counter() - begin) * 1e3
    fixed = center is not None and params.init.center == "auto"
    view = View(image, edges, starts, params, options, _rows(altitudes), callback, fixed=fixed, footprint=footprint)
    unheard = _unheard(source, edges, params)
    found, messages = _freed(decide if source == "auto" else trusted, run, view)
    begin = perf_counter()
    outcome = found.outcome
    mask = outcome.mask if outcome.mask is not None else rasterize(outcome.contours or (), shape)
    rasterized_ms = (perf_counter() - begin) * 1e3
    contours, mask = _both(outcome, mask, edges.domain)
    counted = name not in METHODS or METHODS[str(name)].uses_edges
    edges_ms = edges_ms + found.edges_ms if counted else 0.0
    timings = Timings(edges_ms, found.evolve_ms, edges_ms + found.evolve_ms + rasterized_ms)
    used, thresholds = found.source or source, found.edges.thresholds
    return Segmentation(mask, contours, outcome.stats, timings, (*unheard, *messages), used, found.score, thresholds)


def _source(params: Parameters, edges: EdgeMap | None, evidence: NDArray[np.float32] | None) -> str:
    """Where edges come from: the caller's own, else the map that came with the image, else what is asked for."""
    if edges is not None:
        return "given"
    return source_of(params) if evidence is None else "evidence"


def edges_of(
    image: NDArray[np.uint8],
    starts: tuple[FreeForm, ...],
    params: Parameters,
    domain: NDArray[np.uint8] | None = None,
    evidence: NDArray[np.float32] | None = None,
) -> EdgeMap:
    """The edge map that `segment` makes; what else is given to it has the same names."""
    shape = (image.shape[0], image.shape[1])
    region = None if _source(params, None, evidence) in ("auto", "gradient") else rasterize(starts, shape)
    edges = edges_from_source(Scene(image, region, params, domain, evidence))
    if edges.domain is None:  # bounds the contour only: thresholds stay those of the image
        edges = replace(edges, domain=_disc(image, starts, params))
    return edges


def _disc(image: NDArray[np.uint8], starts: tuple[FreeForm, ...], params: Parameters) -> NDArray[np.uint8] | None:
    """The valid disc of a mirror or fisheye as the domain, if the image has one and every start lies in it."""
    if params.domain.disc == "off":
        return None
    found = valid_disc(image)
    if found is None or not all(found.holds(start.control_points.mean(axis=0)) for start in starts):
        return None
    return found.mask((image.shape[0], image.shape[1]))


def _unheard(source: str, edges: EdgeMap, params: Parameters) -> tuple[str, ...]:
    """What to say where a map or a model tells of no region, so that the image's own edges decide."""
    if source not in TELLING or params.edges.evidence == "edges" or edges.walled:
        return ()
    who = "the map of evidence" if source == "evidence" else "the model"
    level = f"the probability {params.region.probability:g} at which the region ends"
    return (f"{who} nowhere crosses {level}: the image's own edges decide",)


def _within(edges: EdgeMap, domain: NDArray[np.uint8]) -> EdgeMap:
    """An edge map of the caller's with a domain, beside its own if it has one."""
    return replace(edges, domain=domain if edges.domain is None else np.where(edges.domain > 0, domain, np.uint8(0)))


def _parts(edges: EdgeMap, starts: tuple[FreeForm, ...], params: Parameters) -> tuple[FreeForm, ...]:
    """Starts in the parts of what a map of evidence walls in that the contour cannot reach through narrow places."""
    if params.contour.clearance > 0 or params.contour.balloon < 0 or not params.contour.topology:
        return ()
    from ffseg.starts.pockets import starts_beyond

    shape = edges.edges.shape
    walls = edges.edges if edges.domain is None else edges.edges | np.where(edges.domain > 0, np.uint8(0), np.uint8(1))
    circles = starts_beyond(walls, rasterize(starts, shape), params.init.radius)
    return tuple(circle_start(circle, params) for circle in circles)


def _bounded(
    edges: EdgeMap, starts: tuple[FreeForm, ...], params: Parameters, background: NDArray[np.uint8] | None
) -> EdgeMap:
    """The edge map bounded by what grows from outside the region, where anything does."""
    if background is None and not params.init.background and params.region.border == "free":
        return edges
    from ffseg.starts.rivals import bounded  # loads what only this needs

    return bounded(edges, rasterize(starts, edges.gradient.shape), params, background)


def _freed(
    deciding: Callable[[Segmenter, View], Decision], run: Segmenter, view: View
) -> tuple[Decision, tuple[str, ...]]:
    """What a method finds, from starts that are moved if none of them can."""
    try:
        found = deciding(run, view)
        return found, found.messages
    except BlockedStartError as blocked:
        remedy = str(blocked)
    from ffseg.starts.moved import freed  # loads what only this needs

    moved, told = freed(view, remedy)
    found = deciding(run, moved)
    return found, (told, *found.messages)


def outlines_of(mask: NDArray[np.bool_]) -> tuple[FreeForm, ...]:
    """Contours of degree 1 half-way between pixels inside and outside; they rasterise to the mask exactly."""
    points, ends = _core.mask_outlines(np.ascontiguousarray(mask).view(np.uint8))
    return unpacked(points.reshape(-1, 2), ends, 1)


def _both(
    outcome: Outcome, mask: NDArray[np.bool_], domain: NDArray[np.uint8] | None
) -> tuple[tuple[FreeForm, ...], NDArray[np.bool_]]:
    """Contours and mask; a method that returns a mask only has it cut to the domain and its outlines traced."""
    if outcome.contours is not None:
        return outcome.contours, mask
    inside = mask if domain is None else mask & (domain > 0)
    return outlines_of(inside), inside


def _rows(altitudes: NDArray[np.float64] | None) -> NDArray[np.float64]:
    return np.empty((0, 4)) if altitudes is None else altitudes


def _checked_shape(image: NDArray[np.uint8], domain: NDArray[np.uint8] | None) -> tuple[int, int]:
    check_sides(checked_image(image).shape)
    shape = (image.shape[0], image.shape[1])
    if domain is not None and domain.shape != shape:
        raise SegmentationError(
            f"the domain has {domain.shape[1]} x {domain.shape[0]} pixels, the image {shape[1]} x {shape[0]}; "
            "domain.mask must have the image's size"
        )
    return shape
