"""Rendered scenes: catadioptric views of a ground plane with marks, boxes and walls, with their truths. Numpy only."""

from ffseg.rendering.floors import FLOOR_KINDS, floor_pair, floor_sequence
from ffseg.rendering.pairs import CAMERA_YAML, RenderedPair, poses_csv, render_pair, sample_camera
from ffseg.rendering.raycast import Rendering, render
from ffseg.rendering.scene import Box, Mark, Room, Scene, random_scene

__all__ = [
    "CAMERA_YAML",
    "FLOOR_KINDS",
    "Box",
    "Mark",
    "RenderedPair",
    "Rendering",
    "Room",
    "Scene",
    "floor_pair",
    "floor_sequence",
    "poses_csv",
    "random_scene",
    "render",
    "render_pair",
    "sample_camera",
]
