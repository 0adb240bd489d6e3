"""Regions: every outer contour with the holes inside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Mask, Points
from ffseg.geometry import bezier
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


def oriented(contours: Sequence[FreeForm]) -> tuple[FreeForm, ...]:
    """The same contours, those turned round that run the wrong way to bound a region.

    Notes
    -----
    The Remark on orientation in Section 3.4. Contours of which more area runs backwards than forwards are taken to run
    backwards all of them, holes too; of the others, one of negative area that lies in no outer contour is turned round.
    What runs the right way is the same object as before.
    """
    made = tuple(contours)
    if all(contour.signed_area >= 0 for contour in made):
        return made
    if sum(contour.signed_area for contour in made) < 0:
        made = tuple(contour.reversed() for contour in made)
    held = {id(hole) for region in group_regions(made) for hole in region.holes}
    return tuple(one if one.signed_area >= 0 or id(one) in held else one.reversed() for one in made)


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
    areas = [contour.signed_area for contour in contours]
    outers = [contour for contour, area in zip(contours, areas, strict=True) if area > 0.0]
    holes = [contour for contour, area in zip(contours, areas, strict=True) if area < 0.0]
    inside: list[list[FreeForm]] = [[] for _ in outers]
    if outers and holes:
        rising = np.argsort([area for area in areas if area > 0.0], kind="stable").tolist()
        for hole, owner in zip(holes, _owners(outers, rising, _probes(holes)), strict=True):
            if owner != _NOBODY:
                inside[owner].append(hole)
    return tuple(Region(outer, tuple(mine)) for outer, mine in zip(outers, inside, strict=True))


_NUM_PROBES = 9
"""Points of a hole that are asked: odd, so that most is clear, and enough that touching at a few decides nothing."""

_NOBODY = -1


def _probes(holes: Sequence[FreeForm]) -> Points:
    """Points of every hole at equal steps of its parameter, shape (H, _NUM_PROBES, 2)."""
    at = (np.arange(_NUM_PROBES) + 0.5) / _NUM_PROBES
    probes = np.empty((len(holes), _NUM_PROBES, 2))
    for degree in {hole.degree for hole in holes}:  # all patches of one degree are evaluated at once
        chosen = [index for index, hole in enumerate(holes) if hole.degree == degree]
        control = np.concatenate([holes[index].control_points for index in chosen])
        sizes = np.array([len(holes[index].control_points) for index in chosen])[:, None]
        scaled = at * (sizes // degree)
        patch = scaled.astype(np.int64)
        place = (patch[..., None] * degree + np.arange(degree + 1)) % sizes[..., None]
        starts = np.cumsum(sizes)[:, None, None] - sizes[..., None]
        probes[chosen] = bezier.evaluate(control[starts + place], scaled - patch)
    return probes


def _owners(outers: Sequence[FreeForm], rising: Sequence[int], probes: Points) -> list[int]:
    """Index of the first outer contour in `rising` order that contains most probes of each hole, or `_NOBODY`."""
    owners = np.full(len(probes), _NOBODY)
    for index in rising:
        open_ = np.flatnonzero(owners == _NOBODY)
        low, high = outers[index].control_box
        boxed = ((probes[open_] >= low) & (probes[open_] <= high)).all(axis=2)
        near = _most(boxed)
        if not near.any():
            continue
        open_, boxed = open_[near], boxed[near]
        boxed[boxed] = outers[index].winding(probes[open_][boxed]) != 0
        owners[open_[_most(boxed)]] = index
    return list(owners.tolist())


def _most(marked: Mask) -> Mask:
    """Whether more than half of each row is marked."""
    most: Mask = 2 * np.count_nonzero(marked, axis=1) > marked.shape[1]
    return most
