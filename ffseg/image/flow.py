"""What was seen in one frame of a film, laid where motion has taken it in the next."""

from __future__ import annotations

import cv2
import numpy as np

from ffseg.arrays import Image, Indices, Mask, Plane
from ffseg.image.disc import brightest_channel
from ffseg.image.free import distances
from ffseg.image.keypoints import grey_image
from ffseg.image.parts import parts_holding

BOUNDARY_BAND = 3.0
"""Pixels: boundaries of two frames nearer to each other than this are two readings of the same one."""
SMOOTHING, MIN_CHANGE, MAX_CHANGE = 1.5, 8.0, 6.0
"""Smoothing, in pixels, before two frames are compared. Grey levels of change that need no motion; where all the picture is noisy
or its light changes, the median change times the last. In 937 pairs of drawn frames that pan, zoom, flicker or are noisy a region
keeps .93 of its pixels at least; of 16 things in the last frame before they leave the picture .41 at most, of 14 of them .14."""
_SQUARED_BAND = int((BOUNDARY_BAND + 0.5) ** 2)
_REACH = int(BOUNDARY_BAND + 0.5)
_OFFSETS = sorted(
    (
        (y * y + x * x, y, x)
        for y in range(-_REACH, _REACH + 1)
        for x in range(-_REACH, _REACH + 1)
        if 0 < y * y + x * x <= _SQUARED_BAND
    ),
    reverse=True,
)
"""Squared distance, rows and columns of the pixels within the band of one, far ones first."""
_MIN_SIDE = 64
"""Pixels: OpenCV's flow refuses images of less than 12 a side, and with 24 beside 400 it reads motion that is not there."""


def origins(before: Image, now: Image) -> Plane:
    """Where the motion between two frames says that each pixel of the later one was in the frame before.

    Parameters
    ----------
    before, now : ndarray of uint8, shape (H, W) or (H, W, 3)
        Two frames of one size.

    Returns
    -------
    ndarray of float32, shape (H, W, 2)
        x and y in pixels.

    References
    ----------
    T. Kroeger, R. Timofte, D. Dai, L. Van Gool: Fast Optical Flow using Dense Inverse Search, ECCV 2016.
    """
    height, width = now.shape[:2]
    late, early = _wide(now), _wide(before)
    flow = np.zeros((*late.shape, 2), np.float32)
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST).calc(late, early, flow)[:height, :width]
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    return np.asarray(np.dstack([x, y]) + flow, np.float32)


def carried_region(region: Mask, places: Plane) -> Mask:
    """A region of the frame before, shape (H, W), in the later one, whose pixels were at these places (`origins`)."""
    return np.asarray(cv2.remap(region.astype(np.float32), places[..., 0], places[..., 1], cv2.INTER_LINEAR) >= 0.5)


def kept_colours(before: Image, now: Image, places: Plane) -> Mask:
    """Which pixels of the later frame still have the colour that they had at these places, up to `MAX_CHANGE`, shape (H, W)."""
    x, y = places[..., 0], places[..., 1]
    came = cv2.remap(_smooth(before), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    change = brightest_channel(np.asarray(cv2.absdiff(_smooth(now), came), np.uint8))
    return np.asarray(change <= max(MIN_CHANGE, MAX_CHANGE * float(np.median(change))))


def steadied_region(own: Mask, before: Mask) -> Mask:
    """A frame's own region with its boundary half-way to that carried from the frame before, where they lie close.

    What lies further than `BOUNDARY_BAND` from either boundary is the frame's own affair, and so is every hole of it.

    Parameters
    ----------
    own, before : ndarray of bool, shape (H, W)
    """
    if not (own.any() and before.any()):
        return own
    apart = (own != before) & ~_holes(own)  # elsewhere both say the same
    rows, columns = np.nonzero(apart)
    depth, old = (_squared_depths(one, rows, columns) for one in (own, before))
    steadied, inside = own.copy(), own[rows, columns]
    deeper = np.where(inside, depth > old, old > depth)  # in the region that it lies in than outside the other
    near = np.maximum(depth, old) <= _SQUARED_BAND
    steadied[rows, columns] = np.where(near, deeper, inside)
    return steadied


def start_in(region: Mask, circle: tuple[float, float, float]) -> tuple[float, float, float]:
    """A start circle, x, y and radius, moved as little as it must to lie in a region; as it is where there is no room."""
    x, y, radius = circle
    depth = distances(region) - np.float32(0.5)
    radius = min(radius, float(depth.max(initial=0.0)) / 2)
    rows, columns = np.nonzero(depth > radius)
    if radius < 1 or not len(rows):
        return circle
    nearest = int(np.argmin((columns - x) ** 2 + (rows - y) ** 2))
    return float(columns[nearest]), float(rows[nearest]), radius


def _smooth(image: Image) -> Image:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), SMOOTHING), np.uint8)


def _wide(image: Image) -> Image:
    """The image in grey, its last rows and columns repeated as often as the flow needs."""
    grey = grey_image(image)
    height, width = grey.shape
    more = (max(0, _MIN_SIDE - height), max(0, _MIN_SIDE - width))
    return np.asarray(cv2.copyMakeBorder(grey, 0, more[0], 0, more[1], cv2.BORDER_REPLICATE), np.uint8)


def _squared_depths(region: Mask, rows: Indices, columns: Indices) -> Indices:
    """Squared distance of pixels to the nearest on the other side of a region's boundary, px; beyond the band just more than it.

    The border of the image is no boundary. The boundary is half a pixel from the pixels beside it.
    """
    padded = np.pad(region.view(np.uint8), _REACH, constant_values=2)
    other, found = 1 - padded[rows + _REACH, columns + _REACH], np.full(len(rows), _SQUARED_BAND + 1)
    for square, y, x in _OFFSETS:
        found[padded[rows + _REACH + y, columns + _REACH + x] == other] = square
    return found


def _holes(region: Mask) -> Mask:
    """Pixels outside that do not reach the border of the image."""
    rim = np.zeros_like(region)
    rim[[0, -1]] = rim[:, [0, -1]] = True
    return ~region & ~parts_holding(~region, rim, corners=True)
