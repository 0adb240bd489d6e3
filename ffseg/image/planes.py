"""Views of the ground plane from above, and the motion that lays one on the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np

from ffseg.arrays import Image, Mask, Plane
from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion, planar_motion
from ffseg.image.components import Component, merged

ROBOT_MARGIN = 10
"""Pixels round the robot's disc that its border blurs."""
CELL = 0.075
"""Metres: the search is precise to half a cell, within the range of the refinement at half resolution."""
CELLS = 64
PADDING = 1.5
"""Padding factor of the Fourier transform: shifts of up to half the view (2.4 m) do not wrap."""
FINALISTS = 5
"""Rotations tested at full resolution: in 40 rendered pairs the right one was first or second at half resolution."""
SURE_PEAK = 0.48
"""Correlation of a finalist at which no further rotation is tested; faint ground is searched at full resolution
throughout."""
TURNS = np.deg2rad(np.arange(-30.0, 30.1, 1.5))
"""Radians: rotations between two images tested first; robots rarely turn faster."""
WIDE_TURNS = np.deg2rad(np.concatenate([np.arange(-180.0, -30.0, 2.0), np.arange(32.0, 180.0, 2.0)]))
"""Radians: rotations tested if none of those fits."""
MAX_TURNS = 24
"""Largest number of rotations tested at full resolution."""
MOTIONS_EACH = 4
"""Motions passed on from each range of rotations."""
HALF_SMOOTHING = 1.4
"""Pixels of the halved image: with the smoothing of the reduction 3 pixels of the original, half a cell at a distance of
1 m."""
TEXTURE_CLIP = 2.0
"""Standard deviations of the ground's texture at which a cell is clipped, so that paint and boxes weigh no more than
ground."""
MIN_OVERLAP = 0.3
"""Least fraction of the current cells with a counterpart."""
MIN_ENERGY = 1e-4
"""Fraction of the largest energy below which rounding in single precision would decide a correlation."""
MIN_PEAK = 0.2
"""Least correlation of a motion passed on to the refinement, which decides by points of the ground."""
SMOOTHED_NOISE = 0.095
"""Fraction of the pixel noise that remains after the smoothing of the view."""
NOISE_SHRINKAGE, NOISE_CLIP = 2.0, 8.0
"""Noise levels by which a cell is shrunk towards zero, and at which it is clipped on bare ground."""


def search_ground_motions(
    camera: Camera, current: Image, previous: Image, free: Mask, components: Sequence[Component] = ()
) -> Iterator[Motion]:
    """Planar motions that lay the current ground on the previous one, the likeliest first: a correlation over all shifts.

    Each is good to within a cell or two. Turns of up to 30 degrees come first, all others after them.
    """
    pixels = _cells(camera)
    now = _ground_view(camera, current, pixels, merged(free, components))
    then = _ground_view(camera, previous, pixels, camera.domain())
    small, spectra, then_small = now.halved(), _spectra(then), _spectra(then.halved())
    for turns in (TURNS, WIDE_TURNS):
        peaks = [float(_correlation(small.turned(turn), then_small).max()) for turn in turns]
        order = np.argsort(peaks, kind="stable")[::-1].tolist()
        found: list[tuple[float, float, tuple[float, float]]] = []
        for rank, index in enumerate(order[:MAX_TURNS]):
            if rank >= FINALISTS and found[0][0] > SURE_PEAK:
                break
            surface = _correlation(now.turned(turns[index]), spectra)
            at = np.unravel_index(np.argmax(surface), surface.shape)
            found.append((float(surface[at]), float(turns[index]), _shift(surface, at)))
            found.sort(reverse=True)
        for peak, turn, (dy, dx) in found[:MOTIONS_EACH]:
            if peak > MIN_PEAK:
                sigma = (CELL, float(TURNS[1] - TURNS[0]))
                yield planar_motion(camera, np.array([dx * CELL, dy * CELL, turn]), "ground points", 0, sigma)


@dataclass(frozen=True, slots=True, eq=False)
class _GroundGrid:
    """The ground from above.

    Attributes
    ----------
    texture : ndarray of float32, shape (n, n)
        High-pass grey levels, 0 where the ground is not known.
    valid : ndarray of float32, shape (n, n)
        1 where the ground is known; between 0 and 1 after turning or halving.
    """

    texture: Plane
    valid: Plane

    def turned(self, turn: float) -> _GroundGrid:
        """The view turned about the camera by `turn`."""
        size = len(self.texture)
        c, s, middle = np.cos(turn), np.sin(turn), (size - 1) / 2.0
        matrix = np.array([[c, -s, middle * (1 - c + s)], [s, c, middle * (1 - s - c)]])
        return _GroundGrid(
            *(cast(Plane, cv2.warpAffine(part, matrix, (size, size))) for part in (self.texture, self.valid))
        )

    def halved(self) -> _GroundGrid:
        """Means of 2x2 cells."""
        half = len(self.texture) // 2
        texture, valid = (
            part.reshape(half, 2, half, 2).mean(axis=(1, 3), dtype=np.float32) for part in (self.texture, self.valid)
        )
        return _GroundGrid(texture, valid)


def _cells(camera: Camera) -> Plane:
    """Pixels of a square raster of ground points round the camera."""
    axis = (np.arange(CELLS) - (CELLS - 1) / 2.0) * CELL
    x, y = np.meshgrid(axis, axis)
    points = np.stack([x, y, np.full_like(x, camera.mounting())], axis=-1)
    pixels = camera.project(points @ camera.level())
    return np.nan_to_num(pixels, nan=-1e4).astype(np.float32)


def _ground_view(camera: Camera, grey: Image, pixels: Plane, mask: Mask) -> _GroundGrid:
    """Clipped high-pass view of the ground from above, and where it is known."""
    smooth = cv2.GaussianBlur(cv2.pyrDown(grey), (0, 0), HALF_SMOOTHING)
    x, y = (np.ascontiguousarray(pixels[..., axis]) for axis in (0, 1))
    view = cv2.remap(smooth, x * 0.5, y * 0.5, cv2.INTER_LINEAR).astype(np.float32)
    valid = cv2.remap(mask.view(np.uint8), x, y, cv2.INTER_NEAREST).astype(np.float32)
    away = np.hypot(x - camera.center[0], y - camera.center[1])
    valid[away < camera.robot_radius + ROBOT_MARGIN] = 0.0
    weight = cv2.GaussianBlur(valid, (0, 0), 4.0) + 1e-6
    high = (view - cv2.GaussianBlur(view * valid, (0, 0), 4.0) / weight) * valid
    scale = 1.4826 * np.median(np.abs(high[valid > 0])) if valid.any() else 0.0
    noise = SMOOTHED_NOISE * pixel_noise(grey, mask)
    most = max(TEXTURE_CLIP * scale, NOISE_CLIP * noise)
    shrunk = np.sign(high) * np.clip(np.abs(high) - NOISE_SHRINKAGE * noise, 0.0, most)
    return _GroundGrid(shrunk.astype(np.float32), valid)


def pixel_noise(grey: Image, mask: Mask) -> float:
    """Standard deviation of the pixels' noise: the median step between neighbours in every eighth row of a mask."""
    steps = np.abs(np.diff(grey[::8].astype(np.int16), axis=1))[mask[::8, 1:] & mask[::8, :-1]]
    if not len(steps):
        return 0.0
    # Whole grey levels: the median is found inside its level, as if the steps were spread over it.
    counts = np.bincount(steps, minlength=2)
    place = int(np.searchsorted(np.cumsum(counts), 0.5 * len(steps)))
    below = float(counts[:place].sum())
    width, low = (0.5, 0.0) if place == 0 else (1.0, place - 0.5)
    median = low + width * (0.5 * len(steps) - below) / float(counts[place])
    return median / MEDIAN_DIFFERENCE


MEDIAN_DIFFERENCE = 0.9539
"""Median of the absolute difference of two normal values, in units of their standard deviation."""


def _spectra(view: _GroundGrid) -> tuple[Plane, Plane, Plane]:
    """Transforms of the masked texture, of its squares and of the mask, padded against wrapping."""
    size = round(PADDING * len(view.texture))
    padded = np.zeros((3, size, size), np.float32)
    inside = padded[:, : len(view.texture), : len(view.texture)]
    masked = view.texture * view.valid
    inside[0], inside[1], inside[2] = masked, masked * view.texture, view.valid
    return _transform(padded[0]), _transform(padded[1]), _transform(padded[2])


def _transform(part: Plane) -> Plane:
    return cast(Plane, cv2.dft(part))


def _correlation(view: _GroundGrid, seen: tuple[Plane, Plane, Plane]) -> Plane:
    """Normalised correlation of the view with the previous one's spectra for every shift (rows, columns)."""
    texture, squares, valid = _spectra(view)
    product = _shifted(texture, seen[0])
    energy = _shifted(squares, seen[2]) * _shifted(valid, seen[1])
    overlap = _shifted(valid, seen[2])
    enough = overlap > MIN_OVERLAP * max(1.0, float(view.valid.sum()))
    enough &= energy > MIN_ENERGY * max(float(energy.max()), 1e-12)
    result: Plane = np.full_like(product, -1.0)
    result[enough] = product[enough] / np.sqrt(energy[enough])
    return result


def _shifted(own: Plane, seen: Plane) -> Plane:
    """Sums of products for every shift, from two transforms."""
    return cast(Plane, cv2.dft(cv2.mulSpectrums(seen, own, 0, conjB=True), flags=_BACK))


_BACK = cv2.DFT_INVERSE | cv2.DFT_SCALE


def _shift(surface: Plane, at: tuple[np.intp, ...]) -> tuple[float, float]:
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


def halved(grey: Image) -> Image:
    """The image at half its size: pixel (x, y) of it lies at (2x, 2y)."""
    return cv2.pyrDown(grey).astype(np.uint8, copy=False)
