"""The source ``auto``: the image's own edges if they are clear along the whole boundary, else learned evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter
from time import perf_counter

import numpy as np

from ffseg.contour import ContourResult, bounded, contour, run, tried
from ffseg.evidence.gradient import gradient
from ffseg.image.boundary import CHECK_INTERVAL, Boundary, FaintError, unless_faint
from ffseg.image.components import filled
from ffseg.image.edges import EdgeMap
from ffseg.image.opencv_peers import dilated_by_disc
from ffseg.scene import BlockedStartError, Scene
from ffseg.starts.rivals import rivals_of
from ffseg.starts.sides import click_in_parted, on_one_side

MET_STRENGTH = 0.5
"""Edge strength from which on a point of the contour counts as lying on an edge."""


def auto(scene: Scene) -> EdgeMap:
    """The image's own edges, if a trial contour stops on clear ones all round; else those of the prior or clicks.

    Parameters
    ----------
    scene : Scene
        Thresholds that are given in ``edges.canny`` are trusted as they are.
    """
    edges = gradient(scene)
    if scene.params.edges.canny != "auto":
        return edges
    scene = replace(scene, edges=edges, callback=None)
    click, whole = click_in_parted(scene), (scene, "")
    looks = [whole] if click is None else [click, whole]
    for look, said in looks:
        found = _trial(look)
        if found is not None and not (_holds_rivals(found, scene) or _mends_a_rim(found, scene)):
            return tried(found, said)
    if scene.has_hints:
        from ffseg.evidence.clicks import with_clicks  # these load forests, which clear edges do not need

        return with_clicks(scene, edges)
    return _by_prior(looks[::-1], edges)


def prior_edges(scene: Scene) -> EdgeMap:
    """Edges where the prior falls to ``region.probability``: the source ``prior``."""
    return _by_prior([(scene, "")], gradient(scene))


def _by_prior(scenes: Sequence[tuple[Scene, str]], image_edges: EdgeMap) -> EdgeMap:
    """Edges by the prior from that of several starts of which it promises the largest overlap; the image's own if it sees none.

    What somebody has pointed at in the first of the scenes is looked at closer, too; of a start that is none that was asked for,
    the contour comes with the map, and with what to say.
    """
    from ffseg.evidence.maps import odds_edges
    from ffseg.evidence.prior import appearance_of, look_at

    (asked, _), *_ = scenes
    seen = appearance_of(asked)
    looks = [look for scene, said in scenes if (look := look_at(scene, seen, said)) is not None]
    if looks and asked.pointed:
        from ffseg.evidence.closer import closer_looks

        looks += closer_looks(asked)
    if not looks:
        return image_edges
    best = looks[0] if len(looks) == 1 else max(looks, key=attrgetter("promised"))
    edges = odds_edges(best.odds, asked.params.region.probability, image_edges, "prior")
    if best.scene.starts == asked.starts:
        return edges
    return tried(contour(replace(best.scene, edges=edges, callback=None)), best.said)


def _holds_rivals(found: ContourResult, scene: Scene) -> bool:
    return scene.has_rivals and bool((found.region() & rivals_of(scene)).any())


def _mends_a_rim(found: ContourResult, scene: Scene) -> bool:
    """Whether a click that is much narrower than another lies beside what that holds: it is to mend the rim, and no start."""
    if len(scene.params.init.circles) < 2:
        return False
    from ffseg.evidence.hints import HELD_RADIUS, showing  # loads forests

    inside = scene.start_region()
    narrow = inside & ~showing(inside, np.zeros_like(inside))[0][0]
    if not narrow.any():
        return False
    beside = dilated_by_disc(narrow, HELD_RADIUS)
    held = (filled(one, scene.shape) for one in found.outcome.contours or () if one.signed_area > 0)
    return any((beside[own.window()] & own.mask).any() and not (narrow[own.window()] & own.mask).any() for own in held)


def _trial(scene: Scene) -> ContourResult | None:
    """The contour on the image's own edges, or None if its boundary is not clear."""
    scene = bounded(scene)
    begin = perf_counter()
    scene, messages, across = on_one_side(scene)
    if across:
        return None
    watch = unless_faint(scene.edges, MET_STRENGTH, scene.covered)
    try:
        outcome = run(replace(scene, callback=watch, every=CHECK_INTERVAL))
    except (BlockedStartError, FaintError):
        return None
    if outcome.contours is None:
        return None
    boundary = Boundary(outcome.contours, scene.edges, scene.covered)
    evolve_ms = (perf_counter() - begin) * 1e3
    if not boundary.is_clear(_least_met(scene)):
        return None
    return ContourResult(scene, outcome, messages, evolve_ms, boundary=boundary)


def _least_met(scene: Scene) -> float:
    """Edge strength below which parts of a boundary are open: at closed passages, and in the slits of a snake."""
    slits = scene.method is not None and scene.method.slits
    return MET_STRENGTH if slits or scene.shuts_passages else 0.0
