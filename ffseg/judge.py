"""Confidence in a result: a score that estimates its IoU, and the reasons to doubt it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Image, Mask
from ffseg.contour import ContourResult
from ffseg.evidence.maps import expected_overlap
from ffseg.evidence.surroundings import STRIDE, strided
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed_joints
from ffseg.image.boundary import BORDER_MARGIN
from ffseg.native import _core
from ffseg.scene import Scene

FILLED_FRACTION = 0.9
"""A region that covers more than this fraction of the domain is doubted: too little is left to show that anything lies
outside."""

BORDER_FRACTION = 0.7
"""A region that the image's own edges decide is doubted if more than this fraction of its outer outline lies on the border of the
image or the domain. A floor that fills the lower half of an image has 0.6."""

EARLY_STOPS = ("max_iterations", "budget", "max_patches", "max_points")
"""Reasons to stop before the contour has come to rest."""

MAX_DOUBTED_SCORE = 0.5
"""Largest score of a region whose start lies on both sides of an edge (either side may be meant), or whose contour was
stopped early."""


@dataclass(frozen=True, slots=True)
class Doubt:
    """A reason to doubt a result.

    Attributes
    ----------
    name : str
        ``empty``, ``filled``, ``border``, ``early`` or ``start``.
    most : float
        What the score is at most.
    message : str
        For the note; empty where it has been said.
    """

    name: str
    most: float
    message: str


def judge_region(
    scene: Scene, found: ContourResult, contours: tuple[FreeForm, ...], mask: Mask
) -> tuple[float, tuple[Doubt, ...]]:
    """Score of a region, and the reasons to doubt it.

    The score is the IoU to expect by the evidence or, without evidence, the fraction of the boundary on clear edges.
    Each doubt limits it.
    """
    doubts = tuple(_doubts(found, contours, mask, scene.limits))
    edges = found.scene.edges
    if edges.odds is None:
        sure = found.boundary_of(contours).clear_share()
    else:
        overlap = expected_overlap(strided(edges.odds), mask[::STRIDE, ::STRIDE])
        sure = edges.calibration.iou(overlap)
    return min([sure, *(doubt.most for doubt in doubts)]), doubts


def _doubts(found: ContourResult, contours: tuple[FreeForm, ...], mask: Mask, domain: Image | None) -> Iterator[Doubt]:
    where = "image" if domain is None else "domain"
    area, room = int(np.count_nonzero(mask)), mask.size if domain is None else int(np.count_nonzero(domain))
    if area == 0:
        yield Doubt("empty", 0.0, "the region is empty")
        return
    if area >= FILLED_FRACTION * room:
        most = max(0.0, 1 - area / room) / (2 * (1 - FILLED_FRACTION))
        full = _percent(min(area / room, 1.0))  # settling, it may pass the limit by some pixels
        yield Doubt("filled", most, f"the region fills {full} of the {where}: nothing shows where it ends")
    elif found.scene.edges.odds is None and (share := border_share(contours, mask.shape, domain)) >= BORDER_FRACTION:
        most = (1 - share) / (2 * (1 - BORDER_FRACTION))
        yield Doubt("border", most, f"{_percent(share)} of the region's outline is the border of the {where}")
    stats = found.outcome.stats
    if stats.stop_reason in EARLY_STOPS:
        yield Doubt(
            "early",
            MAX_DOUBTED_SCORE,
            f"the contour was stopped after {stats.iterations} iterations ({stats.stop_reason})",
        )
    if found.across:
        yield Doubt("start", MAX_DOUBTED_SCORE, "")


def border_share(contours: tuple[FreeForm, ...], shape: tuple[int, ...], domain: Image | None) -> float:
    """Fraction of the outer contours' length within `BORDER_MARGIN` px of the border of the image or the domain."""
    outer = packed_joints([contour for contour in contours if contour.signed_area > 0])
    return _core.share_within(*outer, (shape[0], shape[1]), domain, BORDER_MARGIN)


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"
