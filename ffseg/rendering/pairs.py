"""Pairs of views of one random scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffseg.camera.model import Camera
from ffseg.camera.projections import Affine, UnifiedSphere
from ffseg.rendering.raycast import Rendering, render
from ffseg.rendering.scene import World, random_scene

MIN_BASELINE, MAX_BASELINE = 0.15, 0.4
"""Metres between the two views."""
MAX_TURN = np.deg2rad(20.0)

PlanarPose = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class RenderedPair:
    """Two views of one scene.

    Attributes
    ----------
    poses : tuple of (x, y, theta)
        Of the previous and of the current view, metres and radians.
    tilts : tuple of (float, float)
        Of the previous and of the current view from the vertical, radians, as `render` takes them.
    """

    previous: Rendering
    current: Rendering
    camera: Camera
    poses: tuple[PlanarPose, PlanarPose]
    scene: World
    tilts: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class RenderedSequence:
    """Views along a path over one scene, their poses, and their tilts as of a pair: none of a level drive."""

    views: tuple[Rendering, ...]
    poses: tuple[PlanarPose, ...]
    scene: World
    tilts: tuple[tuple[float, float], ...] = ()


def mirror_camera(size: tuple[int, int], focal: float, robot: int, rim: int) -> Camera:
    """A catadioptric camera 0.9 m above the ground: width and height, focal length and radii, px."""
    center = ((size[0] - 1) / 2, (size[1] - 1) / 2)
    lens = UnifiedSphere(Affine(focal, focal, *center), 0.95, (0.0, 0.0, 0.0, 0.0))
    return Camera(lens, *size, center, mount_height=0.9, robot_radius=float(robot), rim_radius=float(rim))


def mirror_yaml(size: tuple[int, int], focal: float, robot: int, rim: int) -> str:
    """The camera file of a `mirror_camera`."""
    values: dict[str, object] = {"model": "unified", "width": size[0], "height": size[1], "xi": 0.95}
    values |= {"fx": focal, "fy": focal, "cx": (size[0] - 1) / 2, "cy": (size[1] - 1) / 2}
    values |= {"mount_height": 0.9, "robot_radius": robot, "rim_radius": rim}
    return "".join(f"{key}: {value}\n" for key, value in values.items())


_SAMPLE = ((800, 600), 280.0, 46, 292)
CAMERA_YAML = mirror_yaml(*_SAMPLE)
"""Camera file of `sample_camera`."""


def sample_camera() -> Camera:
    """The camera of the rendered scenes."""
    return mirror_camera(*_SAMPLE)


def random_poses(random: np.random.Generator, widest: float = MAX_TURN) -> tuple[PlanarPose, PlanarPose]:
    """Poses of a pair: the current one turned anyhow at the origin, the previous one 0.15 to 0.4 m away."""
    baseline, bearing = random.uniform(MIN_BASELINE, MAX_BASELINE), random.uniform(0, 2 * np.pi)
    theta = random.uniform(-np.pi, np.pi)
    previous = (
        float(baseline * np.cos(bearing)),
        float(baseline * np.sin(bearing)),
        float(theta + random.uniform(-widest, widest)),
    )
    return previous, (0.0, 0.0, float(theta))


def render_pair(seed: int) -> RenderedPair:
    """Render a pair; the same seed gives the same pixels."""
    camera = sample_camera()
    poses = random_poses(np.random.default_rng([seed, 5]))
    scene = random_scene(seed, camera.mounting(), np.array(poses[0][:2]))
    previous, current = (render(scene, camera, pose, index) for index, pose in enumerate(poses))
    return RenderedPair(previous, current, camera, poses, scene)


def poses_csv(poses: Sequence[PlanarPose], names: Sequence[str]) -> str:
    """Poses file of images that have these names."""
    rows = [f"{name},{x!r},{y!r},{theta!r}" for name, (x, y, theta) in zip(names, poses, strict=True)]
    return "\n".join(["image,x,y,theta", *rows, ""])
