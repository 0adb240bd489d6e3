"""What OpenCV offers for growing a region from a start: the peers `ffseg compare` runs beside the method.

Each takes the image or a gradient and the start region, and gives the region found. Nothing here is tuned for speed
beyond calling the library as its documentation asks.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from ffseg.arrays import Image, Mask
from ffseg.errors import SegmentationError
from ffseg.image.edges import GRADIENT_SCALE, EdgeMap
from ffseg.image.free import distances
from ffseg.peer_parameters import EdgeComponents, EdgeOpened, FloodFill, GrabCut, Watershed


def floodfill(image: Image, seeds: Mask, params: FloodFill) -> Mask:
    """``cv2.floodFill`` from a pixel of the start, whose level is set to the median of the start."""
    smoothed = smooth(image, params.sigma)
    smoothed[seeds] = np.median(smoothed[seeds], axis=0).astype(np.uint8)
    rows, columns = np.nonzero(seeds)
    middle = len(rows) // 2
    filled = np.zeros((image.shape[0] + 2, image.shape[1] + 2), np.uint8)
    flags = 4 | cv2.FLOODFILL_FIXED_RANGE | cv2.FLOODFILL_MASK_ONLY | (1 << 8)
    reach = (params.tolerance,) * 3
    cv2.floodFill(smoothed, filled, (int(columns[middle]), int(rows[middle])), (0, 0, 0), reach, reach, flags)
    found: Mask = filled[1:-1, 1:-1] > 0
    return found


def edge_components(edges: EdgeMap, seeds: Mask, params: EdgeComponents) -> Mask:
    """Pixels below an edge threshold that are connected to the start, grown up to the edge."""
    return dilated_by_disc(connected(free_of_edges(edges, params.threshold) | seeds, seeds), params.grow)


def edge_opened(edges: EdgeMap, seeds: Mask, params: EdgeOpened) -> Mask:
    """The same, where only a disc can pass: its centre's way is followed, then the disc is put back."""
    free = free_of_edges(edges, params.threshold) | seeds
    core = connected(~dilated_by_disc(~free, params.radius) | seeds, seeds)
    return dilated_by_disc(dilated_by_disc(core, params.radius) & free, params.grow)


def watershed(image: Image, seeds: Mask, params: Watershed) -> Mask:
    """``cv2.watershed`` of the smoothed image between the start and the image border."""
    markers = np.full(seeds.shape, 2, np.int32)
    inner = slice(_WATERSHED_BORDER, -_WATERSHED_BORDER)
    markers[inner, inner] = 0
    markers[seeds] = 1
    smoothed = smooth(image, params.sigma)
    cv2.watershed(smoothed if image.ndim == 3 else cv2.cvtColor(smoothed, cv2.COLOR_GRAY2BGR), markers)
    found: Mask = markers == 1
    return found


_WATERSHED_BORDER = 3
"""Pixels: width of the outer marker, of which OpenCV overwrites the outermost."""


def grabcut(image: Image, seeds: Mask, params: GrabCut) -> Mask:
    """``cv2.grabCut`` told the start and the border; the part connected to the start.

    What lies within `params.probable` radii of the start's centre is probably inside, the rest probably outside: told
    that all but the start is outside, it learns the object's colours from the start alone and gives the start back.
    """
    outside = np.ones(seeds.shape, np.bool_)
    outside[1:-1, 1:-1] = False
    outside &= ~seeds
    likely = near_start(seeds, params.probable) | seeds
    if (likely & ~outside).all():
        raise SegmentationError("the start leaves no pixel outside to learn from; change init.radius")
    return connected(grabcut_mask(image, likely, outside, params.iterations, seeds), seeds)


def grabcut_mask(image: Image, likely: Mask, outside: Mask, iterations: int, inside: Mask | None = None) -> Mask:
    """What ``cv2.grabCut`` finds inside, told what likely is, what is outside and what is inside; there must be both sides."""
    colour = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    labels = np.where(outside, cv2.GC_BGD, np.where(likely, cv2.GC_PR_FGD, cv2.GC_PR_BGD)).astype(np.uint8)
    if inside is not None:
        labels[inside] = cv2.GC_FGD
    cv2.setRNGSeed(0)
    background, foreground = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.grabCut(colour, labels, None, background, foreground, iterations, cv2.GC_INIT_WITH_MASK)  # type: ignore[call-overload]
    found: Mask = (labels & cv2.GC_FGD) > 0
    return found


def near_start(seeds: Mask, radii: float) -> Mask:
    """Pixels within so many radii of a start's centre, where the start is a disc; of several discs, the mean radius."""
    count = cv2.connectedComponents(seeds.astype(np.uint8))[0] - 1
    radius = math.sqrt(np.count_nonzero(seeds) / (math.pi * count))
    found: Mask = distances(~seeds) <= (radii - 1) * radius
    return found


def smooth(image: Image, sigma: float) -> Image:
    """Gaussian smoothing; always a new array."""
    smoothed: Image = cv2.GaussianBlur(image, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)  # type: ignore[assignment]
    return smoothed


def free_of_edges(edges: EdgeMap, threshold: float) -> Mask:
    """Pixels whose gradient stays below a threshold, inside the domain."""
    free: Mask = edges.gradient < threshold * GRADIENT_SCALE
    return free if edges.domain is None else free & (edges.domain > 0)


def connected(free: Mask, seeds: Mask) -> Mask:
    """What is connected to the free ones of the seeds over the sides of free pixels."""
    filled = np.zeros((free.shape[0] + 2, free.shape[1] + 2), np.uint8)
    filled[1:-1, 1:-1] = ~free
    found, left, even = filled[1:-1, 1:-1], np.argwhere(seeds & free), np.zeros(free.shape, np.uint8)
    while len(left):
        cv2.floodFill(even, filled, (int(left[0][1]), int(left[0][0])), 0, flags=_FILL)
        left = left[found[left[:, 0], left[:, 1]] != _FILLED]
    reached: Mask = found == _FILLED
    return reached


_FILLED = 2
_FILL = 4 | cv2.FLOODFILL_MASK_ONLY | (_FILLED << 8)


def dilated_by_disc(mask: Mask, by: float) -> Mask:
    """All pixels within a distance of a region."""
    if by <= 0 or not mask.any():
        return mask
    if by > _MAX_DISC:
        found: Mask = distances(~mask) <= by
        return found
    steps = np.arange(-int(by), int(by) + 1)
    disc = (steps[:, None] ** 2 + steps**2 <= by * by).astype(np.uint8)
    found = cv2.dilate(mask.view(np.uint8), disc).view(np.bool_)
    return found


_MAX_DISC = 8
"""Pixels; the time of a dilation grows with the area of the disc, that of a distance transform does not."""
