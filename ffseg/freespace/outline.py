"""Free space of one image in metres: polygons with holes in the robot's frame, and a range scan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from ffseg.arrays import Array, Mask
from ffseg.camera.model import Camera
from ffseg.camera.motion import to_pixels, to_robot
from ffseg.errors import ParameterError
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.orientation import ring_area
from ffseg.image.free import deeper
from ffseg.image.polygons import polygons
from ffseg.image.resized import read_at

MAX_BEARINGS = 30_000
"""Bearings of a scan: one per 0.012 degrees."""
MAX_RANGE = 6.0
"""Metres: beyond, one pixel of a mirror over a robot covers a quarter of a metre, and an outline carries no information."""
RIM_PX = 2.5
"""Pixels: an outline this near to the end of the camera's view or of the domain is that end, and no obstacle."""
OUTLINE_SIGMA = 0.08
"""Pixels: standard deviation of an outline across itself. On rendered walls and boxes 68 % of errors are within .055, 95
% within .15."""
DECIMALS = 4
RING_DECIMALS = 6
"""Of outlines: 5 cm below a lens a pixel may be a twentieth of a millimetre, and outlines pass 0.02 px from one another."""

End = Literal["obstacle", "rim", "unknown"]


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """Ranges from the point below the camera, as of a laser scanner.

    Attributes
    ----------
    bearings : ndarray of float64, shape (n,)
        Radians, evenly from -pi, counterclockwise from the robot's front.
    ranges : ndarray of float64, shape (n,)
        Metres to where the free space ends; NaN where nothing was seen.
    std : ndarray of float64, shape (n,)
        Standard deviation, metres: what `OUTLINE_SIGMA` pixels come to on the ground, and the lean of a camera that leans.
    ends : tuple of str
        ``obstacle``; ``rim`` where the camera's view, the domain or the reach ends; ``unknown`` where nothing was seen.
    reach : float
        Metres.

    Examples
    --------
    >>> sequence = ffseg.Sequence(ffseg.load_camera("pictures/pair/camera.yaml"))
    >>> frame = sequence.feed(ffseg.read_image("pictures/pair/0001.png"))
    >>> scan = frame.scan(count=8)
    >>> scan.bearings.shape, set(scan.ends) <= {"obstacle", "rim", "unknown"}
    ((8,), True)
    """

    bearings: Array
    ranges: Array
    std: Array
    ends: tuple[End, ...]
    reach: float

    def document(self) -> dict[str, Any]:
        """The fields of a ``sensor_msgs/LaserScan`` without its header, and what they leave out.

        ``ranges`` holds None where no obstacle was seen; how far the ground is free there is in ``free``.
        """
        stops = [end == "obstacle" for end in self.ends]
        free = [None if np.isnan(one) else round(one, DECIMALS) for one in self.ranges.tolist()]
        return {
            "angle_min": float(self.bearings[0]),
            "angle_max": float(self.bearings[-1]),
            "angle_increment": 2.0 * np.pi / len(self.bearings),
            "range_min": 0.0,
            "range_max": self.reach,
            "ranges": [one if stop else None for one, stop in zip(free, stops, strict=True)],
            "free": free,
            "std": [None if np.isnan(one) else round(one, DECIMALS) for one in self.std.tolist()],
            "ends": list(self.ends),
        }

    def rows(self) -> list[list[Any]]:
        """Rows of bearing (degrees), range, standard deviation (metres) and end; empty cells where nothing was seen."""
        degrees = np.rad2deg(self.bearings).round(6).tolist()
        return [
            [angle, "", "", end] if np.isnan(far) else [angle, round(far, DECIMALS), round(std, DECIMALS), end]
            for angle, far, std, end in zip(degrees, self.ranges.tolist(), self.std.tolist(), self.ends, strict=True)
        ]


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """Free space in the robot's frame: x forward, y left, metres, the origin on the ground below the camera.

    Attributes
    ----------
    polygons : tuple of tuple of ndarray of float64, each (n, 2)
        Of each region its outer ring, counterclockwise, then its holes, clockwise; not closed by their first points.
    camera : Camera
    reach : float
        Metres: nothing farther away is told.
    seen : ndarray of bool, shape (H, W)
        Pixels of the scene within reach that can show ground at all.
    lean_sigma : float
        Standard deviation of the camera's lean where it leans, radians.

    Examples
    --------
    >>> sequence = ffseg.Sequence(ffseg.load_camera("pictures/pair/camera.yaml"))
    >>> frame = sequence.feed(ffseg.read_image("pictures/pair/0001.png"))
    >>> ground = frame.ground(reach=3.0)
    >>> len(ground.polygons), ground.document()["features"][0]["properties"]["kind"]
    (1, 'free')
    """

    polygons: tuple[tuple[Array, ...], ...]
    camera: Camera
    reach: float
    seen: Mask
    lean_sigma: float = 0.0

    def document(self, image: str = "") -> dict[str, Any]:
        """GeoJSON feature collection, a Polygon for each region.

        Differs from RFC 7946 in that the coordinates are metres in the robot's frame and no degrees.
        """
        features = [
            {
                "type": "Feature",
                "id": number,
                "properties": {"image": image, "kind": "free", "area_m2": round(sum(map(ring_area, rings)), DECIMALS)},
                "geometry": {"type": "Polygon", "coordinates": [_closed(ring) for ring in rings]},
            }
            for number, rings in enumerate(self.polygons, start=1)
        ]
        frame = {"x": "forward", "y": "left", "unit": "m", "origin": "below the camera"}
        return {"type": "FeatureCollection", "frame": frame, "reach_m": self.reach, "features": features}

    def scan(self, count: int = 360) -> Scan:
        """Ranges at which the free space ends, at bearings all round.

        Parameters
        ----------
        count : int
            Bearings, up to 30,000; the first is straight back.

        Raises
        ------
        ParameterError
            If there is none, or too many.

        Notes
        -----
        A ray ends where it first leaves the free space; under a robot that its camera does not show, free space begins
        somewhere ahead.
        """
        if isinstance(count, bool) or not (isinstance(count, int | np.integer) and 1 <= count <= MAX_BEARINGS):
            raise ParameterError(f"count is {count!r}; give how many bearings, from 1 to {MAX_BEARINGS}")
        bearings = -np.pi + 2.0 * np.pi * np.arange(count) / count
        ranges = _first_exits([ring for rings in self.polygons for ring in rings], count)
        points = ranges[:, None] * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        pixels = to_pixels(self.camera, points)
        at_rim = read_at(deeper(self.seen, RIM_PX).view(np.uint8), *pixels.T.astype(np.float32), nearest=True) == 0
        ends = np.where(np.isnan(ranges), "unknown", np.where(at_rim, "rim", "obstacle"))
        all_ends: tuple[End, ...] = tuple(ends.tolist())
        height = self.camera.mounting()
        tilted = (height + ranges**2 / height) * self.lean_sigma  # by which a lean moves ground so far away
        return Scan(bearings, ranges, np.hypot(_range_sigma(self.camera, pixels), tilted), all_ends, self.reach)


def ground_of(
    mask: Mask, contours: Sequence[FreeForm], camera: Camera, reach: float = MAX_RANGE, domain: Mask | None = None
) -> Ground:
    """Project free space onto the ground.

    Parameters
    ----------
    mask : ndarray of bool, shape (H, W)
    contours : sequence of FreeForm
        Of which the mask was made.
    camera : Camera
        As it stood at this image.
    reach : float
        Metres.
    domain : ndarray of bool, shape (H, W), optional
        Where the free space could be at all; what is left out of it is no obstacle.

    Raises
    ------
    CalibrationError
        When the camera file has no mount_height.
    ParameterError
        If the reach is not above 0.
    """
    if not 0 < reach < np.inf:
        raise ParameterError(f"reach is {reach!r}; give metres above 0")
    seen = _within(camera, reach)
    if domain is not None:
        seen = seen & (domain | mask)
    regions, found = polygons(mask & seen, contours, flatness=0.0), []
    outlines = [ring for region in regions for ring in region.rings]
    ends = np.cumsum([len(ring) for ring in outlines])
    laid = iter(np.split(to_robot(camera, np.concatenate(outlines)), ends[:-1]) if outlines else ())
    for region in regions:
        rings = [_near(next(laid), reach) for _ in region.rings]
        if len(rings[0]):
            found.append(tuple(ring[::-1] for ring in rings) if ring_area(rings[0]) < 0 else tuple(rings))
    return Ground(tuple(found), camera, reach, seen)


@lru_cache(maxsize=2)
def _within(camera: Camera, reach: float) -> Mask:
    """Pixels of the scene that show ground within range."""
    with np.errstate(invalid="ignore"):
        near: Mask = camera.domain() & (np.sum(camera.ground() ** 2, axis=-1) < reach * reach)
    near.setflags(write=False)
    return near


def _near(ring: Array, reach: float) -> Array:
    """An outline without its parts above the horizon, cut at the range: far away half a pixel is many metres."""
    ring = ring[np.isfinite(ring).all(axis=1)]
    far = np.hypot(*ring.T)[:, None]
    return np.where(far > reach, ring * (reach / np.maximum(far, reach)), ring)


def _first_exits(rings: Sequence[Array], count: int) -> Array:
    """Shortest distance at which rays from the origin leave the area to the left of the rings; NaN without any."""
    ranges = np.full(count, np.inf)
    if rings:
        begin, end = np.concatenate(rings), np.concatenate([one for ring in rings for one in (ring[1:], ring[:1])])
        start, width = np.arctan2(begin[:, 1], begin[:, 0]), 2.0 * np.pi / count
        cross = begin[:, 0] * end[:, 1] - begin[:, 1] * end[:, 0]
        turn = np.arctan2(cross, np.einsum("ni,ni->n", begin, end))  # positive: the ray leaves the left side
        low = np.ceil((start + np.pi) / width).astype(np.intp)
        many = np.where(turn > 0, np.ceil((start + turn + np.pi) / width).astype(np.intp) - low, 0)
        which = np.repeat(np.arange(len(begin)), many)
        ray = low[which] + np.arange(len(which)) - np.repeat(np.cumsum(many) - many, many)
        angle = -np.pi + width * ray
        way, along = end[which] - begin[which], np.stack([np.cos(angle), np.sin(angle)], axis=1)
        far = cross[which] / (along[:, 0] * way[:, 1] - along[:, 1] * way[:, 0])
        np.minimum.at(ranges, ray % count, far)
    ranges[~np.isfinite(ranges)] = np.nan
    return ranges


def _range_sigma(camera: Camera, pixels: Array) -> Array:
    """Standard deviation of range, for `OUTLINE_SIGMA` pixels at pixels of shape (n, 2)."""
    steps = np.array([[0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]])
    far = np.hypot(*np.moveaxis(to_robot(camera, pixels + steps[:, None]), -1, 0))
    sigma: Array = OUTLINE_SIGMA * np.hypot(far[0] - far[1], far[2] - far[3])
    return sigma


def _closed(ring: Array) -> list[list[float]]:
    points: list[list[float]] = (np.round(ring, RING_DECIMALS) + 0.0).tolist()
    return [*points, points[0]]
