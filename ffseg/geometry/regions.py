"""Components put together: every outer contour with the holes that lie in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffseg.geometry.bezier import Points
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
    A hole lies in an outer contour when most of up to `_NUM_PROBES` points of it do: it may touch the outer contour, or
    leave it by a rounding, without being lost.
    """
    areas = np.array([c.signed_area for c in contours])
    outers = [contour for contour, area in zip(contours, areas, strict=True) if area > 0.0]
    rising = np.argsort(areas[areas > 0.0], kind="stable").tolist()
    probes = _Probes.of(outers)
    holes: list[list[FreeForm]] = [[] for _ in outers]
    for hole in (contour for contour, area in zip(contours, areas, strict=True) if area < 0.0):
        owner = next((i for i in rising if probes.contains(i, hole)), None)
        if owner is not None:
            holes[owner].append(hole)
    return tuple(Region(outer, tuple(inside)) for outer, inside in zip(outers, holes, strict=True))


_NUM_PROBES = 9
"""Points of a hole that are asked: odd, so that most is clear, and enough that touching at a few decides nothing."""

_FLATNESS = 0.05
"""Pixels by which outer contours are flattened to be asked: probes this close to the curve may be counted wrong."""


@dataclass(frozen=True, slots=True, eq=False)
class _Probes:
    """Outer contours ready to be asked whether a hole lies in them."""

    outers: Sequence[FreeForm]
    boxes: Points
    polygons: dict[int, FreeForm]

    @classmethod
    def of(cls, outers: Sequence[FreeForm]) -> _Probes:
        return cls(outers, np.array([c.control_box for c in outers]).reshape(-1, 2, 2), {})

    def contains(self, index: int, hole: FreeForm) -> bool:
        points = hole.evaluate((np.arange(_NUM_PROBES) + 0.5) / _NUM_PROBES)
        low, high = self.boxes[index]
        boxed = ((points >= low) & (points <= high)).all(axis=1)
        if 2 * np.count_nonzero(boxed) <= _NUM_PROBES:
            return False
        if index not in self.polygons:
            self.polygons[index] = FreeForm.trusted(self.outers[index].flatten(_FLATNESS), 1)
        inside = self.polygons[index].winding(points[boxed]) != 0
        return 2 * int(np.count_nonzero(inside)) > _NUM_PROBES
