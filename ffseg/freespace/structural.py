"""The structural test of Eq. 9: which enclosed components are paint on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion
from ffseg.freespace.motion.evidence import MOST_CORNERS
from ffseg.freespace.motion.ground import Doubt, GroundFit, position_slopes, shared_doubt
from ffseg.image.components import Component
from ffseg.image.interest import InterestPoints, harris_points, outline_points
from ffseg.image.keypoints import (
    Alignments,
    Array,
    Candidates,
    Grey,
    align_patches,
    limited,
    patch_scores,
    plane_candidates,
)  # fmt: skip

Verdict = Literal["obstacle", "false_obstacle", "untested"]

MOST_OUTLINE = 22
"""Outline samples per component: one every few pixels of a mark of middling size."""
CORNER_RADIUS = 4
OUTLINE_RADIUS = 3
OUTLINE_STEPS = 4
"""A sample on the ground starts where it belongs and takes two; one that needs more is not on the ground."""

LEAST_SCORE = 0.85
"""Correlation of a right match; wrong ones of 9x9 patches rarely pass 0.7."""
HOPELESS = 0.5
"""Correlation of every second row and column of a patch below which the whole will not come near a right match."""
RIVAL = 2.5
"""Pixels from the best place beyond which a second peak is another place."""
RIVAL_MARGIN = 0.03
"""A second peak this close in correlation makes a match ambiguous: it then says nothing."""
REPROJECTION_GATE = 2.0
"""Pixels across the epipolar curve: rays that miss each other by a pixel in either image."""
NOISE_PX = 0.2
"""Standard deviation of a match per axis: what rendered and measured board corners show."""
CONFIDENT = 2.0
"""Standard deviations that an altitude must keep from the threshold to speak."""


@dataclass(frozen=True, slots=True, eq=False)
class ImagePair:
    """Two images of one camera and the motion between them.

    Attributes
    ----------
    current, previous : ndarray of uint8, shape (H, W)
    camera : Camera
        With its true ``up`` at the current image.
    motion : Motion
    noise : float
        Standard deviation of the pixels' noise, grey levels.
    """

    current: Grey
    previous: Grey
    camera: Camera
    motion: Motion
    noise: float = 0.0


@dataclass(frozen=True, slots=True)
class ComponentVerdict:
    """A row of ``obstacles.csv``.

    Attributes
    ----------
    component : int
    area_px : int
    centroid_x, centroid_y : float
        Pixels.
    matched_points : int
        Interest points found again and consistent with the motion.
    max_altitude_m : float
        Largest altitude among them, metres; NaN without any.
    verdict : str
        ``obstacle``, ``false_obstacle`` or ``untested``.
    flat, raised : int
        Outline samples that speak for the ground and against it; 0 where the corners alone keep the component.
    decided : bool
        Whether the pair settled it: merged, or something on it surely stands up. What is not settled is worth asking of
        another pair.
    ground_x_m, ground_y_m : float
        Where the centroid lies if it is on the ground: metres in the levelled camera frame of the image.
    against : str
        Name of the image it was judged against; empty when untested.
    track : int
        Number of the thing along a sequence; -1 where nobody counts.
    """

    component: int
    area_px: int
    centroid_x: float
    centroid_y: float
    matched_points: int
    max_altitude_m: float
    verdict: Verdict
    flat: int
    raised: int
    decided: bool = False
    ground_x_m: float = float("nan")
    ground_y_m: float = float("nan")
    against: str = ""
    track: int = -1


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Interest points with their matches.

    Attributes
    ----------
    owner : ndarray of int, shape (n,)
        Position of the point's component in the list.
    current, previous : ndarray of float64, shape (n, 2)
        Pixels.
    altitude, altitude_sigma : ndarray of float64, shape (n,)
        Metres.
    good : ndarray of bool, shape (n,)
        Unique, similar and consistent with the motion.
    """

    owner: NDArray[np.intp]
    current: Array
    previous: Array
    altitude: Array
    altitude_sigma: Array
    good: NDArray[np.bool_]


def structural_test(
    pair: ImagePair,
    components: Sequence[Component],
    epsilon: float,
    fit: GroundFit | None = None,
    samples: list[Array] | None = None,
    corners: InterestPoints | None = None,
) -> tuple[ComponentVerdict, ...]:
    """Verdict on every component.

    Parameters
    ----------
    pair : ImagePair
    components : sequence of Component
        Of the current image.
    epsilon : float
        ``obstacles.altitude``, metres.
    fit : GroundFit, optional
        How the motion was read off the ground: a component that had much to say in it is judged by the motion that the
        others give, so that no thing makes itself the ground.
    samples : list, optional
        Takes an array of shape (n, 3): x, y of each sample of an outline, and 1 where it speaks for the ground, -1
        against it, 0 where it says nothing.
    corners : InterestPoints, optional
        The components' ``MOST_CORNERS`` strongest Harris corners, where they were looked for already.

    Notes
    -----
    Eq. 9. Differs: a component is merged only if, besides its matched interest points, the samples of its outline are
    found again where flat paint would be. A box of which only the base was matched so stays an obstacle, and one wrong
    match neither merges a box nor keeps a mark.
    """
    doubt = shared_doubt(pair.motion, len(components)) if fit is None else fit.without(len(components))
    places = [component.centroid for component in components]
    areas = [component.area for component in components]
    large = np.array(areas, np.intp) >= LEAST_AREA
    sway = _sway(pair, np.array(places).reshape(-1, 2), doubt, fit)
    votes = _corner_votes(match_corners(pair, components, epsilon, sway, corners), len(components), epsilon)
    flat, raised = np.zeros((2, len(components)), np.intp)
    asked = np.flatnonzero(votes.on_ground).tolist()
    own = [components[place] for place in asked]
    flat[asked], raised[asked] = outline_votes(pair, own, epsilon, sway.of(asked), samples)
    spoken = (flat >= LEAST_FLAT) | ((flat >= 2) & (raised == 0) & (votes.high == 0) & (flat + votes.low >= LEAST_BOTH))
    merged = large & votes.on_ground & doubt.known & spoken & (raised <= MOST_RAISED * (flat + raised))
    told = large & doubt.known & (votes.matched > 0)
    stands = told & ((votes.high >= 2) | (raised > np.maximum(LEAST_FLAT, MOST_RAISED * (flat + raised))))
    return tuple(
        ComponentVerdict(
            component.index, areas[place], *places[place],
            int(votes.matched[place]), float(votes.highest[place]),
            "false_obstacle" if merged[place] else "obstacle" if told[place] else "untested",
            int(flat[place]), int(raised[place]), bool(merged[place] | stands[place] | ~large[place]),
        )
        for place, component in enumerate(components)
    )  # fmt: skip


def untested(components: Sequence[Component]) -> tuple[ComponentVerdict, ...]:
    """Rows of components that nothing could be matched for."""
    return tuple(ComponentVerdict(c.index, c.area, *c.centroid, 0, float("nan"), "untested", 0, 0) for c in components)


@dataclass(frozen=True, slots=True, eq=False)
class Sway:
    """What the doubt about the motion comes to in the previous image, at each component.

    Attributes
    ----------
    doubt : Doubt
    shift : ndarray of float64, shape (count, 2)
        Pixels by which the ground would be seen elsewhere.
    covariance : ndarray of float64, shape (count, 2, 2)
        Of that place, squared pixels.
    small : bool
        Whether it is so little that the middle of a component stands for all of it.
    """

    doubt: Doubt
    shift: Array
    covariance: Array
    small: bool

    def of(self, places: list[int]) -> Sway:
        """That of some of the components."""
        return Sway(self.doubt.of(places), self.shift[places], self.covariance[places], self.small)


SMALL_SWAY = 0.1
"""Pixels, half of what a match is good to: a third of it, by which a component's ends may differ, is lost in that."""


def _sway(pair: ImagePair, middles: Array, doubt: Doubt, fit: GroundFit | None) -> Sway:
    slopes = position_slopes(pair.camera, pair.motion, middles) if fit is None else fit.slopes_near(middles)
    shift, covariance = _expected(slopes, doubt, np.arange(len(middles)))
    worst = max(np.abs(shift).max(initial=0.0), np.sqrt(np.trace(covariance, axis1=1, axis2=2).max(initial=0.0)))
    return Sway(doubt, shift, covariance, bool(worst < SMALL_SWAY))


def match_corners(
    pair: ImagePair,
    components: Sequence[Component],
    epsilon: float,
    sway: Sway | None = None,
    corners: InterestPoints | None = None,
) -> Matches:
    """Match Harris corners of components along their epipolar curves and triangulate them.

    Along its curve a match is as high as the plane that puts the corner there, and the nearness of that plane (one over
    its distance from the camera) grows evenly with the way along the curve.
    """
    found = harris_points(pair.current, components, MOST_CORNERS) if corners is None else corners
    start, rate, nearness, unique = _sweep(pair, found.pixels, epsilon)
    aligned = align_patches(pair.current, pair.previous, found.pixels, start, CORNER_RADIUS)
    moved, covariance = _swayed(pair, found, sway)
    step = aligned.pixels - start.pixels[:, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        square = np.sum(rate**2, axis=1)
        along = np.sum(rate * (step - moved), axis=1) / square
        miss = np.sqrt(np.sum((step - moved - along[:, None] * rate) ** 2, axis=1))
        near = nearness + along
        altitude = pair.camera.mounting() - 1.0 / near
        sigma = np.sqrt(_match_variance(rate, start.warps[:, 0], covariance)) / (square * near**2)
    stayed = np.sum(step**2, axis=1) < RIVAL**2
    good = unique & stayed & (aligned.score > LEAST_SCORE) & (miss < REPROJECTION_GATE) & (near > 0)
    good &= np.isfinite(altitude) & np.isfinite(sigma)
    return Matches(found.owner, found.pixels, aligned.pixels, altitude, sigma, good)


def _match_variance(rate: Array, warps: Array, covariance: Array) -> Array:
    """Variance of ``rate . place``: noise of either image, the current one's through the warp, and the ground's doubt."""
    back = np.stack(
        [rate[:, 0] * warps[:, 0] + rate[:, 1] * warps[:, 2], rate[:, 0] * warps[:, 1] + rate[:, 1] * warps[:, 3]],
        axis=1,
    )
    noise = NOISE_PX**2 * (np.sum(rate**2, axis=1) + np.sum(back**2, axis=1))
    doubt = np.einsum("ni,nij,nj->n", rate, covariance, rate)
    variance: Array = noise + doubt
    return variance


def _swayed(pair: ImagePair, found: InterestPoints, sway: Sway | None) -> tuple[Array, Array]:
    """Where the others would put the ground of points, and the covariance of it."""
    if sway is None:
        doubt = shared_doubt(pair.motion, 1)
        return _expected(position_slopes(pair.camera, pair.motion, found.pixels), doubt, np.zeros_like(found.owner))
    if sway.small:
        return sway.shift[found.owner], sway.covariance[found.owner]
    return _expected(position_slopes(pair.camera, pair.motion, found.pixels), sway.doubt, found.owner)


HIGHEST = 0.7
"""Part of the mount height up to which altitudes are tried: above it a pixel sees the far wall past the thing's top."""
FINE_STEPS, COARSE_STEPS = 6, 21


@lru_cache(maxsize=4)
def _altitudes(mounting: float, epsilon: float) -> Array:
    """Altitudes tried: fine round the ground, then evenly in parallax up to ``HIGHEST``."""
    fine = np.linspace(-epsilon, epsilon, FINE_STEPS)
    nearness = np.linspace(1.0 / (mounting - epsilon), 1.0 / (mounting * (1.0 - HIGHEST)), COARSE_STEPS + 1)[1:]
    altitudes: Array = np.concatenate([fine, mounting - 1.0 / nearness])
    altitudes.setflags(write=False)
    return altitudes


def _sweep(pair: ImagePair, points: Array, epsilon: float) -> tuple[Candidates, Array, Array, NDArray[np.bool_]]:
    """Best candidate of each point over all altitudes, and how it moves.

    Returns the candidate, the rate at which its place moves with the nearness, that nearness, and whether no other place
    rivals it.
    """
    mounting = pair.camera.mounting()
    altitudes = _altitudes(mounting, epsilon)
    candidates = plane_candidates(pair.camera, pair.motion, points, altitudes)
    scores = patch_scores(pair.current, pair.previous, points, candidates, CORNER_RADIUS, HOPELESS)
    scores[np.isnan(scores)] = -1.0
    best = np.argmax(scores, axis=1) if scores.size else np.zeros(len(points), np.intp)
    rows, nearness = np.arange(len(points)), 1.0 / (mounting - altitudes)
    place, warp = candidates.pixels[rows, best], candidates.warps[rows, best]
    low, high = np.maximum(best - 1, 0), np.minimum(best + 1, len(altitudes) - 1)
    rate = candidates.pixels[rows, high] - candidates.pixels[rows, low]
    rate /= (nearness[high] - nearness[low])[:, None]
    top = scores[rows, best]
    step = candidates.pixels - place[:, None]
    away = step[..., 0] ** 2 + step[..., 1] ** 2 > RIVAL**2
    rival = np.where(away, scores, -1.0).max(axis=1, initial=-1.0)
    unique = (top > 0) & (rival < top - RIVAL_MARGIN)
    return Candidates(place[:, None], warp[:, None]), rate, nearness[best], unique


def outline_votes(
    pair: ImagePair,
    components: Sequence[Component],
    epsilon: float,
    sway: Sway,
    samples: list[Array] | None = None,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Samples of each component's edges that lie on the ground, and those that do not.

    A sample is aligned from where the ground would put it. Its displacement along the epipolar curve is an altitude,
    as certain as the edge crosses the curve; across the curve it must be small. Samples that cannot tell are left out.
    """
    found = outline_points(pair.current, components, MOST_OUTLINE)
    ground = plane_candidates(pair.camera, pair.motion, found.pixels, np.array([0.0, epsilon]))
    start = Candidates(ground.pixels[:, :1], ground.warps[:, :1])
    aligned = align_patches(pair.current, pair.previous, found.pixels, start, OUTLINE_RADIUS, OUTLINE_STEPS)
    shift, covariance = _swayed(pair, found, sway)
    flat, raised = _judge(aligned, ground, shift, covariance)
    tells = pair.noise**2 < MOST_NOISE * _contrast(pair.current, found.pixels)
    flat, raised, count = flat & tells, raised & tells, len(components)
    if samples is not None:
        samples.append(np.column_stack([found.pixels, flat.astype(np.float64) - raised]))
    return np.bincount(found.owner[flat], minlength=count), np.bincount(found.owner[raised], minlength=count)


def _contrast(grey: Grey, pixels: Array) -> Array:
    """Variance of the pixels round each sample, squared grey levels."""
    steps = np.arange(-OUTLINE_RADIUS, OUTLINE_RADIUS + 1)
    columns, rows = np.rint(pixels).astype(np.intp).T[..., None] + steps
    rows, columns = np.clip(rows, 0, grey.shape[0] - 1), np.clip(columns, 0, grey.shape[1] - 1)
    around = grey[rows[:, :, None], columns[:, None, :]].reshape(len(pixels), len(steps) ** 2).astype(np.float64)
    mean = around.mean(axis=1)
    variance: Array = np.einsum("ni,ni->n", around, around) / around.shape[1] - mean * mean
    return variance


def _expected(slopes: Array, doubt: Doubt, owner: NDArray[np.intp]) -> tuple[Array, Array]:
    """By how much the ground would put pixels elsewhere, shape (n, 2), and the covariance of it, shape (n, 2, 2)."""
    shift = np.einsum("nij,nj->ni", slopes, doubt.steps[owner])
    covariance: Array = slopes @ doubt.covariances[owner] @ np.swapaxes(slopes, 1, 2)
    return shift, covariance


def _judge(
    aligned: Alignments, ground: Candidates, moved: Array, covariance: Array
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    shift = aligned.pixels - ground.pixels[:, 0] - moved
    parallax = ground.pixels[:, 1] - ground.pixels[:, 0]
    information = limited(aligned.information, NOISE_PX)
    # (J^-1 + C)^-1, which holds for an edge's singular J as well.
    information = information @ _inverse(np.eye(2) + covariance @ information)
    weighted = np.einsum("nij,nj->ni", information, parallax)
    certainty = np.sum(weighted * parallax, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        altitude = np.sum(weighted * shift, axis=1) / certainty
        sigma = 1.0 / np.sqrt(certainty)
        left = shift - altitude[:, None] * parallax
        miss = np.einsum("ni,nij,nj->n", left, information, left)
        similar = aligned.score > LEAST_SCORE
        raised = ~similar | (np.abs(altitude) - CONFIDENT * sigma > 1.0) | (miss > MISS_GATE)
        flat = similar & (np.abs(altitude) + CONFIDENT * sigma < 1.0) & ~raised
    seen = np.isfinite(aligned.score) & np.isfinite(parallax).all(axis=1)
    return flat & seen, raised & seen


def _inverse(matrices: Array) -> Array:
    """Inverses of matrices, shape (n, 2, 2), in closed form: a tenth of the time of the general routine."""
    a, b, c, d = matrices.reshape(-1, 4).T
    adjugate = np.stack([d, -b, -c, a], axis=1).reshape(-1, 2, 2)
    result: Array = adjugate / (a * d - b * c)[:, None, None]
    return result


MISS_GATE = 16.0
"""Four standard deviations across the epipolar curve."""


MOST_NOISE = 0.08
"""Part of a sample's contrast that may be noise: with twice as much right matches fall short of ``LEAST_SCORE``."""
LEAST_AREA = 30
"""Pixels; of a smaller component a corner's patch of 9x9 pixels shows more of what is round it than of itself."""
LEAST_FLAT = 4
"""Samples that must speak for the ground before anything is merged."""
LEAST_BOTH = 6
"""Samples and corners together that do as well where nothing contradicts: of a line along the way the robot took, only
its ends can tell."""
LOW_PER_HIGH = 5
"""Corners surely on the ground that outweigh one found above it: one wrong match in six is what gates let through."""
MOST_RAISED = 0.2
"""Share of the speaking samples that may contradict. Measured on rendered pairs: marks 0, boxes 0.57 and more."""


@dataclass(frozen=True, slots=True, eq=False)
class _CornerVotes:
    """What the matched corners of every component say, shape (count,) each."""

    matched: NDArray[np.intp]
    low: NDArray[np.intp]
    high: NDArray[np.intp]
    highest: Array
    on_ground: NDArray[np.bool_]


def _corner_votes(matches: Matches, count: int, epsilon: float) -> _CornerVotes:
    owner, altitude = matches.owner[matches.good], matches.altitude[matches.good]
    sure = altitude + CONFIDENT * matches.altitude_sigma[matches.good] < epsilon
    low = np.bincount(owner[sure], minlength=count)
    high = np.bincount(owner[altitude >= epsilon], minlength=count)
    matched = np.bincount(owner, minlength=count)
    highest = np.full(count, -np.inf)
    np.maximum.at(highest, owner, altitude)
    highest[matched == 0] = np.nan
    return _CornerVotes(matched, low, high, highest, (low > 0) & (high * LOW_PER_HIGH <= low))
