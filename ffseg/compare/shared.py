"""Inputs shared by all methods of a comparison: one edge map, and starts that none of them has to move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter

from ffseg import pipeline
from ffseg.contour import trial_result
from ffseg.errors import FfsegError
from ffseg.image.edges import EdgeMap
from ffseg.parameters import Parameters
from ffseg.plugins import method
from ffseg.scene import Scene
from ffseg.starts.moved import as_circle

REFERENCE = "freeform"
"""The method for which ``auto`` decides and starts are moved: the one that is compared with the others."""


@dataclass(frozen=True, slots=True, eq=False)
class SharedInput:
    """What all methods are given on an image.

    Attributes
    ----------
    params : Parameters
        With the start circles that were moved, if they were.
    edges : EdgeMap
        Bounded by the domain.
    moved : bool
        Whether the starts are not those that were asked for.
    """

    params: Parameters
    edges: EdgeMap
    edges_ms: float
    moved: bool

    def scene(self, scene: Scene) -> Scene:
        """A method's scene with it."""
        params = replace(scene.params, init=self.params.init)
        start_mask = None if self.moved else scene.start_mask  # whose place the circles take
        return replace(scene, params=params, edges=self.edges, edges_given=True, start_mask=start_mask)


def common_source(params: Parameters, methods: Sequence[str]) -> str:
    """Evidence source of all: ``auto`` is what every method may see, the image's own edges if one sees nothing learned."""
    sources = (method(name).source for name in methods)
    return next(filter(None, sources), "auto") if params.edges.source == "auto" else params.edges.source


def shared_input(scene: Scene, methods: Sequence[str]) -> SharedInput | None:
    """Edge map and starts of a scene; None where there are none, as each method then says for itself."""
    params = scene.params
    edges = replace(params.edges, source=common_source(params, methods))
    try:
        prepared = pipeline.with_method(replace(scene, params=replace(params, edges=edges), method=method(REFERENCE)))
        prepared = pipeline.with_domain(pipeline.with_starts(prepared))
        begin = perf_counter()
        with_edges = pipeline.with_evidence(prepared)
        edges_ms = (perf_counter() - begin) * 1e3
        found = pipeline.contour_of(with_edges)
    except (FfsegError, MemoryError):
        return None
    if found is trial_result(with_edges.edges):
        edges_ms -= found.evolve_ms
    if was_moved(found.messages):
        circles = (as_circle(start) for start in found.scene.starts[: len(prepared.starts)])
        init = replace(
            params.init, center="auto", boxes=(), circles=tuple((one.x, one.y, one.radius) for one in circles)
        )
        params = replace(params, init=init)
    bounded = with_edges.edges
    if bounded.domain is None:
        bounded = replace(bounded, domain=with_edges.limits)
    return SharedInput(params, bounded, edges_ms, was_moved(found.messages))


def was_moved(messages: Sequence[str]) -> bool:
    """Whether a result's messages say that its start was moved, or taken for a click."""
    return any(said in text for text in messages for said in ("was moved to", "was taken for a click"))
