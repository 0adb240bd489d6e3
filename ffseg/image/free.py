"""Free places for a start: pixels away from edges, the limit of the domain and the border of the image."""

from __future__ import annotations

from math import ceil, sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image, Indices, Mask, Plane
from ffseg.image.parts import connected_parts

MAX_CORNER_GAP = 5
"""Pixels: largest distance between an outline and a corner of the domain: all of 1343 rays that end at drawn masts in a
room."""

_MAX_EXACT_DISTANCE = np.float32(1024)
"""Pixels up to which the square of a distance that is off by its last bits rounds to the right whole number: below 2^21."""


def free_pixels(edges: Image, domain: Image | None, clearance: float = 0.0) -> Mask:
    """Pixels a contour's sample may lie on, shape (H, W).

    Parameters
    ----------
    edges : ndarray of uint8, shape (H, W)
        Nonzero on edge pixels; those round them are not free either.
    domain : ndarray of uint8, shape (H, W), or None
        Nonzero where the contour may go.
    clearance : float
        Pixels; nothing nearer than half of it to an edge pixel is free.
    """
    free: Mask = cv2.dilate(edges, np.ones((3, 3), np.uint8)) == 0
    if clearance > 0:
        free &= distances(edges == 0) >= clearance / 2
    return free if domain is None else free & (domain != 0)


def clear_distances(free: Mask) -> Plane:
    """Distance of every pixel to the nearest one that is not free, pixels; the ring beyond the image is not free."""
    return distances(np.pad(free, 1))[1:-1, 1:-1]


def deeper(free: Mask, least: float) -> Mask:
    """Pixels at least `least` px, a few, from the nearest pixel that is not free, as `clear_distances` measures it.

    Notes
    -----
    What is nearer than that to a pixel is the union of a few rectangles, by each of which it is eroded at once.
    """
    rectangles = {ceil(sqrt(least**2 - height**2)) - 1: height for height in range(ceil(least))}
    found = free.copy()
    for width, height in rectangles.items():
        near = np.ones((2 * height + 1, 2 * width + 1), np.uint8)
        found &= cv2.erode(free.view(np.uint8), near, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0
    return found


def without_slivers(domain: Mask, view: Mask, free: Mask) -> Mask:
    """The domain without slivers that are not free only because an outline cuts corners of what the view leaves out.

    Parameters
    ----------
    domain, view, free : ndarray of bool, shape (H, W)
        The domain lies in the view.
    """
    beside = cv2.dilate((view & ~domain).view(np.uint8), np.ones((2 * MAX_CORNER_GAP + 1,) * 2, np.uint8)) > 0
    stands = (domain & ~free & ~beside).view(np.uint8)
    return domain & (free | (cv2.dilate(stands, np.ones((4 * MAX_CORNER_GAP + 1,) * 2, np.uint8)) > 0))


def nearest_outside(mask: Mask) -> tuple[Plane, Indices]:
    """For every pixel of a mask, the distance to the nearest pixel outside it, and (row, column) of that pixel.

    Pixels beyond the array count as outside.
    """
    inside = np.pad(mask, 1).view(np.uint8)
    _, labels = cv2.distanceTransformWithLabels(inside, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL)
    rows, columns = np.nonzero(inside == 0)
    places = np.zeros((int(labels.max()) + 1, 2), np.intp)
    places[labels[rows, columns]] = np.stack([rows, columns], axis=1) - 1
    found = places[labels][1:-1, 1:-1]
    row, column = np.indices(mask.shape)
    exact = np.hypot(found[..., 0] - row, found[..., 1] - column)
    return np.where(mask, exact, 0.0).astype(np.float32), found


def free_part_under(free: Mask, region: Mask) -> Mask | None:
    """The connected free component that holds most of a region, or None if nothing of the region is free."""
    labels = connected_parts(free).labels
    counts = np.bincount(labels[region & free])
    return None if not len(counts) else np.asarray(labels == int(counts.argmax()), np.bool_)


def open_sides(free: Mask) -> NDArray[np.int32]:
    """Number of the connected free component of each pixel; 0 if it has none, or is narrower than two pixels."""
    return connected_parts(open_ground(free)).labels


def open_ground(free: Mask) -> Mask:
    """Free pixels but those of places narrower than two pixels; a pixel depends on those at most two away."""
    square = np.ones((2, 2), np.uint8)
    fits = cv2.erode(free.view(np.uint8), square, anchor=(0, 0))  # squares by their upper left pixels
    return np.asarray(cv2.dilate(fits, square, anchor=(1, 1)), np.uint8).view(np.bool_)


def distances(mask: Mask) -> Plane:
    """Distance of every pixel of a mask to the nearest one that is not in it, pixels.

    Notes
    -----
    OpenCV's depends in its last bit on where the memory lies. Squares of distances are whole numbers: those up to
    `_MAX_EXACT_DISTANCE` are brought back to them.
    """
    found = np.asarray(cv2.distanceTransform(mask.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32)
    far = found >= _MAX_EXACT_DISTANCE
    beyond = found[far]
    np.sqrt(np.rint(np.square(found, out=found), out=found), out=found)
    found[far] = beyond
    return found
