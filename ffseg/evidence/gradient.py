"""The image's own edges: the source ``gradient``."""

from __future__ import annotations

from ffseg.image.edges import EdgeMap, edge_map
from ffseg.scene import Scene


def gradient(scene: Scene) -> EdgeMap:
    """Canny edges of the whole image, and its gradient (first step of Algorithm 5, Eq. 8)."""
    return edge_map(scene.image, scene.params.edges, scene.domain)
