"""Views of the ground plane from above, and the motion that lays one on the other."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion, planar_motion

Grey = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Field = NDArray[np.float32]

CLEAR = 10
"""Pixels round the robot's disc that its border blurs."""
CELL = 0.075
"""Metres; the search lands within half a cell, which the half-resolution refinement reaches."""
CELLS = 64
PADDING = 1.5
"""Of the transform: shifts of up to half the view (2.4 m) do not wrap."""
FINALISTS = 5
"""Turns that are tried at full resolution: in 40 rendered pairs the right one came first or second in halved views."""
SURE_PEAK = 0.48
"""Correlation of a finalist that spares the other turns; faint ground is searched at full resolution throughout."""
TURNS = np.deg2rad(np.arange(-30.0, 30.1, 1.5))
"""Rotations tried between two images: a robot that turns faster needs poses."""
HALF_SMOOTHING = 1.4
"""Pixels of the halved image: with the halving's own smoothing 3 pixels of the whole, which is half a cell 1 m away."""
CLIP = 2.0
"""Standard deviations of the ground's own texture at which a cell is cut: paint and boxes weigh no more than ground."""
LEAST_OVERLAP = 0.3
"""Share of the current cells that must find a partner."""
LEAST_ENERGY = 1e-4
"""Part of the largest energy below which single precision would decide a correlation."""
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
    now = _ground_view(camera, current, pixels, free)
    then = _ground_view(camera, previous, pixels, camera.domain())
    small, then_small = now.halved(), _spectra(then.halved())
    peaks = [float(_correlation(small.turned(turn), then_small).max()) for turn in TURNS]
    order = np.argsort(peaks, kind="stable")[::-1].tolist()
    spectra = _spectra(then)
    best, place = LEAST_PEAK, None
    for rank, index in enumerate(order):
        if rank >= FINALISTS and best > SURE_PEAK:
            break
        surface = _correlation(now.turned(TURNS[index]), spectra)
        at = np.unravel_index(np.argmax(surface), surface.shape)
        if surface[at] > best:
            best, place = float(surface[at]), (TURNS[index], _shift(surface, at))
    if place is None:
        return None
    turn, (dy, dx) = place
    sigma = (CELL, float(TURNS[1] - TURNS[0]))
    return planar_motion(camera, np.array([dx * CELL, dy * CELL, turn]), "ground points", 0, sigma)


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """The ground from above.

    Attributes
    ----------
    texture : ndarray of float32, shape (n, n)
        High-pass grey levels, 0 where the ground is not known.
    known : ndarray of float32, shape (n, n)
        1 where the ground is known; between 0 and 1 after turning or halving.
    """

    texture: Field
    known: Field

    def turned(self, turn: float) -> _View:
        """The view turned about the camera by `turn`."""
        size = len(self.texture)
        c, s, middle = np.cos(turn), np.sin(turn), (size - 1) / 2.0
        matrix = np.array([[c, -s, middle * (1 - c + s)], [s, c, middle * (1 - s - c)]])
        texture, known = (
            cv2.warpAffine(part, matrix, (size, size), flags=cv2.INTER_LINEAR).astype(np.float32, copy=False)
            for part in (self.texture, self.known)
        )
        return _View(texture, known)

    def halved(self) -> _View:
        """Means of 2x2 cells."""
        half = len(self.texture) // 2
        texture, known = (
            part.reshape(half, 2, half, 2).mean(axis=(1, 3), dtype=np.float32) for part in (self.texture, self.known)
        )
        return _View(texture, known)


def _cells(camera: Camera) -> NDArray[np.float32]:
    """Pixels of a square raster of ground points round the camera."""
    axis = (np.arange(CELLS) - (CELLS - 1) / 2.0) * CELL
    x, y = np.meshgrid(axis, axis)
    points = np.stack([x, y, np.full_like(x, camera.mounting())], axis=-1)
    pixels = camera.project(points @ camera.level())
    return np.nan_to_num(pixels, nan=-1e4).astype(np.float32)


def _ground_view(camera: Camera, grey: Grey, pixels: NDArray[np.float32], mask: Mask) -> _View:
    """Clipped high-pass view of the ground from above, and where it is known."""
    smooth = cv2.GaussianBlur(cv2.pyrDown(grey), (0, 0), HALF_SMOOTHING)
    x, y = (np.ascontiguousarray(pixels[..., axis]) for axis in (0, 1))
    view = cv2.remap(smooth, x * 0.5, y * 0.5, cv2.INTER_LINEAR).astype(np.float32)
    known = cv2.remap(mask.view(np.uint8), x, y, cv2.INTER_NEAREST).astype(np.float32)
    away = np.hypot(x - camera.center[0], y - camera.center[1])
    known[away < camera.robot_radius + CLEAR] = 0.0
    weight = cv2.GaussianBlur(known, (0, 0), 4.0) + 1e-6
    high = (view - cv2.GaussianBlur(view * known, (0, 0), 4.0) / weight) * known
    scale = 1.4826 * np.median(np.abs(high[known > 0])) if known.any() else 0.0
    return _View(np.clip(high, -CLIP * scale, CLIP * scale).astype(np.float32), known)


def _spectra(view: _View) -> tuple[Field, Field, Field]:
    """Transforms of the masked texture, of its squares and of the mask, padded against wrapping."""
    size = round(PADDING * len(view.texture))
    padded = np.zeros((3, size, size), np.float32)
    inside = padded[:, : len(view.texture), : len(view.texture)]
    masked = view.texture * view.known
    inside[0], inside[1], inside[2] = masked, masked * view.texture, view.known
    texture, squares, known = (cv2.dft(part).astype(np.float32, copy=False) for part in padded)
    return texture, squares, known


def _correlation(view: _View, seen: tuple[Field, Field, Field]) -> Field:
    """Normalised correlation of the view with the previous one's spectra for every shift (rows, columns)."""
    texture, squares, known = _spectra(view)
    product = _shifted(texture, seen[0])
    energy = _shifted(squares, seen[2]) * _shifted(known, seen[1])
    overlap = _shifted(known, seen[2])
    enough = overlap > LEAST_OVERLAP * max(1.0, float(view.known.sum()))
    enough &= energy > LEAST_ENERGY * max(float(energy.max()), 1e-12)
    result: Field = np.full_like(product, -1.0)
    result[enough] = product[enough] / np.sqrt(energy[enough])
    return result


def _shifted(own: Field, seen: Field) -> Field:
    """Sums of products for every shift, from two transforms."""
    turned = cv2.mulSpectrums(seen, own, 0, conjB=True)
    return cv2.dft(turned, flags=cv2.DFT_INVERSE | cv2.DFT_SCALE).astype(np.float32, copy=False)


def _shift(surface: Field, at: tuple[np.intp, ...]) -> tuple[float, float]:
    """Signed shift of a peak with the vertex of a parabola per axis."""
    size, result = len(surface), []
    for axis in (0, 1):
        line = np.take(surface, at[1 - axis], axis=1 - axis)
        before, middle, after = (float(line[(at[axis] + step) % size]) for step in (-1, 0, 1))
        bend = before + after - 2.0 * middle
        offset = 0.5 * (before - after) / bend if bend < 0 else 0.0
        index = int(at[axis])
        result.append((index if index <= size // 2 else index - size) + float(np.clip(offset, -0.5, 0.5)))
    return result[0], result[1]


def halved(grey: Grey) -> Grey:
    """The image at half its size: pixel (x, y) of it lies at (2x, 2y)."""
    return cv2.pyrDown(grey).astype(np.uint8, copy=False)
