"""Contents of a rendered scene, and random scenes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ffseg.arrays import Array

MarkKind = Literal["mixed", "discs", "touching"]

GAP = 0.16
"""Metres of ground left between things: about a dozen pixels at the distances used, so that a contour passes."""
MAX_THING_DISTANCE = 1.9
"""Metres from the camera: beyond it 0.15 m are fewer than seven pixels of the mirror."""
ATTEMPTS = 400


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """Paint on the ground.

    Attributes
    ----------
    outline : ndarray of float64, shape (n, 2)
        Convex polygon on the ground, metres, in order.
    """

    outline: Array
    grey: float


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """A cuboid standing on the ground.

    Attributes
    ----------
    center, half : ndarray of float64, shape (2,)
        Centre on the ground and half the sides, metres.
    angle : float
        Radians.
    height : float
        Metres.
    greys : tuple of float
        Of the top and of the four sides.
    label_contrast : float
        Grey levels between a face and the label on it; 0 leaves the faces plain.
    squares : tuple of float or None
        Side, metres, and grey of the squares of a chequered pattern on all faces.
    """

    center: Array
    half: Array
    angle: float
    height: float
    greys: tuple[float, ...]
    label_contrast: float
    squares: tuple[float, float] | None = None

    def radius(self) -> float:
        """Radius of the circle round the footprint, metres."""
        return float(np.sqrt(np.sum(self.half**2)))


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """Four walls: a rectangle round the origin with half sides ``half``, turned by ``angle``.

    With ``shading`` (grey levels, metres) the grey swings by so much along the walls, over so long a wave, and the walls
    have neither skirting nor posters.
    """

    half: tuple[float, float]
    angle: float
    grey: float
    shading: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """What the ground is like.

    Attributes
    ----------
    texture_sigma : float or None
        Standard deviation of the ground's texture, grey levels, seen from nearby; None: that of the sample scenes.
    noise_sigma : float
        Standard deviation of the sensor's noise, grey levels.
    light : tuple of float or None
        Bearing, radians, and slope (height over length) of a light under which boxes throw shadows; None: no shadow.
    streak : tuple of float or None
        Bearing (radians, of the room), nearest and farthest distance from the camera, half width (metres), and grey
        levels added by a mirrored strip that moves with the camera; None: a dull floor.
    """

    texture_sigma: float | None = None
    noise_sigma: float = 1.2
    light: tuple[float, float] | None = None
    streak: tuple[float, float, float, float, float] | None = None


PLAIN_FLOOR = Floor()


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Everything that is seen."""

    marks: tuple[Mark, ...]
    boxes: tuple[Box, ...]
    room: Room
    ground_grey: float
    seed: int
    floor: Floor = PLAIN_FLOOR


@dataclass(frozen=True, slots=True, eq=False)
class _Spot:
    """Ground that a thing takes, seen from the camera: a circle and the shade a box throws behind it."""

    center: Array
    radius: float
    shade: float

    def clashes(self, other: _Spot) -> bool:
        """True when the view of one touches the other, or nearly so."""
        for along in np.linspace(0.0, 1.0, 6):
            for across in np.linspace(0.0, 1.0, 6):
                scale, other_scale = 1.0 + along * (self.shade - 1.0), 1.0 + across * (other.shade - 1.0)
                distance = np.hypot(*(self.center * scale - other.center * other_scale))
                if distance < self.radius * scale + other.radius * other_scale + GAP:
                    return True
        return False


def random_scene(seed: int, mount_height: float, clear_of: Array, marks_are: MarkKind = "mixed") -> World:
    """Draw a scene round a camera at the origin.

    Parameters
    ----------
    mount_height : float
        Of the camera, metres: decides what a box hides.
    clear_of : ndarray of float64, shape (2,) or (n, 2)
        Where the camera is at other times: nothing is put there.
    marks_are : str
        ``mixed``, ``discs`` (no corners) or ``touching`` (two of different greys side by side).
    """
    random = np.random.default_rng([seed, 1])
    ground = float(random.uniform(90, 130))
    room = Room(
        (float(random.uniform(2.6, 4.5)), float(random.uniform(2.6, 4.5))),
        float(random.uniform(0, np.pi)),
        float(random.uniform(150, 200)),
    )
    taken = [_Spot(place, 0.34, 1.0) for place in (np.zeros(2), *np.atleast_2d(clear_of))]
    boxes: list[Box] = []
    marks: list[Mark] = []
    wanted_boxes, wanted_marks = int(random.integers(2, 4)), int(random.integers(3, 6))
    for _ in range(ATTEMPTS):
        if len(boxes) < wanted_boxes:
            box = _random_box(random, ground)
            if _place(_Spot(box.center, box.radius(), mount_height / (mount_height - box.height)), taken):
                boxes.append(box)
        elif len(marks) < wanted_marks:
            drawn = _random_marks(random, ground, marks_are)
            outline = np.concatenate([mark.outline for mark in drawn])
            middle = outline.mean(axis=0)
            if _place(_Spot(middle, float(np.hypot(*(outline - middle).T).max()), 1.0), taken):
                marks.extend(drawn)
    return World(tuple(marks), tuple(boxes), room, ground, seed)


def _place(spot: _Spot, taken: list[_Spot]) -> bool:
    if any(spot.clashes(other) for other in taken):
        return False
    taken.append(spot)
    return True


def _random_spot(random: np.random.Generator, nearest: float) -> Array:
    distance, bearing = random.uniform(nearest, MAX_THING_DISTANCE), random.uniform(0, 2 * np.pi)
    return np.array([distance * np.cos(bearing), distance * np.sin(bearing)])


def _random_box(random: np.random.Generator, ground: float) -> Box:
    greys = np.clip(_contrasting(random, ground) + random.uniform(-12, 12, 5), 8, 247)
    return Box(
        center=_random_spot(random, 0.75),
        half=random.uniform(0.09, 0.22, 2),
        angle=float(random.uniform(0, np.pi)),
        height=float(random.uniform(0.18, 0.6)),
        greys=tuple(float(grey) for grey in greys),
        label_contrast=float(random.choice([0.0, 25.0, 50.0])),
    )


def _random_marks(random: np.random.Generator, ground: float, marks_are: MarkKind) -> list[Mark]:
    """One mark, or two that touch: the second is the first one moved sideways by its own width."""
    if marks_are != "touching":
        return [_random_mark(random, ground, 0 if marks_are == "discs" else None)]
    first = _random_mark(random, ground, 2)
    side = first.outline[1] - first.outline[0]
    normal = np.array([-side[1], side[0]]) if random.random() < 0.5 else np.array([side[1], -side[0]])
    grey = 15.0 if first.grey > ground else 225.0
    slid = first.outline + normal + side * random.uniform(-0.4, 0.4)
    away = np.sign((first.outline.mean(axis=0) - first.outline[0]) @ normal)
    return [first, Mark(slid if away > 0 else slid - 2 * normal, grey)]


def _random_mark(random: np.random.Generator, ground: float, kind: int | None = None) -> Mark:
    """A disc, a regular polygon, a tile or a road line, 0.15 to 1.5 m long."""
    center, angle = _random_spot(random, 0.6), random.uniform(0, 2 * np.pi)
    kind = int(random.integers(0, 4)) if kind is None else kind
    if kind == 3:
        length, width = random.uniform(0.5, 1.5), random.uniform(0.15, 0.18)
        outline = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [length / 2, width / 2]
    else:
        corners = (48, int(random.integers(3, 7)), 4)[kind]
        turns = 2 * np.pi * np.arange(corners) / corners
        size = random.uniform(0.15, 0.5) / 2
        outline = np.stack([np.cos(turns), np.sin(turns)], axis=1) * size * max(1.0, 1.5 * (corners == 3))
    c, s = np.cos(angle), np.sin(angle)
    return Mark(center + outline @ np.array([[c, s], [-s, c]]), _contrasting(random, ground))


def _contrasting(random: np.random.Generator, ground: float) -> float:
    """A grey at least 55 levels from the ground's."""
    dark = random.uniform(15, max(16.0, ground - 55))
    light = random.uniform(min(239.0, ground + 60), 240)
    return float(dark if random.random() < 0.5 else light)
