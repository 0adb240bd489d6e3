"""The source ``hints``: evidence from several clicks, applied one after another, each a correction of the state before it.

The state is a plane of log odds of inside. It begins as the prior's log odds for the first start, or as those of a model, a map
or boxes. A later click gives new log odds, learned from it and all clicks before it (`ffseg.evidence.hints`); they replace the
old ones only where they put pixels on the side of that click, connected with it and near it (`CLICK_REACH`): a click mends the
error that it was made for, others beside it, and little else. While there are none outside, what the prior says from all circles
at once counts if it is surer: they may be samples of many things. Circles and points outside have an order each, and points may
say after how many circles they came; otherwise the one deeper in the present error is applied first, as a user would click.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from ffseg.arrays import Mask, Plane
from ffseg.contour import contour, tried
from ffseg.evidence import hints, prior
from ffseg.evidence.features import enlarged, reduced_mean
from ffseg.evidence.gradient import gradient
from ffseg.evidence.hints import HELD_RADIUS
from ffseg.evidence.maps import expected_overlap, log_odds, odds_edges
from ffseg.evidence.prior import MAX_LOG_ODDS, appearance_of, shown_by_starts
from ffseg.evidence.recent import Recent, digest_of
from ffseg.evidence.surroundings import STRIDE, strided
from ffseg.image.appearance import Appearance, reduced_shape, reduction
from ffseg.image.edges import PRIOR_CALIBRATION, EdgeMap, ScoreCalibration
from ffseg.image.free import distances
from ffseg.image.opencv_peers import dilated_by_disc
from ffseg.image.parts import parts_holding
from ffseg.image.raster import rasterize
from ffseg.parameters import Seed
from ffseg.scene import Scene
from ffseg.starts.boxes import in_boxes
from ffseg.starts.initial import circle_start, middles
from ffseg.starts.rivals import add_disc, disc_of, seeds

if TYPE_CHECKING:
    from ffseg.evidence.closer import Crop, Crops

CLICK_REACH = 4.0
"""Radius within which a click counts, in units of its depth: the distance from the click to the nearest pixel of its side."""

MOST_TAKEN = 0.1
"""Most of the region, as a fraction, that a click which mends an error takes away where it does not count. Of 237 clicks in leaks
of what models say of drawings, 74 took more and lost .12 of the IoU by it; what the others took away changed the IoU by .001."""

MOST_CORRECTIONS = 20
"""So many clicks are counted where segmentation by clicks is measured; more circles, and none outside, are no corrections but
samples, which the prior sees at once: a hundred discs in noise take a thirtieth of the time, with an IoU of .83 to .94 for .86 to
.90."""

HALF = 0.5

CACHED_STATES = 64
"""States kept in memory, of the current image and the one before, so that one more click does not repeat the earlier ones."""


@dataclass(frozen=True, slots=True)
class Click:
    """A disc that lies inside or outside, pixels; with the number of circles that came before it, where that is known."""

    x: float
    y: float
    radius: float
    inside: bool
    after: float | None = None


@dataclass(frozen=True, eq=False)
class ClickedImage:
    """An image with what is known about it before any click.

    Attributes
    ----------
    appearance : Appearance
        The image, of shape (H, W) or (H, W, 3), as the prior sees it.
    inside, outside : ndarray of bool, shape (H, W)
        Pixels known to lie there before the clicks, at least one inside.
    base : ndarray of float32, shape (H, W), or None
        Log odds of inside from a model, a map of the image or boxes; None stands for the prior's.
    level : float
        Log odds at which the region ends.
    within : ndarray of bool, shape (H, W), or None
        Pixels of the domain; None means all.
    ask : callable, optional
        Gives the base from other pixels inside, shape (H, W) both; None where it does not depend on these.
    parts : bool
        Whether all parts of the base's region are meant, and not those alone that hold what is known to lie inside.
    """

    appearance: Appearance
    inside: Mask
    outside: Mask
    base: Plane | None
    level: float
    within: Mask | None
    ask: Callable[[Mask], Plane] | None = None
    parts: bool = False

    @property
    def factor(self) -> int:
        """Pixels a side of the image that became one of the reduced image."""
        return self.appearance.factor

    def reduced(self, plane: Plane) -> Plane:
        """A plane of the image at every `STRIDE`-th pixel of the reduced one, shape (h, w)."""
        return strided(reduced_mean(plane, self.factor))

    @cached_property
    def reduced_base(self) -> Plane | None:
        """The base, in such a plane."""
        return None if self.base is None else self.reduced(self.base)

    def base_from(self, inside: Mask) -> Plane | None:
        """The base from these pixels inside, in such a plane."""
        return self.reduced_base if self.ask is None else self.reduced(self.ask(inside))

    def region(self, pixels: Mask) -> Mask:
        """Evaluated pixels at least half of which lie in a region or, if there are none, any that touch it."""
        shares = self.reduced(pixels.astype(np.float32))
        if not shares.any():
            shares = reduced_mean(pixels.astype(np.float32), self.factor * STRIDE)
        return shares >= HALF if (shares >= HALF).any() else shares > 0

    def enlarged(self, plane: Plane | Mask) -> Plane:
        """Such a plane at the size of the image."""
        return enlarged(plane.astype(np.float32), self.factor, self.inside.shape, STRIDE)

    def disc(self, click: Click) -> Mask:
        """The disc of a click in such a plane; the pixel in its middle always belongs to it."""
        height, width = reduced_shape(reduced_shape(self.inside.shape, self.factor), STRIDE)
        row, column = (((at + 0.5) / self.factor - 0.5) / STRIDE for at in (click.y, click.x))
        found = np.zeros((height, width), np.bool_)
        add_disc(found, column, row, click.radius / (self.factor * STRIDE))
        found[min(max(round(row), 0), height - 1), min(max(round(column), 0), width - 1)] = True
        return found

    def correction(self, before: ClickState, disc: Mask, inside: bool, first_outside: bool) -> hints.Correction:
        """A click on this disc, as a correction of a state."""
        region = before.odds > self.level
        depth = float(distances(~region if inside else region)[disc].max())
        return hints.Correction(disc, inside, before.odds, depth, first_outside and not inside)

    def near(self, click: hints.Correction) -> Mask:
        """Where a click counts."""
        return distances(~click.disc) <= CLICK_REACH * click.depth

    def known(self, clicks: Sequence[Click]) -> tuple[Mask, Mask]:
        """Pixels known to lie inside and outside after several clicks; what both claim lies inside."""
        inside, outside = self.inside.copy(), self.outside.copy()
        for click in clicks:
            add_disc(inside if click.inside else outside, click.x, click.y, click.radius)
        if self.within is not None:
            inside &= self.within
        return inside, outside & ~inside

    def expected_overlap(self, state: ClickState) -> float:
        """Expected IoU of a state's region if its log odds are right."""
        return expected_overlap(state.odds - np.float32(self.level), state.stays)

    @cached_property
    def key(self) -> tuple[float, bool, bytes]:
        """Equal where all states are: of the image and the base they see the reduced planes."""
        seen = digest_of(self.appearance.lab, self.inside, self.outside, self.reduced_base, self.within)
        return self.level, self.parts, seen


@dataclass(frozen=True, slots=True, eq=False)
class ClickState:
    """The evidence after some clicks, at every `STRIDE`-th pixel of the reduced image.

    Attributes
    ----------
    odds : ndarray of float32, shape (h, w)
        Log odds of inside.
    counted : ndarray of bool, shape (h, w)
        Where a click has counted.
    stays : ndarray of bool, shape (h, w)
        The region: components that hold a click inside, and those that clicks outside have cut off; where parts are meant all.
    """

    odds: Plane
    counted: Mask
    stays: Mask


def hint_edges(scene: Scene) -> EdgeMap:
    """Edges of the region given by clicks: the source ``hints``."""
    return with_clicks(scene, gradient(scene))


def with_clicks(
    scene: Scene,
    own: EdgeMap,
    base: Plane | None = None,
    ask: Callable[[Mask], Plane] | None = None,
    calibration: ScoreCalibration = PRIOR_CALIBRATION,
) -> EdgeMap:
    """Edges where the evidence falls to ``region.probability``; the image's own if both sides show the same colours.

    Parameters
    ----------
    base : ndarray of float32, shape (H, W), optional
        Log odds of inside that clicks correct, from a model, a map of the image or boxes; the prior's if None. Without
        boxes, they are not used if the first start lies wholly outside the region that they give, unless all its parts are meant.
    ask : callable, optional
        Gives the base from another start region, if it depends on that.
    calibration : ScoreCalibration
        What the base promises.

    Raises
    ------
    SegmentationError
        If a click outside lies in the start region or beyond the image.
    """
    level = log_odds(scene.params.region.probability)
    if scene.boxes and base is not None:
        scene = _in_boxes(scene, base - np.float32(level))
    if base is not None and not (scene.boxes or scene.params.region.islands == "all"):
        first, _ = _first(scene, shown_by_starts(scene))
        if first.any() and base[first].max() <= level:
            base, ask, calibration = None, None, PRIOR_CALIBRATION
    said = ""
    if base is None and scene.pointed and not scene.boxes and reduction(scene.shape) > 1:
        scene, said, found = _seen_closer(scene)
    else:
        found = _told(scene, base, ask, samples=base is None and _are_samples(scene))
    core = shown_by_starts(scene)
    outside = seeds(scene.params.init.background, core, scene.background)
    if found is None:
        return own
    odds = found.odds
    odds[dilated_by_disc(core, HELD_RADIUS)] = MAX_LOG_ODDS
    odds[outside], odds[core] = -MAX_LOG_ODDS, MAX_LOG_ODDS
    edges = odds_edges(odds, scene.params.region.probability, own, "hints")
    if edges is own:
        return own
    edges = replace(edges, kept=found.kept, calibration=calibration.after(found.corrections))
    if outside.any():
        edges = replace(edges, domain=np.where(~outside, np.uint8(255), np.uint8(0)))
    return tried(contour(replace(scene, edges=edges, callback=None)), said) if said else edges


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """What clicks tell of an image.

    Attributes
    ----------
    odds : ndarray of float32, shape (H, W)
        Log odds of inside.
    kept : ndarray of bool, shape (H, W)
        The region.
    corrections : int
        Clicks beside the first, which have corrected what it shows or shown more.
    """

    odds: Plane
    kept: Mask
    corrections: int


def _are_samples(scene: Scene) -> bool:
    """Whether circles show what is inside all at once, and none corrects what another shows."""
    return len(scene.params.init.circles) > MOST_CORRECTIONS and not scene.clicked_outside


def _told(
    scene: Scene,
    base: Plane | None = None,
    ask: Callable[[Mask], Plane] | None = None,
    *,
    samples: bool = False,
) -> Told | None:
    """What all clicks tell; None if none lies inside, or both sides show the same colours and there is no base."""
    inside, within = shown_by_starts(scene), None if scene.limits is None else scene.limits > 0
    first, circles = (inside, []) if samples else _first(scene, inside)
    points = [_outside(point, scene.shape) for point in scene.params.init.background]
    if not first.any():
        return None
    beyond = np.zeros_like(first) if scene.background is None else scene.background > 0
    level, parts = log_odds(scene.params.region.probability), scene.params.region.islands == "all"
    clicked = ClickedImage(appearance_of(scene), first, beyond, base, level, within, ask, parts)
    state = state_after_all(clicked, circles, points)
    more = len(scene.params.init.circles) - 1 if samples else len(circles)
    corrections = more + len(points) + (scene.background is not None)
    return None if state is None else Told(*_at_full_size(clicked, state), corrections)


def _seen_closer(scene: Scene) -> tuple[Scene, str, Told | None]:
    """What all clicks tell in crops or, if they lie in several, in the whole image, whichever promises more.

    With the scene, in crops with what has no radius as clicks of these, and with what to say of that.
    """
    from ffseg.evidence.closer import as_seen, crops_of_starts

    seen, level = crops_of_starts(scene), np.float32(log_odds(scene.params.region.probability))
    closer, said = as_seen(scene, seen)
    looks = [(closer, said, _told_closer(closer, seen))]
    if len(set(seen)) > 1:
        looks.append((scene, "", _told(scene, samples=_are_samples(scene))))
    return max(looks, key=lambda look: 0 if look[2] is None else expected_overlap(look[2].odds - level, look[2].kept))


def _told_closer(scene: Scene, seen: Sequence[Crops]) -> Told | None:
    """What all clicks tell, each in the crop that its start is seen in, or in the first wider one that does not cut that."""
    from ffseg.evidence.closer import part_with

    samples = _are_samples(scene)
    found: list[tuple[Crop | None, Told | None]] = []
    whole = [number for number, crops in enumerate(seen) if not crops]
    for crops in dict.fromkeys(filter(None, seen)):
        here = [number for number, one in enumerate(seen) if one == crops]
        looks = ((crop, _told(part_with(scene, here, crop), samples=samples)) for crop in crops)
        look = next(((crop, told) for crop, told in looks if told is not None and not crop.cuts(told.kept)), None)
        if look is None:
            whole += here
        else:
            found.append(look)
    if whole:
        found.append((None, _told(part_with(scene, sorted(whole)), samples=samples)))
    return _joined([(crop, told) for crop, told in found if told is not None], scene.shape)


def _joined(found: Sequence[tuple[Crop | None, Told]], shape: tuple[int, int]) -> Told | None:
    """What is told of crops, or of the whole image, as one."""
    if not found:
        return None
    odds, kept = np.full(shape, -MAX_LOG_ODDS, np.float32), np.zeros(shape, np.bool_)
    for crop, told in found:
        part = (...,) if crop is None else crop.rows_and_columns
        np.maximum(odds[part], told.odds, out=odds[part])
        kept[part] |= told.kept
    return Told(odds, kept, sum(told.corrections for _, told in found))


def _in_boxes(scene: Scene, odds: Plane) -> Scene:
    """The scene with starts in the regions found in its boxes, without what is known to lie outside."""
    outside = seeds(scene.params.init.background, np.zeros(scene.shape, np.bool_), scene.background)
    contour = replace(scene.params.contour, balloon=abs(scene.params.contour.balloon))
    circles = tuple(circle_start(circle, scene.params) for circle in scene.params.init.circles_in(scene.shape))
    starts = circles or middles(scene.params, scene.shape)  # what closes in has the boxes themselves
    growing = replace(scene, starts=starts, params=replace(scene.params, contour=contour))
    return in_boxes(growing, np.where(outside, np.float32(-MAX_LOG_ODDS), odds))


def _outside(point: Seed, shape: tuple[int, int]) -> Click:
    return Click(*disc_of(point, shape), False, point[3] if len(point) == 4 else None)


def _first(scene: Scene, inside: Mask) -> tuple[Mask, list[Click]]:
    """What is known to lie inside at the beginning, and the circles that follow: of circles alone, the first comes first."""
    given = () if scene.start_mask is not None else scene.params.init.circles_in(scene.shape)
    circles = [Click(*circle, True, number) for number, circle in enumerate(given)]
    begun = rasterize(scene.starts[len(circles) :], scene.shape) & inside
    for start, _ in zip(scene.starts, given, strict=False):
        if begun.any():
            break
        begun, circles = rasterize([start], scene.shape) & inside, circles[1:]
    return begun, circles


def state_after_all(clicked: ClickedImage, circles: Sequence[Click], points: Sequence[Click]) -> ClickState | None:
    """The state after all clicks, ordered on each side; None if both sides show the same colours and there is no base."""
    done, lines = tuple[Click, ...](), [list(circles), list(points)]
    state = _states.get((clicked.key,), partial(_state_before, clicked))
    first_outside = not clicked.outside.any()
    while state is not None and any(lines):
        left = [line for line in lines if line]
        next_ones = [clicked.correction(state, clicked.disc(line[0]), line[0].inside, first_outside) for line in left]
        at = _next_side([line[0] for line in left], [one.depth for one in next_ones])
        done = (*done, left[at].pop(0))
        first_outside &= done[-1].inside
        state = _states.get((clicked.key, *done), partial(_state_after, clicked, state, done, next_ones[at]))
    return state


def _next_side(next_ones: Sequence[Click], depths: Sequence[float]) -> int:
    """Which of the next clicks comes first, as a circle and a point say; if they do not, the one deeper in the error."""
    circle, point = next_ones[0], next_ones[-1]
    if circle.inside and not point.inside and circle.after is not None and point.after is not None:
        return int(circle.after >= point.after)
    return depths.index(max(depths))


_states = Recent[ClickState | None](CACHED_STATES)
_views = Recent[prior.PriorView](1)


def _view(clicked: ClickedImage, inside: Mask) -> prior.PriorView:
    """The prior's view from a region; the last one is kept, as clicks outside do not change it."""
    return _views.get((clicked.key, digest_of(inside)), partial(prior.prior_view, clicked.appearance, inside))


def _state_before(clicked: ClickedImage) -> ClickState | None:
    """The state before any click, corrected by a mask of what lies outside, if there is one."""
    odds = clicked.reduced_base
    if odds is None:
        odds = _view(clicked, clicked.inside).cautious_odds
    state = first_state(clicked, odds, clicked.inside)
    if not clicked.outside.any():
        return state
    return _state_after(clicked, state, (), clicked.correction(state, clicked.region(clicked.outside), False, True))


def first_state(clicked: ClickedImage, odds: Plane, inside: Mask) -> ClickState:
    """The state with these log odds, and nothing corrected: the components that hold what is known to lie inside, or all."""
    region = odds > clicked.level
    stays = region if clicked.parts else parts_holding(region, clicked.region(inside))
    return ClickState(odds, np.zeros(odds.shape, np.bool_), stays)


def _state_after(
    clicked: ClickedImage, before: ClickState, done: Sequence[Click], click: hints.Correction
) -> ClickState | None:
    """The state after several clicks, of which the last is this correction.

    While there are none outside, clicks may also be samples of many things: then the prior sees all of them at once, and what is
    surer of its own region counts.
    """
    inside, outside = clicked.known(done)
    answer = hints.hints(partial(_view, clicked), inside, outside, click, clicked.base_from)
    if answer is None:
        return None if clicked.base is None else before
    corrected = _within_reach(clicked, before, *answer, inside, click)
    if outside.any() or clicked.base is not None:
        return corrected
    (shown, _), _ = hints.showing(inside, outside)
    return max(
        corrected, first_state(clicked, _view(clicked, shown).cautious_odds, inside), key=clicked.expected_overlap
    )


def _within_reach(
    clicked: ClickedImage, before: ClickState, near: Plane, elsewhere: Plane, inside: Mask, click: hints.Correction
) -> ClickState:
    """The state after a click; if it mends an error, without what it shows apart or elsewhere where that takes much away."""
    after = partial(next_state, clicked, before, near, inside=inside, click=click)
    states = (after(elsewhere, apart=apart) for apart in (True, False))
    if click.depth == 0 or not click.shows_both:
        return next(states)
    mended = after(before.odds, apart=False)
    most = MOST_TAKEN * np.count_nonzero(mended.stays)
    return next((one for one in states if np.count_nonzero(mended.stays & ~one.stays) <= most), mended)


def next_state(
    clicked: ClickedImage,
    before: ClickState,
    near: Plane,
    elsewhere: Plane,
    inside: Mask,
    click: hints.Correction,
    *,
    apart: bool = True,
) -> ClickState:
    """The state after a click: log odds `near` where they put pixels near it on its side, `elsewhere` in other places.

    Parameters
    ----------
    apart : bool
        Whether pixels that change hang together with the click over such as are on its side anyway, too.
    """
    disc, counts = click.disc, (near > clicked.level) == click.inside
    if not apart:
        counts &= (elsewhere > clicked.level) != click.inside
    counted = parts_holding(counts & clicked.near(click) | disc, disc)
    odds = np.where(counted, near, elsewhere)
    region = odds > clicked.level
    stays = before.stays & region
    if click.inside:
        stays |= parts_holding(region | disc, disc)
    elif not clicked.parts:
        stays = parts_holding(stays, clicked.region(inside) | (distances(stays) >= click.depth))
    return ClickState(odds, before.counted | counted, stays)


def _at_full_size(clicked: ClickedImage, state: ClickState) -> tuple[Plane, Mask]:
    """Log odds and region at the size of the image; where no click counted, with the details of the base."""
    odds = clicked.enlarged(state.odds)
    if clicked.base is not None and clicked.reduced_base is not None:
        rest = clicked.base + clicked.enlarged(state.odds - clicked.reduced_base)
        odds = np.where(clicked.enlarged(state.counted) > HALF, odds, rest)
    return odds, (clicked.enlarged(state.stays) >= HALF) & (odds > clicked.level)
