"""The valid disc of a mirror or fisheye lens: the bright circle in a dark surround, detected in the image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np

from ffseg.arrays import Image, Mask, Points

WORKING_SIZE = 200
"""Pixels of the longer side of the reduced image in which the disc is searched: its radius is then known to half a
percent."""

MAX_CORNER_LEVEL = 0.3
"""Image corners brighter than this fraction of the bright level belong to the scene (real surrounds: up to 0.22)."""

BRIGHT_QUANTILE = 0.95
"""Quantile of the grey levels that is taken as the bright level."""

CUT_LEVELS = (0.15, 0.3, 0.5)
"""Thresholds at which the disc is segmented, as fractions of the way from the level of the surround to the bright level.
Images with reflections on the mount need the higher ones."""

CIRCLE_TOLERANCE = 0.012
"""Distance of an outline point from the fitted circle that still counts as on it, as a fraction of the radius."""

MIN_CIRCLE_FRACTION = 0.65
"""Fraction of the outline that must lie on the circle. Real discs have 0.7 to 1; scenes and objects with dark corners up
to 0.45."""

MAX_BRIGHT_OUTSIDE = 0.005
"""Largest fraction of bright pixels in the surround."""

MIN_LEVEL_DEVIATION = 20.0
"""Grey levels: smallest standard deviation inside the disc. A mirror shows a scene (50 to 80), a plain round object does
not."""

MAX_ASPECT_RATIO = 1.25
"""Largest aspect ratio of the bounding box of a circle that lies wholly in the image (real ones: up to 1.01, more with a
reflection beside it). Saves time only: the circle fit would reject the same candidates."""

GROWTH_MARGIN = 0.01
"""Fraction of the radius by which the disc is enlarged: a contour then stops at the edge of the rim, and the disc stops
what leaks through it."""


@dataclass(frozen=True, slots=True)
class Disc:
    """A circle in pixels."""

    x: float
    y: float
    radius: float

    def holds(self, point: Points) -> bool:
        """Whether a point (x, y) lies in the circle."""
        return math.hypot(point[0] - self.x, point[1] - self.y) <= self.radius

    def mask(self, shape: tuple[int, int], margin: float = GROWTH_MARGIN) -> Image:
        """255 inside the circle grown by a part of its radius, else 0, shape (H, W)."""
        y, x = np.ogrid[: shape[0], : shape[1]]
        inside = (x - self.x) ** 2 + (y - self.y) ** 2 <= (self.radius * (1 + margin)) ** 2
        return np.where(inside, np.uint8(255), np.uint8(0))


def valid_disc(image: Image) -> Disc | None:
    """The circle in which a mirror or fisheye shows its scene, or None for ordinary images.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)

    Notes
    -----
    Looks only at images whose four corners are dark. The convex outline of what is bright must lie on one circle,
    which holds everything bright, shows a scene and leaves a dark surround. An ordinary image fails at the corners,
    at the cost of reading these; one with dark corners fails at the circle.
    """
    step = -(-max(image.shape[:2]) // WORKING_SIZE)
    small = image[step // 2 :: step, step // 2 :: step]
    surround = _corner_level(image, step)
    if surround is None or min(small.shape[:2]) < 8:
        return None
    grey = np.ascontiguousarray(brightest_channel(small))
    level = _bright_level(grey)
    if surround > MAX_CORNER_LEVEL * level:
        return None
    seen: Mask | None = None
    for part in CUT_LEVELS:
        bright = grey > int(surround + part * (level - surround))  # whole numbers are compared eight times as fast
        if seen is not None and np.array_equal(bright, seen):
            continue  # two tones: what was no disc is none
        found = _circle_round(bright, grey)
        if found is not None:
            return Disc(found.x * step + step // 2, found.y * step + step // 2, found.radius * step)
        seen = bright
    return None


def _bright_level(grey: Image) -> float:
    """The `BRIGHT_QUANTILE` of the grey levels; of most drawings it is the brightest level, which is known at once."""
    brightest = int(grey.max())
    if np.count_nonzero(grey < brightest) < BRIGHT_QUANTILE * grey.size:
        return brightest
    counts = cv2.calcHist([grey], [0], None, [256], [0, 256]).cumsum()
    return float(np.searchsorted(counts, BRIGHT_QUANTILE * grey.size))


def _corner_level(image: Image, step: int) -> float | None:
    """Mean of the brightest of the four corners; None if one is too bright for a surround."""
    size = max(1, min(image.shape[:2]) // 16)
    ends, brightest = (slice(0, size, step), slice(-size, None, step)), 0.0
    for y, x in product(ends, ends):
        corner = brightest_channel(image[y, x])
        brightest = max(brightest, int(np.add.reduce(corner, axis=None, dtype=np.int64)) / corner.size)
        if brightest > MAX_CORNER_LEVEL * 255:
            return None
    return brightest


def brightest_channel(image: Image) -> Image:
    """The brightest channel of each pixel, shape (H, W)."""
    if image.ndim == 2:
        return image
    found = image[..., 0]
    for channel in range(1, image.shape[2]):
        found = np.maximum(found, image[..., channel])
    return found


def _circle_round(bright: Mask, grey: Image) -> Disc | None:
    smooth = cv2.medianBlur(bright.view(np.uint8), 3).view(np.bool_)
    if not _may_be_round(smooth):
        return None
    outline = _outline(smooth)
    if len(outline) < 40:
        return None
    disc, on = _fit(outline)
    if on.mean() < MIN_CIRCLE_FRACTION:
        return None
    outside = disc.mask(bright.shape, 2 * CIRCLE_TOLERANCE) == 0
    if outside.any() and float(bright[outside].mean()) > MAX_BRIGHT_OUTSIDE:
        return None
    scene = grey[disc.mask(bright.shape, -2 * CIRCLE_TOLERANCE) > 0]
    return disc if len(scene) and float(scene.std()) >= MIN_LEVEL_DEVIATION else None


def _may_be_round(bright: Mask) -> bool:
    """Whether the bright part is about as wide as high, or cut by the border of the image."""
    x, y, width, height = cv2.boundingRect(bright.view(np.uint8))
    if not width:
        return False
    if x == 0 or y == 0 or x + width == bright.shape[1] or y + height == bright.shape[0]:
        return True
    return max(height, width) <= MAX_ASPECT_RATIO * min(height, width)


def _outline(bright: Mask) -> Points:
    """Points one pixel apart on the convex hull of the bright part, without those on the border of the image."""
    rows = np.nonzero(bright.any(axis=1))[0]
    if not len(rows):
        return np.empty((0, 2))
    first, last = bright[rows].argmax(axis=1), bright.shape[1] - 1 - bright[rows, ::-1].argmax(axis=1)
    ends = np.column_stack([np.concatenate([first, last]), np.concatenate([rows, rows])])
    hull = cv2.convexHull(ends.astype(np.int32))[:, 0].astype(np.float64)
    sides = np.roll(hull, -1, axis=0) - hull
    counts = np.maximum(1, np.hypot(sides[:, 0], sides[:, 1]).astype(int))
    which = np.repeat(np.arange(len(hull)), counts)
    place = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    points = hull[which] + sides[which] * (place / counts[which])[:, None]
    inner: Points = points[((points > 1) & (points < np.array(bright.shape[::-1]) - 2)).all(axis=1)]
    return inner


def _fit(points: Points) -> tuple[Disc, Mask]:
    """Circle of least algebraic error; distant points are dropped and re-admitted until the set is stable."""
    centre = points.mean(axis=0)
    moved = points - centre
    rows, squares = np.column_stack([2 * moved, np.ones(len(moved))]), (moved**2).sum(axis=1)
    on = np.ones(len(moved), bool)
    for _ in range(10):
        kept = rows[on]
        x, y, rest = np.linalg.lstsq(kept.T @ kept, kept.T @ squares[on], rcond=None)[0]
        radius = math.sqrt(max(0.0, rest + x * x + y * y))
        error = np.abs(np.hypot(moved[:, 0] - x, moved[:, 1] - y) - radius)
        near = max(1.0, CIRCLE_TOLERANCE * radius)
        before, on = on, error <= max(near, 2 * float(np.median(error)))
        if np.array_equal(before, on):
            break
    return Disc(float(x + centre[0]), float(y + centre[1]), radius), error <= near
