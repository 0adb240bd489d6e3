"""The structural test of Eq. 9: which enclosed components are marks on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Array
from ffseg.freespace.corners import Matches, match_corners
from ffseg.freespace.motion.ground import GroundFit, shared_doubt
from ffseg.freespace.outlines import outline_votes
from ffseg.freespace.pairs import MIN_SIGMAS, ImagePair, motion_uncertainty
from ffseg.image.components import Component
from ffseg.image.interest import InterestPoints

Verdict = Literal["obstacle", "false_obstacle", "untested"]

MIN_AREA = 30
"""Pixels: in smaller components a corner's patch of 9x9 pixels shows more of the surroundings than of the component."""
MIN_FLAT = 4
"""Samples that must vote for the ground before a component is merged."""
MIN_SAMPLES = 6
"""Samples and corners together that suffice where nothing votes against: of a line along the robot's path only the ends
are informative."""
LOW_PER_HIGH = 5
"""Corners certainly on the ground that outweigh one found above it: the gates let one wrong match in six pass."""
MAX_RAISED = 0.2
"""Largest fraction of the voting samples that may vote against the ground. Measured on rendered pairs: marks 0, boxes
0.57 and more."""


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

    References
    ----------
    Eq. 9 of the paper. Differs: samples of the outline must be flat as well.

    Examples
    --------
    >>> sequence = ffseg.Sequence(ffseg.load_camera("pictures/pair/camera.yaml"))
    >>> first, second = (sequence.feed(ffseg.read_image(f"pictures/pair/{name}.png")) for name in ("0001", "0002"))
    >>> box = second.components[1]
    >>> box.verdict, box.matched_points > 0, box.max_altitude_m > 0.08
    ('obstacle', True, True)
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


def structural_test(
    pair: ImagePair,
    components: Sequence[Component],
    epsilon: float,
    fit: GroundFit | None = None,
    samples: list[Array] | None = None,
    corners: InterestPoints | None = None,
) -> tuple[ComponentVerdict, ...]:
    """Verdict on every component of a pair.

    Parameters
    ----------
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
        The components' ``MAX_CORNERS`` strongest Harris corners, where they were looked for already.

    Notes
    -----
    Eq. 9. Differs: a component is merged only if, besides its matched interest points, the samples of its outline are
    found again where flat paint would be. A box of which only the base was matched so stays an obstacle, and one wrong
    match neither merges a box nor keeps a mark.
    """
    doubt = shared_doubt(pair.motion, len(components)) if fit is None else fit.without(len(components))
    places = [component.centroid for component in components]
    areas = [component.area for component in components]
    large = np.array(areas, np.intp) >= MIN_AREA
    uncertainty = motion_uncertainty(pair, np.array(places).reshape(-1, 2), doubt, fit)
    votes = _corner_votes(match_corners(pair, components, epsilon, uncertainty, corners), len(components), epsilon)
    flat, raised = np.zeros((2, len(components)), np.intp)
    on_ground = np.flatnonzero(votes.on_ground).tolist()
    own = [components[place] for place in on_ground]
    flat[on_ground], raised[on_ground] = outline_votes(pair, own, epsilon, uncertainty.of(on_ground), samples)
    spoken = (flat >= MIN_FLAT) | ((flat >= 2) & (raised == 0) & (votes.high == 0) & (flat + votes.low >= MIN_SAMPLES))
    merged = large & votes.on_ground & doubt.known & spoken & (raised <= MAX_RAISED * (flat + raised))
    tested = large & doubt.known & (votes.matched > 0)
    stands = tested & ((votes.high >= 2) | (raised > np.maximum(MIN_FLAT, MAX_RAISED * (flat + raised))))
    return tuple(
        ComponentVerdict(
            component.index, areas[place], *places[place],
            int(votes.matched[place]), float(votes.highest[place]),
            "false_obstacle" if merged[place] else "obstacle" if tested[place] else "untested",
            int(flat[place]), int(raised[place]), bool(merged[place] | stands[place] | ~large[place]),
        )
        for place, component in enumerate(components)
    )  # fmt: skip


def untested_verdicts(components: Sequence[Component]) -> tuple[ComponentVerdict, ...]:
    """Verdicts on components without any match."""
    return tuple(ComponentVerdict(c.index, c.area, *c.centroid, 0, float("nan"), "untested", 0, 0) for c in components)


@dataclass(frozen=True, slots=True, eq=False)
class _CornerVotes:
    """Votes of the matched corners of every component, shape (count,) each."""

    matched: NDArray[np.intp]
    low: NDArray[np.intp]
    high: NDArray[np.intp]
    highest: Array
    on_ground: NDArray[np.bool_]


def _corner_votes(matches: Matches, count: int, epsilon: float) -> _CornerVotes:
    owner, altitude = matches.owner[matches.good], matches.altitude[matches.good]
    sure = altitude + MIN_SIGMAS * matches.altitude_sigma[matches.good] < epsilon
    low = np.bincount(owner[sure], minlength=count)
    high = np.bincount(owner[altitude >= epsilon], minlength=count)
    matched = np.bincount(owner, minlength=count)
    highest = np.full(count, -np.inf)
    np.maximum.at(highest, owner, altitude)
    highest[matched == 0] = np.nan
    return _CornerVotes(matched, low, high, highest, (low > 0) & (high * LOW_PER_HIGH <= low))
