"""How clear the image's own edges are along a contour."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed_joints
from ffseg.image.edges import AUTO_HIGH_MIN, GRADIENT_SCALE, EdgeMap
from ffseg.image.raster import rasterize
from ffseg.native import _core

CLEAR_SHARE = 0.1
"""So much of a boundary may be fainter: corners and crossings, where no gradient has one direction."""

CLEAR = 2.5
"""Edges are clear that have this many times the strength an edge needs. On drawings the faint tenth of a contour that is right
(IoU .9) has 3.27 times or more (41 of 44), of one that is wrong 2.39 at most (59)."""

PLAIN_FAINTEST, PLAIN = 1.25, 0.6
"""In strong noise the edges of a plain region are clear enough at 1.25 times (all but a twentieth): plain is a region
where nine tenths of the gradients are below 0.6 times what an edge needs, as noise alone gives (0.46)."""

MARGIN = 3
"""Pixels from the border of the image or the domain within which no edge is looked for."""

SAMPLE = 4
"""Every fourth pixel each way shows how plain a region is."""

EVERY, ENOUGH, DOUBTED = 48, 20, 0.5
"""A contour on the way is looked at every so many iterations, once it has met edges at so many joints, and given up when more
than this share of them are faint. It only saves time: of 1324 drawings and scenes, 436 of which come out clear, none changes."""


class FaintError(Exception):
    """What a contour on the way has met is too faint for its boundary to come out clear."""


class Boundary:
    """How clear the image's own edges are along what a method found.

    Parameters
    ----------
    contours : tuple of FreeForm, or None
        Looked at are their joints, but those within `MARGIN` pixels of the border of the image or the domain: the largest
        of nine gradients, in high thresholds.
    """

    def __init__(self, contours: tuple[FreeForm, ...] | None, edges: EdgeMap) -> None:
        self._contours, self._edges = contours or (), edges
        gradients = _core.gradients_at(packed_joints(self._contours)[0], edges.gradient, edges.domain, MARGIN)
        self.strength = gradients / high_threshold(edges)

    def is_clear(self, least: float = 0.0, share: float | None = None) -> bool:
        """Whether it stands on edges that nobody would doubt.

        Parameters
        ----------
        least : float
            Parts on less than this strength are left out: a front that still moves.
        share : float, optional
            So much of the rest may be fainter, else `CLEAR_SHARE`.

        Returns
        -------
        bool
            False where no part lies inside the image and the domain, as the region has met no edge, unless the image is
            even: then nobody can tell more of it. True where all parts are left out.
        """
        fainter, share = np.sort(self.strength[self.strength >= least]), CLEAR_SHARE if share is None else share
        if len(fainter) == 0:
            return len(self.strength) > 0 or int(self._edges.gradient.max(initial=0)) < AUTO_HIGH_MIN * GRADIENT_SCALE
        if fainter[int(share * len(fainter))] >= CLEAR:
            return True
        return bool(fainter[int(share / 2 * len(fainter))] >= PLAIN_FAINTEST) and self._is_plain

    def clear_share(self) -> float:
        """Share on clear edges, shared with one sample that is not; round a plain region less is clear."""
        clear = np.count_nonzero(self.strength >= CLEAR)
        if clear < (1 - CLEAR_SHARE) * len(self.strength) and self._is_plain:
            clear = np.count_nonzero(self.strength >= PLAIN_FAINTEST)
        return float((clear + 1) / (len(self.strength) + 1))

    @cached_property
    def _is_plain(self) -> bool:
        inside = rasterize(self._contours, self._edges.gradient.shape)[::SAMPLE, ::SAMPLE]
        levels = self._edges.gradient[::SAMPLE, ::SAMPLE][inside]
        return len(levels) > 0 and float(np.quantile(levels, 0.9)) <= PLAIN * high_threshold(self._edges)


def unless_faint(edges: EdgeMap, least: float) -> Callable[[Any], None]:
    """A callback that raises a `FaintError` when what an evolution has met is faint; met is what has at least that strength.

    Not looked at are the start, which is no contour on the way, if it has too few joints, and the end, which whoever asked
    for the evolution looks at.
    """

    def watch(progress: Any) -> None:  # noqa: ANN401 - an `ffseg.scene.Progress`, of a higher floor
        if progress.iteration % EVERY or sum(one.num_patches for one in progress.contours) < ENOUGH:
            return
        met = Boundary(progress.contours, edges)
        if np.count_nonzero(met.strength >= least) >= ENOUGH and not met.is_clear(least, DOUBTED):
            raise FaintError

    return watch


def high_threshold(edges: EdgeMap) -> float:
    """The high threshold in units of the stored gradient."""
    return max(edges.thresholds[1] * GRADIENT_SCALE, 1.0)
