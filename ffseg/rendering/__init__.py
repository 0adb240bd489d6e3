"""Rendered scenes: catadioptric views of a ground plane with marks, boxes and walls, with their truths. Numpy only."""

from ffseg.rendering.pairs import RenderedPair, render_pair
from ffseg.rendering.raycast import Rendering, render
from ffseg.rendering.scene import Box, Mark, Room, Scene, random_scene

__all__ = ["Box", "Mark", "RenderedPair", "Rendering", "Room", "Scene", "random_scene", "render", "render_pair"]
