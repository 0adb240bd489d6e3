"""Where two rays of a moving camera meet: the naive way, by the middle of the shortest segment between them."""

import numpy as np

from ffseg.arrays import Array
from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion


def triangulate(camera: Camera, motion: Motion, current: Array, previous: Array) -> tuple[Array, Array]:
    """Points (n, 3) in the current camera's frame, and how many pixels their projections miss, at most of both images."""
    rays, seen = camera.lift(current), camera.lift(previous) @ motion.rotation
    center = -motion.translation @ motion.rotation
    points = np.empty_like(rays)
    for place, (one, other) in enumerate(zip(rays, seen, strict=True)):
        along, back = np.linalg.lstsq(np.stack([one, -other], axis=1), center, rcond=None)[0]
        points[place] = 0.5 * (along * one + center + back * other)
    back_again = np.stack([camera.project(points), camera.project(motion.apply(points))])
    return points, np.linalg.norm(back_again - np.stack([current, previous]), axis=2).max(axis=0)
