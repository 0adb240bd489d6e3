"""Which evidence decides: the image's own edges where they are clear along the whole boundary, else the learned prior."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ffseg.geometry.freeform import FreeForm
from ffseg.image.edges import GRADIENT_SCALE, EdgeMap, Scene
from ffseg.image.raster import rasterize
from ffseg.methods.base import BlockedStartError, Outcome, Segmenter, View
from ffseg.parameters import Parameters
from ffseg.starts.given import circle_start
from ffseg.starts.sides import on_one_side

CLEAR_SHARE = 0.1
"""So much of a boundary may be fainter: corners and crossings, where no gradient has one direction."""

CLEAR = 2.5
"""Edges are clear that have this many times the strength an edge needs: on drawn scenes the faint tenth has 2.7 to 40
times, on photographs, from whatever start, 0.6 to 2.33 (all but one of 47, whose contour is right)."""

PLAIN_FAINTEST, PLAIN = 1.25, 0.6
"""In strong noise the edges of a plain region are clear enough at 1.25 times (all but a twentieth): plain is a region
where nine tenths of the gradients are below 0.6 times what an edge needs, as noise alone gives (0.46)."""

MARGIN = 3
"""Pixels from the border of the image or the domain within which no edge is looked for."""

PROMISING = 0.6
"""Share of an image's edge pixels that are clear: above 0.77 in drawn scenes, in most photographs below 0.6."""

PROBE, MET = 40, 0.5
"""Iterations after which the edges that a front has met show how the others will be, and the strength from which on an
edge is taken to be met."""

SAMPLE = 4
"""Every fourth pixel each way shows how plain a region is."""


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """What a method found on the evidence that was chosen.

    Attributes
    ----------
    outcome : Outcome
    edges : EdgeMap
        What it was found on.
    source : str
        ``gradient`` or ``prior``; empty where nothing was chosen.
    score : float
        How sure it is, from 0 to 1: the share of the boundary on clear edges, or the expected overlap.
    edges_ms, evolve_ms : float
    messages : tuple of str
        About start circles that lay across one of these edges.
    """

    outcome: Outcome
    edges: EdgeMap
    source: str
    score: float
    edges_ms: float
    evolve_ms: float
    messages: tuple[str, ...] = ()


def decide(run: Segmenter, view: View) -> Decision:
    """Run a method on the image's own edges, and again on the learned evidence if they are not clear.

    Parameters
    ----------
    run : Segmenter
    view : View
        Its edges are the image's own; thresholds that are given in ``edges.canny`` are trusted as they are.

    Raises
    ------
    BlockedStartError
        If the start is blocked on both.

    Notes
    -----
    A callback hears of the evolution that counts only.
    """
    if view.params.edges.canny != "auto":
        return replace(trusted(run, view), source="gradient")
    begin = perf_counter()
    own, told = on_one_side(view)  # the prior holds the start to be inside, whatever the image's own edges are
    quiet = own if own.callback is None else replace(own, callback=None)
    first = _first(run, quiet) if _is_promising(run, quiet) else None
    across = MET if _ends_in_open_ground(view.params) else 0.0
    if first is not None and (boundary := Boundary(first.contours, view.edges)).is_clear(across):
        if view.callback is not None:
            first = run(own)
        evolve_ms = (perf_counter() - begin) * 1e3
        return Decision(first, view.edges, "gradient", boundary.clear_share(), 0.0, evolve_ms, told)
    from ffseg.evidence.prior import with_prior  # loads the forest, which clear edges do not need

    starts = view.start_region()
    if view.domain is not None:
        starts &= view.domain > 0
    edges, evidence = with_prior(Scene(view.image, starts, view.params, view.domain), view.edges)
    known = perf_counter()
    more = () if evidence is None else _islands(evidence.odds, starts, view)
    outcome = run(replace(view, edges=edges, starts=(*view.starts, *more)))
    end = perf_counter()
    if evidence is None:
        return Decision(outcome, edges, "prior", 0.0, (known - begin) * 1e3, (end - known) * 1e3)
    mask = outcome.mask
    if mask is None:
        mask = rasterize(outcome.contours or (), edges.gradient.shape)
        outcome = replace(outcome, mask=mask)  # the caller needs it as well
    score = evidence.expected_overlap(mask)
    return Decision(outcome, edges, "prior", score, (known - begin) * 1e3, (end - known) * 1e3)


def _islands(odds: NDArray[np.float32], starts: NDArray[np.bool_], view: View) -> tuple[FreeForm, ...]:
    """Starts in the parts of the region that lie apart from the one round the starts."""
    params = view.params
    if not params.region.islands or params.contour.clearance > 0 or params.contour.balloon < 0:
        return ()
    from ffseg.starts.islands import islands

    allowed = odds if view.domain is None else np.where(view.domain > 0, odds, np.float32(-1))
    return tuple(circle_start(circle, params) for circle in islands(allowed, starts, params.init.radius))


def trusted(run: Segmenter, view: View) -> Decision:
    """What a method finds on edges that are not doubted."""
    begin = perf_counter()
    own, told = on_one_side(view)
    outcome = run(own)
    evolve_ms = (perf_counter() - begin) * 1e3
    return Decision(outcome, view.edges, "", Boundary(outcome.contours, view.edges).clear_share(), 0.0, evolve_ms, told)


def _ends_in_open_ground(params: Parameters) -> bool:
    """Whether parts of a boundary lie on no edge though nothing leaks: at shut passages, and in a snake's slits."""
    return params.contour.clearance > 0 or params.method == "snake"


def _first(run: Segmenter, view: View) -> Outcome | None:
    """What the method finds on the image's own edges; None where it cannot start, or does not tell contours."""
    try:
        found = run(view)
    except BlockedStartError:
        return None
    return found if found.contours is not None else None


def _is_promising(run: Segmenter, view: View) -> bool:
    """Whether the image's own edges are worth a whole evolution: most are clear, or those that a short one has met."""
    edges = view.edges.edges[::SAMPLE] > 0
    clear = view.edges.gradient[::SAMPLE][edges] >= CLEAR * _needed(view.edges)
    if np.count_nonzero(clear) >= PROMISING * len(clear):
        return True
    short = replace(view.params, contour=replace(view.params.contour, max_iterations=PROBE))
    met = _first(run, replace(view, params=short))
    return met is not None and Boundary(met.contours, view.edges).is_clear(MET)


class Boundary:
    """How clear the image's own edges are along what a method found.

    Parameters
    ----------
    contours : tuple of FreeForm, or None
    edges : EdgeMap
    """

    def __init__(self, contours: tuple[FreeForm, ...] | None, edges: EdgeMap) -> None:
        self._contours, self._edges = contours or (), edges
        self._strength = _strength(self._contours, edges)

    def is_clear(self, least: float = 0.0) -> bool:
        """Whether it stands on edges that nobody would doubt.

        Parameters
        ----------
        least : float
            Parts on less than this strength are left out: a front that still moves.

        Returns
        -------
        bool
            True also where no part lies inside the image and the domain: there is nothing to doubt.
        """
        fainter = np.sort(self._strength[self._strength >= least])
        if len(fainter) == 0 or fainter[int(CLEAR_SHARE * len(fainter))] >= CLEAR:
            return True
        return bool(fainter[int(CLEAR_SHARE / 2 * len(fainter))] >= PLAIN_FAINTEST) and self._is_plain

    def clear_share(self) -> float:
        """Share on clear edges, shared with one sample that is not; round a plain region less is clear."""
        clear = np.count_nonzero(self._strength >= CLEAR)
        if clear < (1 - CLEAR_SHARE) * len(self._strength) and self._is_plain:
            clear = np.count_nonzero(self._strength >= PLAIN_FAINTEST)
        return float((clear + 1) / (len(self._strength) + 1))

    @cached_property
    def _is_plain(self) -> bool:
        inside = rasterize(self._contours, self._edges.gradient.shape)[::SAMPLE, ::SAMPLE]
        levels = self._edges.gradient[::SAMPLE, ::SAMPLE][inside]
        return len(levels) > 0 and float(np.quantile(levels, 0.9)) <= PLAIN * _needed(self._edges)


def _needed(edges: EdgeMap) -> float:
    """The high threshold in units of the stored gradient."""
    return max(edges.thresholds[1] * GRADIENT_SCALE, 1.0)


def _strength(contours: tuple[FreeForm, ...], edges: EdgeMap) -> NDArray[np.float64]:
    """Gradients at the joints of the contours, in high thresholds; the largest of nine pixels.

    Joints within `MARGIN` pixels of the border of the image or the domain are left out.
    """
    height, width = edges.gradient.shape
    if not contours or min(height, width) <= 2 * MARGIN:
        return np.empty(0)
    joints = np.rint(np.concatenate([c.control_points[:: c.degree] for c in contours])).astype(np.intp)
    x, y = joints[(joints >= MARGIN).all(axis=1) & (joints < np.array([width, height]) - MARGIN).all(axis=1)].T
    if edges.domain is not None:
        free = np.ones(len(x), np.bool_)
        for dx in (-MARGIN, 0, MARGIN):
            for dy in (-MARGIN, 0, MARGIN):
                free &= edges.domain[y + dy, x + dx] > 0
        x, y = x[free], y[free]
    around = np.add.outer(np.arange(-1, 2) * width, np.arange(-1, 2)).reshape(9, 1)
    largest = np.take(edges.gradient, y * width + x + around).max(axis=0)
    found: NDArray[np.float64] = largest / _needed(edges)
    return found
