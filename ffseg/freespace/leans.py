"""Lean of the camera of a nodding robot at each frame of a drive, filtered over the leans that pairs show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Array
from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion
from ffseg.freespace.window import Link

MAX_LEAN_SIGMAS, MAX_NOD_SIGMAS = 3.0, 2.0
"""Factors by which the standard deviations that a pair states of its lean and its nod are enlarged: on 12 rendered
drives with nods of 2 degrees, the 90th percentiles of the normalised errors are 3 and 1.7 times those of a normal
distribution."""
LEAN_SIGMAS, MIN_PAIRS = 5.0, 4
"""Standard deviations (of one pair) that the mean lean of a drive must reach to be applied, and the least number of
pairs: on 20 rendered level drives it is 4.5 at most, and 1.7 in all but one."""
LEVEL: tuple[Array, float] = np.zeros(2), 0.0


@dataclass(frozen=True, slots=True)
class Lean:
    """Lean of the camera as measured by a pair.

    Attributes
    ----------
    x, y : float
        How much its up leans toward x and y of the frame that is levelled as the camera is mounted, radians.
    sigma, nod_sigma : float
        Standard deviations per axis of that, and of the nod since the earlier image, radians.
    """

    x: float
    y: float
    sigma: float
    nod_sigma: float


def lean_of(mounted: Camera | None, found: Camera | None, motion: Motion | None) -> Lean | None:
    """Lean of the camera as measured by a pair's motion; None where no ground was seen."""
    if mounted is None or found is None or motion is None or motion.spread is None:
        return None
    x, y = (mounted.level()[:2] @ found.up).tolist()
    nod, lean = np.sqrt(np.sum(motion.spread[:, 4:] ** 2, axis=0).reshape(2, 2).mean(axis=1)).tolist()
    return Lean(x, y, lean, nod)


class Leans:
    """Leans of the frames of a drive, by a Kalman filter.

    A pair shows to a hundredth of a degree by how much the camera nodded between its images, and to some tenths how it
    leans. How much this robot leans at all follows from its nods, as the difference of two leans: a level one is left level.
    """

    def __init__(self) -> None:
        self._known: dict[str, tuple[Array, float | None]] = {}  # lean and variance; None where only the others tell it
        self._seen = np.zeros(4)  # sums of the leans that pairs show, of their deviations, and their number
        self._nods = np.zeros(2)  # sum of squares of nods, to each side, and twice their number: one is two leans apart

    @property
    def informative(self) -> bool:
        """Whether any nod was measured."""
        return bool(self._nods[1])

    @property
    def usual(self) -> float:
        """Variance of this robot's lean on each axis."""
        return float(self._nods[0] / max(self._nods[1], 1.0))

    @property
    def mean(self) -> Array:
        """Mean lean of the camera: level, unless the pairs clearly show that it is mounted askew."""
        x, y, sigma, number = self._seen.tolist()
        surely = number >= MIN_PAIRS and np.hypot(x, y) > LEAN_SIGMAS * sigma
        return self._seen[:2] / number if surely else np.zeros(2)

    def of(self, name: str) -> tuple[Array, float]:
        """Lean of a frame, radians about x and y, and its standard deviation per axis."""
        lean, variance = self._known.get(name, LEVEL)
        return (self.mean, float(np.sqrt(self.usual))) if variance is None else (lean, float(np.sqrt(variance)))

    def follow(self, name: str, links: Sequence[Link], seen: Lean | None) -> None:
        """Advance by one frame: the lean that its pair measured, and the motion since earlier frames.

        The first frame learns from the second how it leaned.
        """
        link = next((one for one in links if one.name in self._known), None)
        if seen is None or link is None:
            self._known[name] = np.zeros(2), None
            return
        nod, (c, s) = np.array(link.nod), (np.cos(link.planar[2]), np.sin(link.planar[2]))
        self._nods += [0.5 * nod @ nod, 2.0]
        self._seen += [seen.x, seen.y, seen.sigma, 1.0]
        turn, added = np.array([[c, -s], [s, c]]), (MAX_NOD_SIGMAS * seen.nod_sigma) ** 2
        before, variance = self._known[link.name]
        first = variance is None
        lean, variance = (before - nod) @ turn, (self.usual if variance is None else variance) + added
        for other, its in ((self.mean, self.usual), (np.array([seen.x, seen.y]), (MAX_LEAN_SIGMAS * seen.sigma) ** 2)):
            share = variance / max(variance + its, 1e-18)
            lean, variance = lean + share * (other - lean), (1.0 - share) * variance
        self._known[name] = lean, variance
        if first:
            self._known[link.name] = turn @ lean + nod, variance + added
