"""Random scenes against their truth.

Checks, scene by scene: the evolution converges, the contours do not cross themselves or each other, and where the
truth has no passage narrower than 6 pixels the IoU is at least 0.99.
"""

from dataclasses import dataclass

import numpy as np
import shapely

import ffseg
from tests import scenes
from tests.discs import overlap

LEAST_IOU = 0.99
FLATTEN_TOLERANCE = 0.005
"""Pixels; contours are tested for crossings as polygons this close to their curves: at 0.05 two stretches of a cusp that
pass 0.02 apart seem to cross."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What is wrong with one scene (empty when nothing is), and its figures."""

    seed: int
    faults: tuple[str, ...]
    iou: float
    wide: bool
    evolve_ms: float


def is_simple(contours: tuple[ffseg.FreeForm, ...]) -> bool:
    """Does no contour cross or touch itself or another?"""
    rings = [c.flatten(FLATTEN_TOLERANCE) for c in contours]
    closed = [np.vstack([ring, ring[:1]]) for ring in rings]
    return bool(shapely.MultiLineString(closed).is_simple)


def check(seed: int, overrides: dict[str, object]) -> Outcome:
    """Segment scene number ``seed`` and say what is wrong."""
    scene = scenes.scene(seed)
    own = ffseg.load_params(None, {"init.center": list(scenes.START), "init.radius": scenes.START_RADIUS, **overrides})
    result = ffseg.segment(scene.image, own)
    iou, faults = overlap(result.mask, scene.truth), []
    if result.stats.stop_reason != "converged":
        faults.append(f"stopped by {result.stats.stop_reason}")
    if not is_simple(result.contours):
        faults.append("contours cross")
    if scene.wide and iou < LEAST_IOU:
        faults.append(f"IoU {iou:.4f}")
    num_holes = sum(c.signed_area < 0 for c in result.contours)
    if scene.wide and num_holes != scene.holes:
        faults.append(f"{num_holes} holes, truth {scene.holes}")
    return Outcome(seed, tuple(faults), iou, scene.wide, result.timings.evolve_ms)
