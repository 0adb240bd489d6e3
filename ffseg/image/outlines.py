"""Outlines of the regions in a mask."""

from __future__ import annotations

import cv2
import numpy as np

from ffseg.arrays import Array, Image
from ffseg.geometry.orientation import ring_area

OUTLINE_TOLERANCE = 0.75
"""Pixels between an outline and the pixel boundary: less than one, so that no pixel is lost."""


def outlines(mask: Image) -> list[Array]:
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
    polygons = []
    for index, contour in enumerate(simple):
        is_hole = hierarchy[0][index][3] >= 0
        thin = len(contour) < 3 and not is_hole  # of one pixel's width: simplified, nothing would be left
        polygon = ((found[index] if thin else contour)[:, 0, :].astype(np.float64) - 0.5) / 2
        area = ring_area(polygon)
        if area != 0:
            polygons.append(polygon if (area > 0) != is_hole else polygon[::-1])
    return polygons
