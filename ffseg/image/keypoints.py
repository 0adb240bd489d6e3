"""Interest points, and patches of one image found again in another through a plane-induced warp."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion
from ffseg.native import _core

Array = NDArray[np.float64]
Grey = NDArray[np.uint8]
Mask = NDArray[np.bool_]

HARRIS_BLOCK = 3
HARRIS_K = 0.04
"""Harris and Stephens' own constant."""
HARRIS_FLOOR = 0.01
"""Part of the strongest response below which a corner is texture; OpenCV's and MATLAB's examples use the same."""
ALIGN_STEPS = 8
"""Gauss-Newton steps; those that succeed take two to five."""


def grey_image(image: Grey) -> Grey:
    """The image as one contiguous channel."""
    return np.ascontiguousarray(image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


def harris_points(grey: Grey, region: Mask, origin: tuple[int, int], most: int) -> Array:
    """Harris corners inside a region, with sub-pixel positions.

    Parameters
    ----------
    grey : ndarray of uint8, shape (H, W)
    region : ndarray of bool, shape (h, w)
        Where corners may lie; a window of the image.
    origin : tuple of int
        (x, y) of the window's first pixel.
    most : int
        Number of corners kept, the strongest.

    Returns
    -------
    ndarray of float64, shape (n, 2)
        Pixels of the image, strongest first.
    """
    response = _harris_response(grey, region.shape, origin)
    peak = (response >= cv2.dilate(response, np.ones((3, 3), np.uint8))) & region
    peak &= response > HARRIS_FLOOR * float(response[region].max(initial=0.0))
    rows, columns = np.nonzero(peak)
    order = np.argsort(-response[rows, columns], kind="stable")[:most]
    rows, columns = rows[order], columns[order]
    offset = _peak_offset(response, rows, columns)
    return np.stack([columns, rows], axis=1) + offset + origin


def _harris_response(grey: Grey, shape: tuple[int, ...], origin: tuple[int, int]) -> NDArray[np.float32]:
    """Response over the window; read with a margin so that the window's border is like its inside."""
    x, y = origin
    margin = HARRIS_BLOCK + 1
    y0, x0 = max(y - margin, 0), max(x - margin, 0)
    part = np.ascontiguousarray(grey[y0 : y + shape[0] + margin, x0 : x + shape[1] + margin])
    response = cv2.cornerHarris(part, HARRIS_BLOCK, 3, HARRIS_K, borderType=cv2.BORDER_REPLICATE)
    return np.ascontiguousarray(response[y - y0 : y - y0 + shape[0], x - x0 : x - x0 + shape[1]])


def _peak_offset(response: NDArray[np.float32], rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Array:
    """Vertex of the parabola through a peak and its neighbours, per axis, within half a pixel; shape (n, 2)."""
    height, width = response.shape
    middle = response[rows, columns].astype(np.float64)
    offsets = np.zeros((len(rows), 2))
    neighbours = (
        (response[rows, np.maximum(columns - 1, 0)], response[rows, np.minimum(columns + 1, width - 1)]),
        (response[np.maximum(rows - 1, 0), columns], response[np.minimum(rows + 1, height - 1), columns]),
    )
    for axis, (before, after) in enumerate(neighbours):
        bend = np.minimum(before + after - 2.0 * middle, -1e-30)  # a peak bends down; a plateau has no vertex
        offsets[:, axis] = 0.5 * (before - after) / bend
    clipped: Array = np.clip(offsets, -0.5, 0.5)
    return clipped


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Where points of the current image would lie in the previous one, were they on horizontal planes.

    Attributes
    ----------
    pixels : ndarray of float64, shape (n, k, 2)
        NaN where the previous camera would not see it.
    warps : ndarray of float64, shape (n, k, 4)
        d(previous pixel)/d(current pixel): xx, xy, yx, yy.
    """

    pixels: Array
    warps: Array


WARP_EVERY = 3
"""Altitudes that share the warp of the lowest of them: it changes by about a per cent from one to the next."""


def plane_candidates(camera: Camera, motion: Motion, pixels: Array, altitudes: Array) -> Candidates:
    """Positions and warps induced by horizontal planes.

    Parameters
    ----------
    camera, motion
    pixels : ndarray of float64, shape (n, 2)
        Of the current image, below the horizon.
    altitudes : ndarray of float64, shape (k,)
        Of the planes, metres, below the camera.
    """
    corners = pixels[:, None, :] + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    rays = camera.lift(corners)
    with np.errstate(invalid="ignore", divide="ignore"):
        rays /= np.maximum(-(rays @ camera.up), 1e-9)[..., None]
    # A point at altitude h lies at (H - h) times its ray; only the direction counts: R ray + t / (H - h).
    turned = (rays @ motion.rotation.T)[:, None]
    pull = (motion.translation / (camera.mounting() - altitudes)[:, None])[None, :, None]
    centers = camera.project(turned[:, :, :1] + pull)[:, :, 0]
    sparse = np.arange(0, len(altitudes), WARP_EVERY)
    sides = camera.project(turned[:, :, 1:] + pull[:, sparse])
    steps = np.moveaxis(sides - centers[:, sparse, None], 2, 3)  # (n, altitude, axis of the pixel, step)
    warps = steps.reshape(len(pixels), len(sparse), 4)
    return Candidates(centers, warps[:, np.arange(len(altitudes)) // WARP_EVERY])


def patch_scores(current: Grey, previous: Grey, points: Array, candidates: Candidates, radius: int) -> Array:
    """Normalised cross-correlation of every point's patch with each of its candidates, shape (n, k); NaN outside."""
    n, k = candidates.pixels.shape[:2]
    scores = np.empty((n, k))
    _core.patch_scores(
        current, previous, np.ascontiguousarray(points),
        np.ascontiguousarray(candidates.pixels.reshape(n, 2 * k)),
        np.ascontiguousarray(candidates.warps.reshape(n, 4 * k)), radius, scores,
    )  # fmt: skip
    return scores


@dataclass(frozen=True, slots=True, eq=False)
class Alignments:
    """Patches aligned in the previous image.

    Attributes
    ----------
    pixels : ndarray of float64, shape (n, 2)
        Previous image.
    score : ndarray of float64, shape (n,)
        Normalised cross-correlation; NaN where the patch left the image.
    information : ndarray of float64, shape (n, 2, 2)
        Inverse covariance of ``pixels``, 1/px^2: small along an edge, large across it.
    """

    pixels: Array
    score: Array
    information: Array


FINEST_RESIDUAL = 2.0
"""Grey levels; rounding and interpolation leave this much even where sensors are perfect."""


def align_patches(
    current: Grey, previous: Grey, points: Array, start: Candidates, radius: int, steps: int = ALIGN_STEPS
) -> Alignments:
    """Align every point's patch from its first candidate."""
    n = len(points)
    out = np.empty((n, 7))
    _core.align_patches(
        current, previous, np.ascontiguousarray(points), np.ascontiguousarray(start.pixels[:, 0]),
        np.ascontiguousarray(start.warps[:, 0]), radius, steps, out,
    )  # fmt: skip
    variance = np.maximum(out[:, 3], FINEST_RESIDUAL) ** 2
    information = np.stack([out[:, 4], out[:, 5], out[:, 5], out[:, 6]], axis=1).reshape(n, 2, 2)
    return Alignments(out[:, :2].copy(), out[:, 2].copy(), information / variance[:, None, None])


OUTLINE_CELL = 4
"""Pixels: one outline sample per cell, the strongest."""
OUTLINE_FLOOR = 4.0
"""Grey levels per pixel; a weaker edge cannot be placed better than the threshold's parallax."""


def outline_points(grey: Grey, region: Mask, origin: tuple[int, int], most: int) -> Array:
    """Pixels of strongest gradient inside a region, at most one per cell, evenly thinned; shape (n, 2)."""
    x, y = origin
    height, width = region.shape
    part = np.ascontiguousarray(grey[y : y + height, x : x + width])
    if part.size == 0:
        return np.empty((0, 2))
    dx = cv2.Sobel(part, cv2.CV_32F, 1, 0, scale=0.125, borderType=cv2.BORDER_REPLICATE)
    dy = cv2.Sobel(part, cv2.CV_32F, 0, 1, scale=0.125, borderType=cv2.BORDER_REPLICATE)
    strength = np.where(region, cv2.magnitude(dx, dy), 0.0)
    rows, columns = -(-height // OUTLINE_CELL), -(-width // OUTLINE_CELL)
    padded = np.zeros((rows * OUTLINE_CELL, columns * OUTLINE_CELL), np.float32)
    padded[:height, :width] = strength
    cells = padded.reshape(rows, OUTLINE_CELL, columns, OUTLINE_CELL).swapaxes(1, 2).reshape(rows * columns, -1)
    best = cells.argmax(axis=1)
    value = cells[np.arange(len(cells)), best]
    chosen = np.flatnonzero(value > OUTLINE_FLOOR)
    if len(chosen) > most:
        chosen = chosen[np.linspace(0, len(chosen) - 1, most).round().astype(np.intp)]
    row = chosen // columns * OUTLINE_CELL + best[chosen] // OUTLINE_CELL
    column = chosen % columns * OUTLINE_CELL + best[chosen] % OUTLINE_CELL
    return np.stack([column + x, row + y], axis=1).astype(np.float64)
