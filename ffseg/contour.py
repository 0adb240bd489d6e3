"""The contour of a scene with known edges: bounded by the domain, started in free places, evolved by the method."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import compress
from operator import attrgetter, is_
from time import perf_counter

import numpy as np

from ffseg.arrays import Mask
from ffseg.errors import ParameterError, SegmentationError
from ffseg.geometry.freeform import FreeForm
from ffseg.image.boundary import Boundary
from ffseg.image.checked import refuse_masked
from ffseg.image.edges import EdgeMap
from ffseg.image.raster import rasterize
from ffseg.plugins import method as chosen
from ffseg.scene import BlockedStartError, Outcome, Scene
from ffseg.starts.initial import starts_from_mask
from ffseg.starts.moved import as_circle
from ffseg.starts.parts import further_starts, with_parts
from ffseg.starts.rivals import add_disc, before_rivals, rivals_of
from ffseg.starts.sides import click_in_parted, on_one_side

_known = attrgetter(*(one.name for one in fields(EdgeMap) if one.name != "trial"))


@dataclass(frozen=True, slots=True, eq=False)
class ContourResult:
    """The outcome of a method, with the scene that it was applied to.

    Attributes
    ----------
    scene : Scene
        What it was asked of: with its bounds, and the starts where they were in the end.
    messages : tuple of str
        About starts that could not stay where they were asked for.
    evolve_ms : float
        Wall time of placing the starts and of the method.
    across : bool
        Whether a start lies on both sides of an edge.
    boundary : Boundary, optional
        How clear the edges are along the contours, where that has been measured.
    """

    scene: Scene
    outcome: Outcome
    messages: tuple[str, ...]
    evolve_ms: float
    across: bool = False
    boundary: Boundary | None = None

    def boundary_of(self, contours: tuple[FreeForm, ...]) -> Boundary:
        """How clear the edges are along these contours: measured already if they are the method's own."""
        if self.boundary is not None and contours == self.outcome.contours:
            return self.boundary
        return Boundary(contours, self.scene.edges, self.scene.covered)

    def region(self) -> Mask:
        """Pixels that the contours hold."""
        if self.boundary is not None:
            return self.boundary.region
        return rasterize(self.outcome.contours or (), self.scene.shape)


def trial_result(edges: EdgeMap) -> ContourResult | None:
    """The trial contour that the evidence source has already evolved on this edge map; None if the map was changed since."""
    tried_on, found = edges.trial or (edges, None)
    return found if all(map(is_, _known(tried_on), _known(edges))) else None


def tried(found: ContourResult, said: str = "") -> EdgeMap:
    """The map that a contour was asked for on, with that contour and what to say of its start."""
    edges = found.scene.edges
    return replace(edges, trial=(edges, replace(found, messages=(said, *found.messages)) if said else found))


def contour(scene: Scene) -> ContourResult:
    """Evolve the contour of a scene with its method.

    Raises
    ------
    SegmentationError
        If no start can move and there is no free place for one, or the method says so.
    """
    if scene.boxes:
        from ffseg.starts.boxes import in_boxes  # loads what only this needs

        scene = in_boxes(scene, scene.edges.odds)
    scene = bounded(scene)
    if scene.boxes and scene.domain is not None and not scene.domain.any():
        raise SegmentationError(
            "no pixel of the image lies in the domain and in a box; move the box, or change the domain"
        )
    begin = perf_counter()
    rivals = rivals_of(scene) if scene.has_rivals else None
    click = click_in_parted(scene) if scene.edges.source in ("model", "evidence") else None
    scene, said = click or (scene, "")
    free, messages, across = on_one_side(scene)
    messages = (said, *messages) if said else messages
    before, free = free, with_parts(free)
    if scene.params.init.center != "auto" or scene.params.init.circles:
        gone = (as_circle(one).enlarged(scene.factor) for one in before.starts if one not in free.starts)
        messages += tuple(f"the start at {one} lies in no part that is told, and was left out" for one in gone)
    beyond = further_starts(free)  # of what lies on the starts' side
    free = apart(replace(free, starts=(*free.starts, *beyond)))
    try:
        free, outcome = without_rivals(free, rivals)
    except BlockedStartError as blocked:
        from ffseg.starts.moved import moved_starts  # loads what only this needs

        free, sentence = moved_starts(replace(scene, starts=(*scene.starts, *beyond)), str(blocked))
        try:
            free, outcome = without_rivals(apart(free), rivals)
        except BlockedStartError as still:
            raise SegmentationError(f"{sentence}, where it cannot move either; {still}") from still
        messages, across = (sentence,), False
    return ContourResult(free, outcome, messages, (perf_counter() - begin) * 1e3, across)


def apart(scene: Scene) -> Scene:
    """The scene with the outlines of what they cover in place of start circles that overlap.

    Two contours would cover one region, each across the other, and those that edges hold would never part.
    """
    boxes = scene.boxes and scene.params.contour.balloon < 0  # what closes in begins at these themselves
    if len(scene.starts) < 2 or scene.start_mask is not None or boxes:
        return scene
    circles = [as_circle(one) for one in scene.starts]
    x, y, radii = np.array([(one.x, one.y, one.radius) for one in circles]).T
    meets = np.hypot(x[:, None] - x, y[:, None] - y) < radii[:, None] + radii
    alone = np.count_nonzero(meets, axis=0) == 1  # each meets itself
    if alone.all():
        return scene
    covered = np.zeros(scene.shape, np.bool_)
    for one in compress(circles, ~alone):
        add_disc(covered, one.x, one.y, max(one.radius, 1.0))  # at least the nearest pixel
    joined = starts_from_mask(covered.view(np.uint8), scene.params)
    return replace(scene, starts=(*compress(scene.starts, alone), *joined))


def bounded(scene: Scene) -> Scene:
    """The scene with its edge map limited to the domain and the valid disc."""
    edges, domain = scene.edges, scene.domain
    if edges.domain is None:
        edges = edges if scene.limits is None else replace(edges, domain=scene.limits)
    elif domain is not None and edges.domain is not domain:
        edges = replace(edges, domain=np.where(edges.domain > 0, domain, np.uint8(0)))
    return (
        scene if edges is scene.edges and edges.domain is domain else replace(scene, edges=edges, domain=edges.domain)
    )


def without_rivals(scene: Scene, rivals: Mask | None) -> tuple[Scene, Outcome]:
    """What the method finds; where it holds rivals, its domain ends where their fronts meet those of the starts.

    Rivals that the contour leaves out by itself change nothing.
    """
    if rivals is None:
        return scene, run(scene)
    found = run(replace(scene, callback=None))
    region = rasterize(found.contours or (), scene.shape) if found.mask is None else found.mask
    if (region & rivals).any():
        scene = before_rivals(scene, region, rivals)
    elif scene.callback is None:
        return scene, found
    return scene, run(scene)


def run(scene: Scene) -> Outcome:
    """Apply the method of a scene to it, unchanged.

    Raises
    ------
    ParameterError
        If it gives no `Outcome`, or a mask that is none of this image.
    """
    method = scene.method or chosen(scene.params.method)
    found, sentence = method.loaded()(scene), f"method: {method.name} returned"
    if not isinstance(found, Outcome):
        raise ParameterError(f"{sentence} {type(found).__name__}; it must return an ffseg.Outcome")
    mask: object = found.mask
    if mask is None:
        return found
    if not isinstance(mask, np.ndarray) or mask.dtype not in (np.bool_, np.uint8) or mask.shape != scene.shape:
        what = f"{mask.dtype} of shape {mask.shape}" if isinstance(mask, np.ndarray) else type(mask).__name__
        raise ParameterError(
            f"{sentence} a mask of {what}; it must be of bool or uint8 and of the image's shape {scene.shape}"
        )
    refuse_masked("mask", mask)
    return replace(found, mask=mask > 0)  # a copy: the method may use its own again
