"""The method exactly as printed, Algorithms 1 to 4 only, for comparison with ``freeform``."""

from __future__ import annotations

from ffseg.geometry.ragged import packed, unpacked
from ffseg.methods.effort import budget, evolve, iterations, stats_of
from ffseg.native import _core
from ffseg.scene import Outcome, Progress, Scene

WORK = 16
"""Patches moved to a pixel of the domain, at most; 64 tests of two patches count as one. Measured: at most 8 on drawn scenes
and photographs, where it comes to rest."""


def run(scene: Scene) -> Outcome:
    """Evolve the start contours by Algorithm 4.

    Parameters
    ----------
    scene : Scene
        Of its parameters ``contour`` is used but for ``clearance`` and ``settle``, ``edges.exponent`` and ``.sigma``,
        and ``paper``. A negative ``contour.balloon`` closes in.

    Returns
    -------
    Outcome

    Notes
    -----
    In every iteration long patches are split (Algorithm 2) and short ones joined (the footnote on pruning), patches that
    meet are flipped (Algorithm 3, in the order that connects), and the samples of every patch move along their normals:
    in even areas by ``balloon * F_diff`` (Eq. 8), round an edge up the slope of the edge force. It ends when
    at most one sample in a hundred moves by a tenth of a pixel. What the paper leaves open is listed in docs/method.md.
    """
    evolution = _evolution(scene)

    def current() -> Progress:
        points, offsets = evolution.contours()
        contours = unpacked(points, offsets, scene.params.contour.degree)
        return Progress(evolution.counts()["iterations"], contours)

    evolve(evolution.advance, scene, current)
    last = current()
    if scene.callback is not None:
        scene.callback(last)
    return Outcome(last.contours, stats_of(evolution, scene.starts, last.contours))


def _evolution(scene: Scene) -> _core.PaperEvolution:
    edges, params, options = scene.edges, scene.params, _core.PaperOptions()
    options.degree = params.contour.degree
    options.split_threshold = params.contour.split_threshold
    most = params.paper.balloon
    options.balloon = min(max(params.contour.balloon, -most), most)
    options.refine = params.contour.refine
    options.topology = params.contour.topology
    options.max_iterations, options.budget = iterations(params), budget(scene, WORK)
    options.exponent = params.edges.exponent
    options.sigma = params.edges.sigma
    return _core.PaperEvolution(*packed(scene.starts), edges.gradient, edges.edges, edges.domain, options)
