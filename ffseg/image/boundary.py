"""How clear the image's own edges are along a contour."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from itertools import compress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Mask
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed_joints
from ffseg.image.components import filled
from ffseg.image.edges import AUTO_HIGH_MIN, GRADIENT_SCALE, EdgeMap
from ffseg.image.raster import rasterize
from ffseg.native import _core

FAINT_FRACTION = 0.1
"""Fraction of a clear boundary that may be faint: at corners and crossings the gradient has no single direction."""

MIN_STRENGTH = 1.5
"""An edge is clear if its strength is at least this multiple of the edge threshold."""

MAX_LIVELY = 0.01
"""A boundary is clear only round a plain region, of which no larger part is lively: in texture a contour ends at the next edge,
and edges there are as strong as any. Of 3960 looks at drawings 186 are decided so by their own edges (mean IoU .867, .885 by
the prior), 23 with an IoU below .5; without this 856 and 246."""

NOISE_GRADIENT, EDGE_GAIN, EDGE_WIDTH = 0.6, 2.0, 1.8
"""Lively are gradients that neither noise explains, the first value in edge thresholds, nor a straight edge at the boundary, as
strong as half of this is and as wide, in pixels, as the smoothing makes it; the gain leaves room for stronger parts."""

SQUARED_REACH, SAMPLED_ROWS = 50, 64
"""Squared pixels: edges at the boundary are not seen as far inside. Rows of a region that are looked at, at least."""

BORDER_MARGIN = 3
"""Pixels from the border of the image or the domain within which no edge is expected."""

CHECK_INTERVAL, MIN_JOINTS, MAX_DOUBTED_FRACTION, SURE_STRENGTH = 48, 20, 0.5, 2.5
"""The trial contour is checked after every so many iterations, once at least so many joints lie on edges, and stopped if
more than this fraction of them is faint, or fainter than the last value round a region that is not plain. Saves time only: of
660 looks at drawings no result changes."""


class FaintError(Exception):
    """The edges that the evolving contour has met are too faint for a clear boundary."""


class Boundary:
    """How clear the image's own edges are along the contours of a result.

    Parameters
    ----------
    contours : tuple of FreeForm, or None
        Looked at are their joints, but those within `BORDER_MARGIN` pixels of the border of the image or the domain: the largest
        of nine gradients, in high thresholds.
    covered : tuple of FreeForm
        Whatever is seen in these says nothing of how plain the region is, as the robot in the start round a camera.
    """

    def __init__(
        self, contours: tuple[FreeForm, ...] | None, edges: EdgeMap, covered: tuple[FreeForm, ...] = ()
    ) -> None:
        self._contours, self._edges, self._covered = contours or (), edges, covered
        gradients = _core.gradients_at(packed_joints(self._contours)[0], edges.gradient, edges.domain, BORDER_MARGIN)
        self.strength = gradients / high_threshold(edges)

    def is_clear(self, least: float = 0.0) -> bool:
        """Whether the whole boundary lies on clear edges, round a plain region.

        Parameters
        ----------
        least : float
            Parts on less than this strength are left out.

        Returns
        -------
        bool
            False where no part lies inside the image and the domain, as the region has met no edge, unless the image is
            even: then nobody can tell more of it. True where all parts are left out.
        """
        if not (self.strength >= least).any():
            return len(self.strength) > 0 or int(self._edges.gradient.max(initial=0)) < AUTO_HIGH_MIN * GRADIENT_SCALE
        return self.reached(least, FAINT_FRACTION) >= MIN_STRENGTH and self.is_plain

    def reached(self, least: float, share: float) -> float:
        """Strength that all but this share of the parts on at least the strength `least` reach; there must be one."""
        first = int(np.searchsorted(self._ascending, least))
        return float(self._ascending[first + int(share * (len(self._ascending) - first))])

    def clear_share(self) -> float:
        """Fraction of the boundary on clear edges, from joint to joint; half of it round what is not plain."""
        clear = np.count_nonzero(self.strength >= MIN_STRENGTH)
        return float((clear + 1) / (len(self.strength) + 1)) / (1 if self.is_plain else 2)

    @cached_property
    def _ascending(self) -> NDArray[np.float64]:
        return np.sort(self.strength)

    @cached_property
    def region(self) -> Mask:
        """Pixels that the contours hold."""
        return rasterize(self._contours, self._edges.gradient.shape)

    @cached_property
    def is_plain(self) -> bool:
        """Whether almost nothing but noise and the boundary's own edges is seen in the region; each part has its own."""
        region = self.region & ~rasterize(self._covered, self.region.shape) if self._covered else self.region
        outer = [one for one in self._contours if one.signed_area > 0]
        if len(outer) < 2:
            return self._lively_share(np.s_[:, :], region, MAX_LIVELY) <= MAX_LIVELY
        area, lively = np.count_nonzero(region), 0.0
        for window, part, boundary in self._parts(outer, region):
            weight = np.count_nonzero(part) / area
            lively += weight * boundary._lively_share(window, part, MAX_LIVELY / weight)
            if lively > MAX_LIVELY:
                return False
        return True

    def _lively_share(self, window: tuple[slice, slice], region: Mask, most: float) -> float:
        """Share of a region in a window that is lively; 1 where it is more than `most`."""
        rows = packed_joints(self._contours)[0][:, 1]
        step = 1 + int(np.ptp(rows)) // SAMPLED_ROWS if len(rows) else 1
        strength = self._ascending[len(self.strength) // 2] if len(self.strength) else 0.0
        edge = EDGE_GAIN * strength * np.exp(-np.arange(SQUARED_REACH + 1) / (2 * EDGE_WIDTH**2))
        edge[-1] = 0.0
        levels = (NOISE_GRADIENT + edge) * high_threshold(self._edges)
        gradient = np.ascontiguousarray(self._edges.gradient[window])
        return _core.lively_share(region.view(np.uint8), gradient, levels, step, most)

    def _parts(self, outer: list[FreeForm], region: Mask) -> Iterator[tuple[tuple[slice, slice], Mask, Boundary]]:
        """What outer contours hold of a region, small ones first: rows and columns, pixels there, and the boundary of each."""
        holes, left = [one for one in self._contours if one.signed_area <= 0], region.copy()
        places = np.reshape([hole.control_points[0] for hole in holes], (-1, 2))
        for one in sorted(outer, key=lambda one: one.signed_area):
            own = filled(one, region.shape)
            part = own.mask & left[own.window()]
            left[own.window()] &= ~own.mask
            if part.any():
                yield own.window(), part, Boundary((one, *compress(holes, one.winding(places))), self._edges)


def unless_faint(edges: EdgeMap, least: float, covered: tuple[FreeForm, ...] = ()) -> Callable[[Any], None]:
    """A callback that raises `FaintError` once the edges met by an evolution, those of at least this strength, are faint.

    Not checked are the starts, which may lie near edges, and the final contour, which the caller checks.
    """

    def watch(progress: Any) -> None:  # noqa: ANN401 - an `ffseg.scene.Progress`, of a higher floor
        if progress.iteration == 0 or progress.iteration % CHECK_INTERVAL:
            return
        met = Boundary(progress.contours, edges, covered)
        if np.count_nonzero(met.strength >= least) < MIN_JOINTS:
            return
        reached = met.reached(least, MAX_DOUBTED_FRACTION)
        if reached < MIN_STRENGTH or (reached < SURE_STRENGTH and not met.is_plain):
            raise FaintError

    return watch


def high_threshold(edges: EdgeMap) -> float:
    """The high threshold in units of the stored gradient."""
    return max(edges.thresholds[1] * GRADIENT_SCALE, 1.0)
