"""Outlines of the regions in a mask."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.geometry.orientation import ring_area

OUTLINE_TOLERANCE = 0.75
"""Pixels by which an outline may leave the pixel staircase: less than a pixel, so that no pixel is lost."""


def outlines(mask: NDArray[np.uint8]) -> list[NDArray[np.float64]]:
    """Closed polygons round the regions of a mask.

    Parameters
    ----------
    mask : ndarray of uint8, shape (H, W)
        Nonzero inside.

    Returns
    -------
    list of ndarray, each (M, 2), M >= 3
        Outer polygons with positive shoelace area, holes with negative area, half a pixel outside the centres of
        the border pixels.
    """
    scaled = cv2.resize((mask != 0).astype(np.uint8), None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
    found, hierarchy = cv2.findContours(scaled, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    simple = [cv2.approxPolyDP(contour, 2 * OUTLINE_TOLERANCE, closed=True) for contour in found]
    thin = all(len(one) < 3 for one in simple)  # a mask of lines: simplified, nothing would be left
    polygons = []
    for index, contour in enumerate(found if thin else simple):
        polygon = (contour[:, 0, :].astype(np.float64) - 0.5) / 2
        if len(polygon) < 3:
            continue
        area = ring_area(polygon)
        is_hole = hierarchy[0][index][3] >= 0
        if area != 0:
            polygons.append(polygon if (area > 0) != is_hole else polygon[::-1])
    return polygons
