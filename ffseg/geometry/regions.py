"""Components put together: every outer contour with the holes that lie in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffseg.geometry.freeform import FreeForm


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """One outer component with its holes.

    Attributes
    ----------
    outer : FreeForm
        Positive signed area.
    holes : tuple of FreeForm
        Negative signed areas, inside `outer`.
    """

    outer: FreeForm
    holes: tuple[FreeForm, ...]

    @property
    def contours(self) -> tuple[FreeForm, ...]:
        """The outer contour, then the holes."""
        return (self.outer, *self.holes)

    @property
    def area(self) -> float:
        """Area of the outer contour less that of its holes, square pixels."""
        return sum(contour.signed_area for contour in self.contours)


def group_regions(contours: Sequence[FreeForm]) -> tuple[Region, ...]:
    """Regions of a set of contours, in the order of their outer ones; holes keep their order too.

    Parameters
    ----------
    contours : sequence of FreeForm
        Outer contours have positive, holes negative signed area; contours of area 0 enclose nothing and are dropped.

    Returns
    -------
    tuple of Region
        Each hole belongs to the outer contour of smallest area that contains it, so an island in a hole is a region
        of its own. A hole that lies in no outer contour encloses no winding number > 0 and is dropped.

    Notes
    -----
    A hole lies in an outer contour when most of its points do (joints and patch middles): it may touch the outer
    contour, or leave it by a rounding, without being lost.
    """
    outers = [c for c in contours if c.signed_area > 0.0]
    areas = [c.signed_area for c in outers]
    holes: list[list[FreeForm]] = [[] for _ in outers]
    for hole in (c for c in contours if c.signed_area < 0.0):
        around = [i for i, outer in enumerate(outers) if _contains(outer, hole)]
        if around:
            holes[min(around, key=areas.__getitem__)].append(hole)
    return tuple(Region(outer, tuple(inside)) for outer, inside in zip(outers, holes, strict=True))


def _contains(outer: FreeForm, hole: FreeForm) -> bool:
    (low, high), (hole_low, hole_high) = outer.control_box, hole.control_box
    if (hole_high < low).any() or (hole_low > high).any():
        return False
    points = hole.evaluate(np.arange(2 * hole.num_patches) / (2.0 * hole.num_patches))
    return bool((outer.winding(points) != 0).mean() > 0.5)
