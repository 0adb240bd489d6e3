"""Views of the ground plane from above, and the motion that lays one on the other."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion, planar_motion

Array = NDArray[np.float64]
Grey = NDArray[np.uint8]
Mask = NDArray[np.bool_]

CLEAR = 10
"""Pixels round the robot's disc that its border blurs."""
CELL = 0.075
"""Metres; the search lands within half a cell, which the half-resolution refinement reaches."""
CELLS = 64
PADDED = 96
"""Cells of the transform: shifts of up to 32 cells (2.4 m) do not wrap."""
TURNS = np.deg2rad(np.arange(-30.0, 30.1, 1.5))
"""Rotations tried between two images: a robot that turns faster needs poses."""
CLIP = 2.0
"""Standard deviations of the ground's own texture at which a cell is cut: paint and boxes weigh no more than ground."""
LEAST_OVERLAP = 0.3
"""Share of the current cells that must find a partner."""
LEAST_PEAK = 0.3
"""Correlation that spares the refinement hopeless starts; it decides, for the peaks of unrelated grounds reach 0.45
where those of right ones begin at 0.49 (12 rendered pairs each)."""


def search_ground_motion(camera: Camera, current: Grey, previous: Grey, free: Mask) -> Motion | None:
    """Planar motion that lays the current ground on the previous one: correlation over all turns and shifts.

    Returns
    -------
    Motion or None
        Within half a cell; None without a peak that stands out.
    """
    pixels = _cells(camera)
    now, now_mask = _ground_view(camera, current, pixels, free)
    then, then_mask = _ground_view(camera, previous, pixels, camera.domain())
    size = (PADDED, PADDED)
    seen = [np.fft.rfft2(part, size) for part in (then * then_mask, then**2 * then_mask, then_mask)]
    best, place = LEAST_PEAK, None
    for turn in TURNS:
        surface = _correlation(_turned(now, turn), _turned(now_mask, turn), seen)
        at = np.unravel_index(np.argmax(surface), size)
        if surface[at] > best:
            best, place = float(surface[at]), (turn, _shift(surface, at))
    if place is None:
        return None
    turn, (dy, dx) = place
    sigma = (CELL, float(TURNS[1] - TURNS[0]))
    return planar_motion(camera, np.array([dx * CELL, dy * CELL, turn]), "ground points", 0, sigma)


def _cells(camera: Camera) -> NDArray[np.float32]:
    """Pixels of a square raster of ground points round the camera."""
    axis = (np.arange(CELLS) - (CELLS - 1) / 2.0) * CELL
    x, y = np.meshgrid(axis, axis)
    points = np.stack([x, y, np.full_like(x, camera.mounting())], axis=-1)
    pixels = camera.project(points @ camera.level())
    return np.nan_to_num(pixels, nan=-1e4).astype(np.float32)


def _ground_view(camera: Camera, grey: Grey, pixels: NDArray[np.float32], mask: Mask) -> tuple[Array, Array]:
    """Clipped high-pass view of the ground from above, and where it is known."""
    smooth = cv2.GaussianBlur(grey, (0, 0), 3.0)
    x, y = (np.ascontiguousarray(pixels[..., axis]) for axis in (0, 1))
    view = cv2.remap(smooth, x, y, cv2.INTER_LINEAR).astype(np.float64)
    known = cv2.remap(mask.view(np.uint8), x, y, cv2.INTER_NEAREST).astype(np.float64)
    away = np.hypot(pixels[..., 0] - camera.center[0], pixels[..., 1] - camera.center[1])
    known[away < camera.robot_radius + CLEAR] = 0.0
    weight = cv2.GaussianBlur(known, (0, 0), 4.0) + 1e-6
    high = (view - cv2.GaussianBlur(view * known, (0, 0), 4.0) / weight) * known
    scale = 1.4826 * np.median(np.abs(high[known > 0])) if known.any() else 0.0
    return np.clip(high, -CLIP * scale, CLIP * scale), known


def _turned(view: Array, turn: float) -> Array:
    """The view turned about the camera by `turn`."""
    c, s, middle = np.cos(turn), np.sin(turn), (CELLS - 1) / 2.0
    matrix = np.array([[c, -s, middle * (1 - c + s)], [s, c, middle * (1 - s - c)]])
    return cv2.warpAffine(view, matrix, (CELLS, CELLS), flags=cv2.INTER_LINEAR).astype(np.float64)


def _correlation(view: Array, mask: Array, seen: list[NDArray[np.complex128]]) -> Array:
    """Normalised correlation of the masked view with the previous one for every shift (rows, columns)."""
    size = (PADDED, PADDED)
    masked, squares, own = (np.fft.rfft2(part, size).conj() for part in (view * mask, view**2 * mask, mask))
    product = np.fft.irfft2(masked * seen[0], size)
    energy = np.fft.irfft2(squares * seen[2], size) * np.fft.irfft2(own * seen[1], size)
    overlap = np.fft.irfft2(own * seen[2], size)
    enough = (overlap > LEAST_OVERLAP * max(1.0, float(mask.sum()))) & (energy > 0)
    return np.where(enough, product / np.sqrt(np.where(enough, energy, 1.0)), -1.0)


def _shift(surface: Array, at: tuple[np.intp, ...]) -> tuple[float, float]:
    """Signed shift of a peak with the vertex of a parabola per axis."""
    result = []
    for axis in (0, 1):
        line = np.take(surface, at[1 - axis], axis=1 - axis)
        before, middle, after = (float(line[(at[axis] + step) % PADDED]) for step in (-1, 0, 1))
        bend = before + after - 2.0 * middle
        offset = 0.5 * (before - after) / bend if bend < 0 else 0.0
        index = int(at[axis])
        result.append((index if index <= PADDED // 2 else index - PADDED) + float(np.clip(offset, -0.5, 0.5)))
    return result[0], result[1]


def eroded(mask: Mask, by: int) -> Mask:
    """Pixels whose square neighbourhood of ``by`` pixels lies in the mask; nothing lies outside the image."""
    size = 2 * by + 1
    return cv2.erode(mask.view(np.uint8), np.ones((size, size), np.uint8), borderValue=0).view(np.bool_)


def halved(grey: Grey) -> Grey:
    """The image at half its size: pixel (x, y) of it lies at (2x, 2y)."""
    return cv2.pyrDown(grey).astype(np.uint8, copy=False)
