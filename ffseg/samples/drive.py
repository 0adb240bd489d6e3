"""A drive round a screen in a room, as a camera under a mirror sees it: 40 images of 320x240 pixels."""

from __future__ import annotations

import numpy as np

from ffseg.camera.model import Camera
from ffseg.rendering.pairs import PlanarPose, RenderedSequence, mirror_camera, mirror_yaml
from ffseg.rendering.raycast import render
from ffseg.rendering.scene import Box, Floor, Mark, Room, World

FRAMES = 40
LONG, SHORT = 1.9, 1.15
"""Metres: half axes of the ellipse that is driven, once round and a little more."""
TURNS = 1.03
GROUND = 112.0
_CAMERA = ((320, 240), 112.0, 18, 117)
DRIVE_CAMERA = mirror_yaml(*_CAMERA)
"""Camera file of `drive_camera`."""


def drive_camera() -> Camera:
    """The camera of the rendered pairs at two fifths of its size: 40 views are drawn in seconds."""
    return mirror_camera(*_CAMERA)


def drive_scene() -> World:
    """A room with a screen in the middle, five boxes and four marks."""
    boxes = (
        _box((0.0, 0.0), (0.75, 0.1), 0.0, 0.5, 205.0),
        _box((-2.7, 1.6), (0.3, 0.2), 0.4, 0.4, 40.0),
        _box((2.75, 1.55), (0.2, 0.25), 0.2, 0.35, 215.0),
        _box((0.3, 2.1), (0.35, 0.15), -0.1, 0.3, 35.0),
        _box((2.9, -1.2), (0.25, 0.25), 0.7, 0.45, 30.0),
        _box((-0.9, -2.15), (0.2, 0.2), 0.5, 0.3, 210.0),
    )
    marks = (
        _mark((-1.95, -0.75), (0.3, 0.3), 0.3, 40.0),
        _mark((1.3, 0.45), (0.22, 0.22), 0.9, 220.0),
        _mark((1.1, -1.9), (0.6, 0.12), 0.15, 225.0),
        _mark((-1.2, 2.0), (0.5, 0.12), 0.35, 228.0),
    )
    return World(marks, boxes, Room((3.7, 2.8), 0.0, 180.0), GROUND, 29, Floor(2.0, 1.0))


def drive_poses() -> list[PlanarPose]:
    """Once round the screen, looking ahead."""
    turn = np.linspace(-np.pi / 2, -np.pi / 2 + 2 * np.pi * TURNS, FRAMES)
    heading = np.unwrap(np.arctan2(SHORT * np.cos(turn), -LONG * np.sin(turn)))
    places = zip(LONG * np.cos(turn), SHORT * np.sin(turn), heading, strict=True)
    return [(round(float(x), 4), round(float(y), 4), round(float(theta), 5)) for x, y, theta in places]


def drive(frames: int = FRAMES) -> RenderedSequence:
    """The drive, or its beginning."""
    scene, camera, poses = drive_scene(), drive_camera(), drive_poses()[:frames]
    views = tuple(render(scene, camera, pose, number, subsamples=2) for number, pose in enumerate(poses))
    return RenderedSequence(views, tuple(poses), scene)


def _box(center: tuple[float, float], half: tuple[float, float], angle: float, height: float, grey: float) -> Box:
    greys = tuple(grey + step for step in (8.0, 0.0, -10.0, 4.0, -6.0))
    return Box(np.array(center), np.array(half), angle, height, greys, 0.0)


def _mark(center: tuple[float, float], half: tuple[float, float], angle: float, grey: float) -> Mark:
    c, s = np.cos(angle), np.sin(angle)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    return Mark(center + corners @ np.array([[c, s], [-s, c]]), grey)
