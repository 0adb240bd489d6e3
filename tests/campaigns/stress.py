"""Random scenes against their truth: ``python -m tests.campaigns.stress --scenes 2000``.

Checks, scene by scene: the evolution converges, the contours do not cross themselves or each other, and where the
truth has no passage narrower than 6 pixels the IoU is at least 0.99.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import shapely
import typer

import ffseg
from tests import scenes
from tests.campaigns import harness

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


def is_simple(contours: tuple[ffseg.FreeForm, ...]) -> bool:
    """Does no contour cross or touch itself or another?"""
    rings = [c.flatten(FLATTEN_TOLERANCE) for c in contours]
    closed = [np.vstack([ring, ring[:1]]) for ring in rings]
    return bool(shapely.MultiLineString(closed).is_simple)


def check(seed: int, overrides: dict[str, object]) -> Outcome:
    """Segment scene number ``seed`` and say what is wrong."""
    scene = scenes.scene(seed)
    params = ffseg.load_params(
        None, {"init.center": list(scenes.START), "init.radius": scenes.START_RADIUS, **overrides}
    )
    result = ffseg.segment(scene.image, params)
    both, either = np.sum(result.mask & scene.truth), np.sum(result.mask | scene.truth)
    iou = float(both / either)
    faults = []
    if result.stats.stop_reason != "converged":
        faults.append(f"stopped by {result.stats.stop_reason}")
    if not is_simple(result.contours):
        faults.append("contours cross")
    if scene.wide and iou < LEAST_IOU:
        faults.append(f"IoU {iou:.4f}")
    num_holes = sum(c.signed_area < 0 for c in result.contours)
    if scene.wide and num_holes != scene.holes:
        faults.append(f"{num_holes} holes, truth {scene.holes}")
    return Outcome(seed, tuple(faults), iou, scene.wide)


def main(
    scenes: int = 2000, first: int = 0, settings: Annotated[list[str] | None, typer.Option("--set")] = None
) -> int:
    """Run the campaign; the exit code is 1 when a scene has a fault."""
    overrides = dict(item.split("=", 1) for item in settings or ())
    outcomes = [check(seed, {k: _number(v) for k, v in overrides.items()}) for seed in range(first, first + scenes)]
    for outcome in outcomes:
        if outcome.faults:
            print(f"scene {outcome.seed}: {'; '.join(outcome.faults)}")
    wide = [o.iou for o in outcomes if o.wide]
    faulty = sum(bool(o.faults) for o in outcomes)
    print(
        f"{len(outcomes)} scenes, {faulty} faulty; {len(wide)} wide, IoU least {min(wide):.4f}, mean {np.mean(wide):.4f}"
    )
    return 1 if faulty else 0


def _number(text: str) -> float | int:
    return float(text) if "." in text else int(text)


if __name__ == "__main__":
    harness.as_command(main)
