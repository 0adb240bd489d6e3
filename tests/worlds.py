"""Rendered worlds as shapely geometry: where the ground is free, and how far, by another library than ffseg."""

import numpy as np
import shapely
from shapely import affinity

from ffseg.rendering.scene import Box, World

FAR = 50.0


def footprint(box: Box) -> shapely.Polygon:
    x, y = box.half
    return affinity.translate(
        affinity.rotate(shapely.box(-x, -y, x, y), box.angle, origin=(0, 0), use_radians=True), *box.center
    )


def free_ground(scene: World) -> shapely.Polygon:
    """The room's floor without what stands on it, in the world's frame."""
    x, y = scene.room.half
    floor = affinity.rotate(shapely.box(-x, -y, x, y), scene.room.angle, origin=(0, 0), use_radians=True)
    return floor.difference(shapely.union_all([footprint(box) for box in scene.boxes]))


def in_robot_frame(ground: shapely.Polygon, pose: tuple[float, float, float]) -> shapely.Polygon:
    x, y, theta = pose
    return affinity.rotate(affinity.translate(ground, -x, -y), -theta, origin=(0, 0), use_radians=True)


def range_along(ground: shapely.Polygon, bearing: float) -> float:
    """Metres from the origin to where a ray first leaves the ground; NaN when it never meets it."""
    ray = shapely.LineString([(0.0, 0.0), (FAR * np.cos(bearing), FAR * np.sin(bearing))])
    inside = ray.intersection(ground)
    pieces = [one for one in getattr(inside, "geoms", [inside]) if one.geom_type == "LineString" and one.length > 1e-9]
    if not pieces:
        return float("nan")
    return min(max(np.hypot(*np.array(one.coords).T)) for one in pieces)
