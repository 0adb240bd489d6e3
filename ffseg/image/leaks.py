"""Where the free space of an image has run up something upright: there the pair moves as nothing on the ground does."""

from __future__ import annotations

import cv2
import numpy as np

from ffseg.arrays import Array, Image, Indices, Mask, Plane
from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion
from ffseg.image.keypoints import plane_pixels
from ffseg.image.parts import parts_holding
from ffseg.image.planes import ROBOT_MARGIN, pixel_noise

SAMPLE_STEP = 4
"""Pixels between compared places; after the smoothing neighbouring pixels add nothing."""
SMOOTHING = 2.0
"""Pixels: standard deviation of the smoothing of both images before the comparison."""
SMOOTHED_NOISE = 0.2
"""Fraction of the pixel noise that remains in a difference: sqrt(2) / (2 sqrt(pi) SMOOTHING)."""
SLOPE_PX, ROUNDING = 0.2, 0.3
"""Pixels: precision of a ground place; and grey levels: noise of rounding."""
MAX_SQUARED_DEVIATION = 50.0
"""Largest squared deviation of a place, so that a few edges do not dominate their window."""
WINDOW, NARROW_WINDOW, MIN_SEEN_FRACTION = 9, 5, 0.35
"""Places along the sides of the two averaging windows, and the fraction of a window that must be visible in both images."""
SURE_DEVIATION, LIKELY_DEVIATION = 16.0, 2.0
"""Mean squared deviations at which a window contradicts the ground, and at which places connected with such a window do.
On 37 rendered floors (matt, glossy, shaded, under nodding cameras) they reach 11 at most, on walls that were climbed
50."""
ALTITUDES, EXPLAINED_FRACTION = np.array([0.0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.75]), 0.25
"""Altitudes, metres: the ground's, and those of which one must reduce the deviations of a contradicting window to this
fraction. Reflections lie below the ground, and no altitude explains them."""
NEAREST_FRACTION = 0.25
"""Fraction of the places, those nearest to the robot, that are ground in any case: a pair in which half of them differ,
as on a glossy floor under lamps, is not used."""
OCCLUDER_ALTITUDES = np.array(
    [-1e3, -8, -4, -2.5, -1.7, -1.2, -0.8, -0.5, -0.3, -0.15, 0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
)
"""Altitudes, metres, at which something that is not free may have hidden the ground; reflections lie below it."""


def leaking_pixels(camera: Camera, motion: Motion, current: Image, previous: Image, free: Mask) -> Mask:
    """Free pixels that contradict the ground's motion, shape (H, W).

    Parameters
    ----------
    camera, motion
        As it stood at the current image.
    current, previous : ndarray of uint8, shape (H, W)
    free : ndarray of bool, shape (H, W)
        Of the current image.

    Notes
    -----
    Every place is compared with where the previous image shows it if it lies on the ground. Places that something may have
    hidden there say nothing, nor do those whose surroundings look the same everywhere: of a plain wall nothing is found.
    """
    row, column = np.meshgrid(*(np.arange(SAMPLE_STEP // 2, side, SAMPLE_STEP) for side in free.shape), indexing="ij")
    places = np.stack([column, row], axis=-1).astype(np.float64)
    inside = free[row, column]
    away = np.hypot(*np.moveaxis(places - camera.center, -1, 0))
    looked_at = inside & (away > camera.robot_radius + ROBOT_MARGIN)
    solid = places[camera.domain()[row, column] & ~inside]
    then = np.swapaxes(_finite(plane_pixels(camera, motion, places[looked_at], ALTITUDES)), 0, 1)
    hidden = _hidden(camera, motion, solid, inside.shape)
    seen = _shown(camera, then[0]) & ~_read(hidden, (then[0] - SAMPLE_STEP // 2) / SAMPLE_STEP)
    steps = _steps((current, previous), free, (row[looked_at], column[looked_at]), then)
    near = seen & (away[looked_at] <= np.quantile(away[looked_at][seen], NEAREST_FRACTION)) if seen.any() else seen
    if not near.any() or np.median(steps[0, near]) > LIKELY_DEVIATION:
        return np.zeros_like(free)
    steps = np.where(np.array([_shown(camera, one) for one in then]), steps, MAX_SQUARED_DEVIATION)
    sums = np.zeros((len(ALTITUDES) + 1, *inside.shape), np.float32)
    sums[:, looked_at] = np.where(seen, np.vstack([steps, np.ones_like(steps[:1])]), 0.0)
    *deviations, counts = sums
    ground, *upright = (_mean(one, counts, WINDOW) for one in deviations)
    likely = _opened((ground > LIKELY_DEVIATION) & inside, 5)
    sure = (ground > SURE_DEVIATION) & (np.min(upright, axis=0) < EXPLAINED_FRACTION * ground)
    found = parts_holding(likely, sure, corners=True) & (_mean(deviations[0], counts, NARROW_WINDOW) > LIKELY_DEVIATION)
    size = free.shape[::-1]
    whole = cv2.resize(_opened(found, 3).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    climbed: Mask = np.asarray(whole, np.bool_) & free
    return climbed


def _steps(images: tuple[Image, Image], free: Mask, places: tuple[Indices, Indices], then: Array) -> Plane:
    """Squared differences between n places of the current image and positions (k, n, 2) of the previous one, shape (k, n).

    In units of what noise, slopes and rounding explain.
    """
    current, previous = (cv2.GaussianBlur(one.astype(np.float32), (0, 0), SMOOTHING) for one in images)
    x, y = (np.ascontiguousarray(then[..., axis], np.float32) for axis in (0, 1))
    step = cv2.remap(previous, x, y, cv2.INTER_LINEAR) - current[places]
    slope = sum(part[places] ** 2 for part in np.gradient(current))
    noise = SMOOTHED_NOISE * pixel_noise(images[0], free)
    sums: Plane = np.minimum(step**2 / (noise**2 + SLOPE_PX**2 * slope + ROUNDING**2), MAX_SQUARED_DEVIATION)
    return sums


def _hidden(camera: Camera, motion: Motion, solid: Array, shape: tuple[int, ...]) -> Mask:
    """Places of the previous image before which what is not free may have stood."""
    at = _finite(plane_pixels(camera, motion, solid, OCCLUDER_ALTITUDES).reshape(-1, 2))
    column, row = np.rint((at - SAMPLE_STEP // 2) / SAMPLE_STEP).astype(np.intp).T
    within = (column >= 0) & (row >= 0) & (column < shape[1]) & (row < shape[0])
    hidden = np.zeros(shape, np.uint8)
    hidden[row[within], column[within]] = 1
    return np.asarray(cv2.dilate(hidden, np.ones((3, 3), np.uint8)), np.bool_)


def _shown(camera: Camera, pixels: Array) -> Mask:
    """Whether pixels lie well inside the scene and outside the robot's disc."""
    scene = cv2.erode(camera.domain().view(np.uint8), np.ones((ROBOT_MARGIN, ROBOT_MARGIN), np.uint8))
    away = np.hypot(*(pixels - camera.center).T) > camera.robot_radius + ROBOT_MARGIN
    shown: Mask = _read(np.asarray(scene, np.bool_), pixels) & away
    return shown


def _read(plane: Mask, at: Array) -> Mask:
    """Values nearest to positions (x, y); False outside."""
    column, row = np.rint(at).astype(np.intp).T
    within = (column >= 0) & (row >= 0) & (column < plane.shape[1]) & (row < plane.shape[0])
    read: Mask = within & plane[np.where(within, row, 0), np.where(within, column, 0)]
    return read


def _finite(pixels: Array) -> Array:
    """Pixels, far outside where there is none."""
    finite: Array = np.where(np.abs(pixels) < 1e4, pixels, -1e4)
    return finite


def _mean(values: Plane, counts: Plane, width: int) -> Plane:
    """Means over windows of what is known, toward 0 where too little is."""
    total, count = (
        cv2.boxFilter(one, -1, (width, width), normalize=False, borderType=cv2.BORDER_CONSTANT)
        for one in (values, counts)
    )
    return np.asarray(total / np.maximum(count, MIN_SEEN_FRACTION * width * width), np.float32)


def _opened(mask: Mask, width: int) -> Mask:
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width))
    return np.asarray(cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disc), np.bool_)
