"""Where the contours of one result cross themselves or each other: what no result may do."""

from collections.abc import Sequence

import numpy as np
import shapely

from ffseg.geometry.freeform import FreeForm

CROSSING_TOLERANCE = 0.01
"""Pixels: a hundredth of a pixel shows neither in a mask nor in a picture."""


def self_intersections(contours: Sequence[FreeForm], tolerance: float = CROSSING_TOLERANCE) -> list[shapely.Polygon]:
    """Faces wider than `tolerance` that are inside twice, or less than outside beside others that are inside.

    Contours that cross make such faces (a lens, a loop); contours that touch, run along each other or nest as holes and
    islands do make none. The curves are flattened within a quarter of the tolerance.
    """
    polygons = [polygon for contour in contours if len(polygon := contour.flatten(tolerance / 4)) >= 3]
    lines = shapely.unary_union([shapely.LinearRing(polygon) for polygon in polygons])
    faces = [face for face in shapely.polygonize([lines]).geoms if not face.buffer(-tolerance / 2).is_empty]
    places = [face.buffer(-tolerance / 2).representative_point().coords[0] for face in faces]
    if not faces:
        return []
    turns = np.sum([FreeForm.polygon(polygon).winding(places) for polygon in polygons], axis=0)
    lowest = 0 if turns.max() > 0 else -1
    return [face for face, turn in zip(faces, turns.tolist(), strict=True) if not lowest <= turn <= 1]
