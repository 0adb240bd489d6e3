"""Narrow ground against its flood-filled truth; ``pytest --long tests/unit/test_corridors.py`` judges 10000 cases.

Every case draws a corridor, spiral, maze, comb, tree or bent passage of 6 to 40 px at any angle, or a wall with a gap,
and draws degree, balloon and split threshold. Pixels beside the drawn border are left out (how near the border the
contour comes is measured elsewhere): what is judged is which ground was reached. From 8 px on the IoU is at least
0.995; what is reached grows with the width; a gap leaks only where the edge map leaves it open, and if it leaks, so do
all wider ones.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

import ffseg
from ffseg.image.edges import edge_map
from tests import labyrinths

LEAST_IOU = 0.995
ENTERED_FROM = 8.0
"""Passages at least this wide, in px, are filled."""
GAPS = np.arange(1.0, 13.0)
GAP_OPEN = 8.0
"""A gap this wide, in px, always leaks: the passage is no narrower than those that must be filled."""
LEAK = 1.1
"""A contour that encloses this many times the area within the wall has leaked."""


@dataclass(frozen=True, slots=True)
class Case:
    """One drawn case with its settings, and what is wrong with it."""

    seed: int
    kind: str
    width: float
    settings: dict[str, float]
    faults: tuple[str, ...]


def settings_of(rng: np.random.Generator) -> dict[str, float]:
    """Draw degree, balloon, split threshold and the patches of the start."""
    return {
        "contour.degree": int(rng.integers(1, 7)),
        "contour.balloon": float(rng.uniform(2, 12)),
        "contour.split_threshold": float(np.exp(rng.uniform(np.log(6), np.log(80)))),
        "contour.patches": int(rng.integers(8, 41)),
        "contour.max_iterations": 20_000,
    }


def segmented(scene: labyrinths.Labyrinth, settings: Mapping[str, object]) -> ffseg.Segmentation:
    start = {"init.center": list(scene.start), "init.radius": labyrinths.START_RADIUS}
    own = {"edges.source": "gradient"}  # else the prior could step in where the evolution fails
    return ffseg.segment(scene.image, ffseg.load_params(None, {**own, **start, **settings}))


def iou_off_border(mask: NDArray[np.bool_], truth: NDArray[np.bool_]) -> float:
    """IoU over the pixels that have neighbours of one kind only in the truth."""
    kernel = np.ones((3, 3), np.uint8)
    whole = truth.astype(np.uint8)
    judged = cv2.dilate(whole, kernel) == cv2.erode(whole, kernel)
    return float(np.sum(mask & truth & judged) / max(1, np.sum((mask | truth) & judged)))


def plan_of(seed: int) -> tuple[labyrinths.Plan, float, dict[str, float]]:
    """Plan, width and settings of a drawn passage."""
    rng = np.random.default_rng([seed, 1])
    width = float(np.round(np.exp(rng.uniform(np.log(6), np.log(40))), 1))
    return labyrinths.plan(seed, width), width, settings_of(rng)


def passage(seed: int) -> Case:
    plan, width, settings = plan_of(seed)
    scene = plan.drawn(width)
    result = segmented(scene, settings)
    iou, faults = iou_off_border(result.mask, scene.truth), []
    if result.stats.stop_reason != "converged":
        faults.append(f"stopped by {result.stats.stop_reason}")
    if width >= ENTERED_FROM and iou < LEAST_IOU:
        faults.append(f"IoU {iou:.4f}")
    if width < ENTERED_FROM:
        wider = plan.drawn(width + 1.0)
        again = iou_off_border(segmented(wider, settings).mask, wider.truth)
        if again < iou - (1 - LEAST_IOU):
            faults.append(f"less reached with 1 px more: {iou:.3f}, {again:.3f}")
    return Case(seed, plan.kind, width, settings, tuple(faults))


def is_open(scene: labyrinths.Labyrinth) -> bool:
    """Does the edge map leave a way out between the bands (3 px) round its edges, if only from corner to corner?"""
    edges = edge_map(scene.image, ffseg.load_params().edges).edges
    free = cv2.dilate(edges, np.ones((3, 3), np.uint8)) == 0
    _, labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=8)
    x, y = (round(v) for v in scene.start)
    return bool(labels[y, x] == labels[5, 5])


def gap(seed: int) -> Case:
    """Judge a wall with a gap that widens pixel by pixel."""
    rng = np.random.default_rng([seed, 2])
    settings, angle, wall = settings_of(rng), float(rng.uniform(0, 90)), float(rng.uniform(4, 14))
    leaks, faults = [], []
    for width in GAPS:
        scene = labyrinths.gap(float(width), angle, wall)
        result = segmented(scene, settings)
        leaks.append(bool(result.mask.sum() > LEAK * scene.truth.sum()))
        if result.stats.stop_reason != "converged":
            faults.append(f"stopped by {result.stats.stop_reason}")
        if leaks[-1] and not is_open(scene):
            faults.append(f"leaks through {width:g} px that are shut")
        if not leaks[-1] and width >= GAP_OPEN:
            faults.append(f"holds at {width:g} px")
    if leaks != sorted(leaks):
        faults.append("leaks " + "".join(".x"[leak] for leak in leaks))
    return Case(seed, "gap", float(GAPS[np.argmax(leaks)]), settings, tuple(faults))


def judge(seed: int) -> Case:
    """Judge case number ``seed``: one in twelve is a gap in all its widths."""
    return gap(seed) if seed % 12 == 0 else passage(seed)
