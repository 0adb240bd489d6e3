"""How long an evolution runs: ``contour.max_iterations``, and a budget of work per pixel."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ffseg.geometry.freeform import FreeForm
from ffseg.native import _core
from ffseg.parameters import Parameters
from ffseg.scene import Progress, Scene, Stats

UNLIMITED = 2**31 - 2
"""Iterations no evolution comes to before its budget is spent."""
MIN_BUDGET = 10_000
"""Work in the smallest image: some hundred iterations of the patches of a start."""


def iterations(params: Parameters) -> int:
    """Largest number of iterations; ``auto`` leaves the limit to the budget."""
    most = params.contour.max_iterations
    return UNLIMITED if most == "auto" else most


def budget(scene: Scene, to_pixel: int) -> int:
    """Largest amount of work: so much per pixel of the domain, and the minimum that the smallest image needs."""
    domain = scene.edges.domain
    pixels = scene.edges.edges.size if domain is None else int(np.count_nonzero(domain))
    return MIN_BUDGET + to_pixel * pixels


def evolve(advance: Callable[[int], bool], scene: Scene, now: Callable[[], Progress]) -> None:
    """Advance an evolution until it ends; the scene's callback is called at the start and at intervals."""
    if scene.callback is None:
        advance(UNLIMITED + 1)
        return
    scene.callback(Progress(0, scene.starts))
    while advance(scene.every):
        scene.callback(now())


def stats_of(
    evolution: _core.Evolution | _core.PaperEvolution, starts: tuple[FreeForm, ...], contours: tuple[FreeForm, ...]
) -> Stats:
    """Counts of an evolution of patches."""
    counts = evolution.counts()
    return Stats(
        **{name: counts[name] for name in ("iterations", "splits", "prunes", "flips", "merges")},
        initial_points=sum(len(c.control_points) for c in starts),
        final_points=sum(len(c.control_points) for c in contours),
        patches=sum(c.num_patches for c in contours),
        stop_reason=evolution.stop_reason,
    )
