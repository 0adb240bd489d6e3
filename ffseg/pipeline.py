"""What happens to an image, step by step: `segment` is the table of contents, docs/pipeline.md the book."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from ffseg.arrays import Mask
from ffseg.contour import ContourResult, contour, run, trial_result
from ffseg.enlargement import before_enlargement, enlarged
from ffseg.errors import ParameterError
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import unpacked
from ffseg.image.checked import checked_image, require_size
from ffseg.image.disc import valid_disc
from ffseg.image.edges import EdgeMap, require_edges
from ffseg.image.free import distances
from ffseg.image.raster import rasterize
from ffseg.image.selection import is_shown, selected
from ffseg.judge import judge_region
from ffseg.native import _core
from ffseg.plugins import EDGE_SOURCES, find, method
from ffseg.result import Segmentation, Timings
from ffseg.scene import NothingThereError, Scene, Stats, check_sides
from ffseg.starts.initial import check_background, circles_beside, start_contours
from ffseg.starts.moved import as_circle

SETTLING_TOLERANCE = 2
"""Pixels by which a contour that settles on edges may pass the limit of the domain."""


def segment(scene: Scene) -> Segmentation:
    """Segment one image: from what is given to the region, a step a line.

    Parameters
    ----------
    scene : Scene
        An image and its parameters, with what else is known; it needs no check but of the image.

    Raises
    ------
    SegmentationError
        If the image cannot be segmented as asked.
    ParameterError
        If there is no such method or evidence source.
    """
    try:
        return _segmented(scene)
    except NothingThereError as nothing:
        mask, timings = np.zeros(scene.shape, np.bool_), Timings(0.0, 0.0, 0.0)
        return Segmentation(mask, (), Stats(), timings, (str(nothing),), "model", 0.0, doubts=("empty",))


def _segmented(scene: Scene) -> Segmentation:
    """All steps, where a model does not say at one of them that there is nothing."""
    scene = with_method(scene)  # what runs, with its own parameters
    scene = with_starts(scene)  # where contours start
    shape, scene = scene.shape, before_enlargement(scene)  # at the size that the picture once had
    scene = with_domain(scene)  # where they may go
    begin = perf_counter()
    scene = with_evidence(scene)  # what stops them
    known = perf_counter()
    found = contour_of(scene)  # what the method finds
    contours, mask = region(found)  # curves and pixels of the same region
    lost = left_out(scene, found, mask)  # what of the starts it lacks
    contours, mask = selected(contours, mask, scene.params.region)  # which parts and holes are kept
    end = perf_counter()
    score, doubts = judge_region(scene, found, contours, mask)  # how sure it is, and why not
    if scene.factor > 1:
        contours = enlarged(contours, scene.factor)  # and back to the size it has
        mask = rasterize(contours, shape)
    timings = _timings(scene, found, known - begin, end - begin)
    thresholds = found.scene.edges.thresholds
    said = (*unfound_start(scene), *fallback_messages(scene), *found.messages)
    messages = (*lost, *said, *(one.message for one in doubts if one.message))
    names, source = tuple(doubt.name for doubt in doubts), decided_by(scene)
    return Segmentation(mask, contours, found.outcome.stats, timings, messages, source, score, thresholds, names)


def with_method(scene: Scene) -> Scene:
    """The scene with the row of its method; a peer that comes without them gets its own parameters.

    Raises
    ------
    SegmentationError
        If the image is none, its domain has another size, or the package of the method is not installed.
    ParameterError
        If there is no such method.
    """
    check_sides(checked_image(scene.image).shape)
    if scene.domain is not None:
        require_size("the domain", scene.domain, scene.shape, "domain.mask must have the image's size")
    row = scene.method or method(scene.params.method)
    row.loaded()
    params, options = scene.params, scene.options
    if row.module and options is None:
        from ffseg.methods.peers import method_parameters

        params, options = method_parameters(params, row.name)
    elif row is scene.method:
        return scene
    return replace(scene, method=row, params=params, options=options)


def with_starts(scene: Scene) -> Scene:
    """The scene with its start contours: those asked for, or the disc a model is surest of."""
    check_background(scene.shape, scene.params, scene.background)
    if scene.params.edges.model is not None:
        from ffseg.evidence.source import with_all_parts, with_model_start

        scene = with_all_parts(scene)
        scene = with_model_start(scene) if scene.start_mask is None and scene.center is None else scene
    starts = start_contours(scene.shape, scene.params, scene.start_mask, scene.center, scene.domain)
    return replace(scene, starts=starts)


def with_domain(scene: Scene) -> Scene:
    """The scene with what its boxes hold for a domain; else, where none is given, the valid disc of a mirror or fisheye.

    The disc counts only where every start lies in it. Boxes bound nothing where a circle lies in none: it may be to find a thing
    of its own, or what a box has cut off, or where they show what is to be found everywhere.
    """
    if scene.boxes and source_of(scene) != "alike" and not circles_beside(scene.params.init):
        from ffseg.starts.boxes import within_boxes  # loads what only this needs

        return within_boxes(scene)
    if scene.params.domain.disc == "off" or scene.domain is not None or scene.edges_given:
        return scene
    found = valid_disc(scene.image)
    if found is None or not all(found.holds(start.control_points.mean(axis=0)) for start in scene.starts):
        return scene
    return replace(scene, disc=found.mask(scene.shape))


def with_evidence(scene: Scene) -> Scene:
    """The scene with what stops a contour: the caller's edges, else those that the evidence source makes.

    Raises
    ------
    ParameterError
        If there is no such source, or it gives no edge map.
    SegmentationError
        If the map is none of this image.
    """
    if scene.edges_given:
        return scene
    name = source_of(scene)
    edges = find("evidence", name)(scene)
    if not isinstance(edges, EdgeMap):
        raise ParameterError(f"edges.source: {name} returned {type(edges).__name__}; it must return an ffseg.EdgeMap")
    if name not in EDGE_SOURCES:
        require_edges(edges, scene.shape)
    return replace(scene, edges=edges)


def source_of(scene: Scene) -> str:
    """Name of the evidence source: of the map that came with the image, of a model, else what is asked for."""
    edges = scene.params.edges
    if scene.evidence is not None:
        return "evidence"
    if edges.model is not None:
        return "model"
    if edges.source != "auto":
        return edges.source
    stands_for = scene.method.source if scene.method is not None else ""
    if stands_for or edges.canny != "auto":
        return stands_for or "auto"
    if scene.params.region.islands == "all":
        return "alike"
    return "box" if scene.boxes else "auto"


def contour_of(scene: Scene) -> ContourResult:
    """The contour of a scene; one that its evidence has asked for already is asked for again only to be watched."""
    trial = None if scene.edges_given else trial_result(scene.edges)
    if trial is None or scene.callback is None:
        return trial or contour(scene)
    return replace(trial, outcome=run(replace(trial.scene, callback=scene.callback, every=scene.every)))


def region(found: ContourResult) -> tuple[tuple[FreeForm, ...], Mask]:
    """Contours and mask; of a mask alone, and of what closes in from outside the domain, cut to it, outlines are traced."""
    outcome, scene = found.outcome, found.scene
    mask = outcome.mask
    if outcome.contours is not None:
        mask = found.region() if mask is None else mask
        if not _begins_outside(scene, mask):
            return outcome.contours, mask
    if mask is None:
        return (), np.zeros(scene.shape, np.bool_)
    inside = mask if scene.domain is None else mask & (scene.domain > 0)
    return outlines_of(inside), inside


def _begins_outside(scene: Scene, mask: Mask) -> bool:
    """Whether what closes in has something outside the domain, where it may begin and not move."""
    if scene.params.contour.balloon > 0 or scene.domain is None:
        return False
    return bool(mask[distances(scene.domain == 0) > SETTLING_TOLERANCE].any())


def outlines_of(mask: Mask) -> tuple[FreeForm, ...]:
    """Contours of degree 1 half-way between pixels inside and outside; they rasterise to the mask exactly."""
    points, ends = _core.mask_outlines(np.ascontiguousarray(mask).view(np.uint8))
    return unpacked(points.reshape(-1, 2), ends, 1)


def decided_by(scene: Scene) -> str:
    """Name of the evidence source that decided."""
    source = source_of(scene) if not scene.edges_given else "given"
    return scene.edges.source or source if source in EDGE_SOURCES else source


def unfound_start(scene: Scene) -> tuple[str, ...]:
    """What to say where no start is named and a model that may find one does not."""
    init = scene.params.init
    named = (
        init.center != "auto" or init.circles or init.boxes or scene.start_mask is not None or scene.center is not None
    )
    if named or scene.params.edges.model is None:
        return ()
    from ffseg.io.starts import finds_starts

    if not finds_starts(scene.params):
        return ()
    return ("the model finds no start: the contour begins in the middle of the image",)


def fallback_messages(scene: Scene) -> tuple[str, ...]:
    """What to say where a map or a model tells of no region, so that the image's own edges decide."""
    who = {
        "evidence": "the map of evidence",
        "model": "the model",
        "hints": "what is seen of the clicks",
        "box": "what is seen in the box",
        "alike": "what looks like the start",
    }.get(source_of(scene), "")
    if not who or scene.edges_given or scene.edges.source != "gradient" or scene.params.edges.evidence == "edges":
        return ()
    level = f"the probability {scene.params.region.probability:g} at which the region ends"
    return (f"{who} nowhere crosses {level}: the image's own edges decide",)


def left_out(scene: Scene, found: ContourResult, mask: Mask) -> tuple[str, ...]:
    """What to say of a start mask that lies in the domain for a part, and of starts that the method's region has lost."""
    messages: list[str] = []
    if scene.start_mask is not None and scene.domain is not None:
        inside = scene.domain[scene.start_mask > 0] > 0
        if inside.any() and not inside.all():
            messages.append("what the start mask has outside the domain was left out")
    if scene.params.contour.balloon > 0:
        starts = (one for one in found.scene.starts[: len(scene.starts)] if one.signed_area > 0)
        lost = (one for one in starts if not (_has_middle(one, mask) or is_shown(one, mask)))
        messages += (f"the start at {as_circle(one).enlarged(scene.factor)} is not in the region" for one in lost)
    return tuple(messages)


def _has_middle(start: FreeForm, mask: Mask) -> bool:
    """Whether a mask has the pixel nearest to the middle of a start: mostly it does, and that is known at once."""
    x, y = (start.control_points.sum(axis=0) / len(start.control_points)).tolist()
    return bool(mask[min(max(round(y), 0), mask.shape[0] - 1), min(max(round(x), 0), mask.shape[1] - 1)])


def _timings(scene: Scene, found: ContourResult, edges_s: float, total_s: float) -> Timings:
    """Milliseconds of the steps; a trial contour that counts was no part of the edge map."""
    evolve_ms, edges_ms, total_ms = found.evolve_ms, edges_s * 1e3, total_s * 1e3
    if found is trial_result(scene.edges):
        edges_ms -= evolve_ms
    if scene.method is None or scene.method.uses_edges:
        return Timings(edges_ms, evolve_ms, total_ms)
    return Timings(0.0, evolve_ms, total_ms - edges_ms)
