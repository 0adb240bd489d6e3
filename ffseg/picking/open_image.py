"""One opened image: its reduced copies, its picture for the browser, and the region of its picks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from threading import Lock
from time import perf_counter
from typing import cast

import numpy as np

from ffseg.arrays import Image, Mask
from ffseg.enlargement import scaled_seed, smaller
from ffseg.errors import FfsegError
from ffseg.evidence.source import proposes
from ffseg.geometry.freeform import FreeForm
from ffseg.image.edges import edge_map
from ffseg.image.free import distances
from ffseg.io.masks import NO_MASKS, Bounds, Masks
from ffseg.io.overlays import encode_jpeg
from ffseg.io.snapshots import scaled_down
from ffseg.io.starts import Start
from ffseg.io.svg import path_data
from ffseg.parameters import Circle, Init, Parameters
from ffseg.picking.picks import ImagePicks, paint_strokes
from ffseg.pipeline import outlines_of, segment
from ffseg.scene import Scene
from ffseg.starts.initial import start_contours

MAX_PREVIEW_SIDE, MIN_PREVIEW_SIDE = 400, 200
"""Pixels of the longer side of the copy that is segmented while the hand moves, at most and at least."""

MAX_PREVIEW_MS = 30.0
"""The copy is halved when it took longer: with drawing and the way there and back 50 ms are left to follow the hand."""

FITTED_SIDE = 800
"""Pixels of the longer side of the copy in which a click's disc is made to fit: 8 pixels are its radius there."""

FITTED_SCORE, MIN_BEYOND = 0.9, 0.9
"""Score of what the image's own edges find from a disc that fits, and the part of it that lies more than two radii of the click
away, from which on that is meant. Of 1240 clicks on drawings and photographs, at random places and at the deepest, this is so of
9: four come from an IoU of .45 to .88 to one of .95 or more, none loses. Of 13 with less beyond, specks between edges, 12 do."""

QUALITY = 92
"""Of the JPEG that the browser shows; it is only looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class PickedRegion:
    """The region of what was picked.

    Attributes
    ----------
    mask : ndarray of bool, shape (H, W)
        In the size of the copy that was segmented.
    factor : float
        Pixels of the image in one of the copy.
    said : str
        Why there is no region, or what was done otherwise than asked.
    source : str
        What told the region: an edge source, ``run`` or nothing.
    score : float
        The IoU to expect; 0 where nothing tells it, as after strokes.
    ms : float
        Taken by the segmentation.
    base : ndarray of bool, shape (H, W), or None
        What strokes were painted on, if there are any.
    """

    mask: Mask
    contours: tuple[FreeForm, ...]
    factor: float = 1.0
    said: str = ""
    source: str = ""
    score: float = 0.0
    ms: float = 0.0
    base: Mask | None = None

    def document(self) -> dict[str, object]:
        """What the page draws."""
        path = " ".join(path_data(contour) for contour in self.contours)
        return {
            "path": path,
            "factor": self.factor,
            "said": self.said,
            "source": self.source,
            "score": round(self.score, 3),
            "ms": round(self.ms, 2),
        }


class OpenImage:
    """An image with what it takes to answer quickly.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    masks : Masks, optional
        Where the contour may go, start and may not be.
    """

    def __init__(self, image: Image, masks: Masks = NO_MASKS) -> None:
        self.image, self._masks = image, masks
        self._widest = MAX_PREVIEW_SIDE
        self._copies: dict[int, Image] = {}
        self._picture = b""
        self._last: tuple[ImagePicks, Parameters, PickedRegion] | None = None
        self._models = 0  # that were forgotten
        self._finding = Lock()  # in the whole image: who asks for what is being found waits for it

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) in pixels."""
        return self.image.shape[0], self.image.shape[1]

    def picture(self) -> bytes:
        """JPEG of the whole image."""
        self._picture = self._picture or encode_jpeg(self.image, QUALITY, sharp=True)
        return self._picture

    def fitted(self, circle: Circle, params: Parameters) -> Circle:
        """The disc of a click, px, or one that fits in a narrow thing under it, as a wire or a vessel.

        A disc that laps over both sides of such a thing shows more of what lies beside it. One that fits is taken where the
        image's own edges then follow the thing clearly, and far beyond the click.
        """
        image, factor = self._copy(FITTED_SIDE)
        x, y, radius = cast(Circle, scaled_seed(circle, factor))
        row, column = (min(max(round(at), 0), size - 1) for at, size in zip((y, x), image.shape, strict=False))
        edges = edge_map(image, params.edges).edges
        fit = max(1.0, float(distances(edges == 0)[row, column]) - 1)
        if fit >= radius or params.contour.clearance > 0:
            return circle
        init = Init(circles=((x, y, fit),))
        narrow = replace(params, init=init, edges=replace(params.edges, source="gradient", model=None))
        try:
            found = segment(Scene(image, narrow, draft=True, **self._bounds((image.shape[0], image.shape[1]))))
        except FfsegError:
            return circle
        rows, columns = np.nonzero(found.mask)
        beyond = np.hypot(columns - x, rows - y) > 2 * radius
        clear = found.score >= FITTED_SCORE and not found.doubts
        return (*circle[:2], fit * factor) if clear and beyond.mean() >= MIN_BEYOND else circle

    def find(self, picked: ImagePicks, params: Parameters, base: Mask | None, *, quick: bool = False) -> PickedRegion:
        """The region of what was picked.

        Parameters
        ----------
        picked : ImagePicks
        params : Parameters
            For all images; where these name a model that finds starts, a region is proposed where nothing was picked.
        base : ndarray of bool, shape (H, W), or None
            The region that stands as long as nothing but strokes is picked.
        quick : bool
            On a reduced copy that is small enough to follow the hand.
        """
        if quick:
            return self._asked(picked, params, base, quick=True)
        key = replace(picked, status="open")
        with self._finding:
            last = self._last if base is None or picked.grows else None  # a base is of a class and of a run
            if last is not None and last[:2] == (key, params):
                return last[2]
            models, found = self._models, self._asked(picked, params, base, quick=False)
            if models == self._models and (base is None or picked.grows):
                self._last = (key, params, found)
        return found

    def _asked(self, picked: ImagePicks, params: Parameters, base: Mask | None, *, quick: bool) -> PickedRegion:
        begin = perf_counter()
        image, factor = self._copy(self._widest) if quick else (self.image, 1.0)
        found = self._grown(image, factor, picked, params, base, draft=quick)
        if picked.strokes:
            mask = paint_strokes(found.mask, picked.strokes, factor)
            found = replace(found, mask=mask, contours=outlines_of(mask), factor=factor, score=0.0, base=found.mask)
        ms = (perf_counter() - begin) * 1e3
        if quick and ms > MAX_PREVIEW_MS:
            self._widest = max(MIN_PREVIEW_SIDE, self._widest // 2)
        return replace(found, ms=ms)

    def forget(self) -> None:
        """Drop what was found, and what is being found: the model is another one."""
        self._models += 1
        self._last = None

    def _copy(self, widest: int) -> tuple[Image, float]:
        """The image with a longer side of at most so many pixels, and how many of its own are one of these."""
        longest = max(self.shape)
        if longest <= widest:
            return self.image, 1.0
        if widest not in self._copies:
            self._copies[widest] = _reduced(self.image, widest)
        return self._copies[widest], longest / widest

    def _bounds(self, shape: tuple[int, int]) -> Bounds:
        rows, columns = (
            ((np.arange(few) + 0.5) * many / few).astype(int) for few, many in zip(shape, self.shape, strict=True)
        )

        def seen(mask: Image | None) -> Image | None:
            return mask if mask is None or mask.shape != self.shape else mask[np.ix_(rows, columns)]

        masks = self._masks
        return Bounds(domain=seen(masks.domain), start_mask=seen(masks.start), background=seen(masks.background))

    def _grown(
        self, image: Image, factor: float, picked: ImagePicks, params: Parameters, base: Mask | None, *, draft: bool
    ) -> PickedRegion:
        shape = (image.shape[0], image.shape[1])
        if base is not None and not picked.grows:
            levels = base.view(np.uint8) * np.uint8(255)
            mask = base if factor == 1 else _reduced(levels, max(shape))[:, :, 0] > 127
            ignored = picked.nots or picked.probability is not None or picked.clearance is not None
            said = "on a region that was there, points outside and levels count once there is a start inside; use the brush"
            return PickedRegion(mask, outlines_of(mask), factor, said if ignored else "", source="run")
        empty = PickedRegion(np.zeros(shape, np.bool_), (), factor)
        if not picked.grows and not proposes(params):
            return empty
        start = replace(picked.start or Start(), found=params.edges.model is not None)
        try:
            own = smaller(start.placed(params, self.shape), factor)
            result = segment(Scene(image, own, draft=draft, **self._bounds(shape)))
        except FfsegError as error:
            wrong = error if factor == 1 else self._wrong_start(start, params) or error
            return replace(empty, said=str(wrong))
        return PickedRegion(
            result.mask, result.contours, factor, "; ".join(result.messages), result.source, float(result.score)
        )

    def _wrong_start(self, start: Start, params: Parameters) -> FfsegError | None:
        try:
            start_contours(self.shape, start.placed(params, self.shape), self._masks.start)
        except FfsegError as error:
            return error
        return None


def _reduced(image: Image, longest: int) -> Image:
    """A copy in colour whose longer side has so many pixels."""
    return scaled_down(image, round(image.shape[1] * longest / max(image.shape[:2])))[0]
