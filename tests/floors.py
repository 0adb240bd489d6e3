"""Pairs and sequences on floors of every kind: bare, glossy, shaded, seen by a camera that nods or turns."""

from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from ffseg.rendering.pairs import MAX_TURN, PlanarPose, RenderedPair, RenderedSequence, random_poses, sample_camera
from ffseg.rendering.raycast import render
from ffseg.rendering.scene import Floor, MarkKind, World, random_scene

FloorKind = Literal["plain", "glossy", "shadows", "nodding", "turning", "discs", "touching", "alike"]
FLOOR_KINDS: tuple[FloorKind, ...] = get_args(FloorKind)
TEXTURES, NOISES = (0.0, 1.0, 2.0, 3.0, 5.0), (1.0, 2.0, 4.0)
"""Grey levels."""
NOD = np.deg2rad(1.5)
"""Of either camera from the vertical, so that two views differ by up to 3 degrees."""
QUARTER = np.deg2rad(90.0)
STEP = 0.12
"""Metres between the images of a sequence."""

Tilt = tuple[float, float]


def floor_pair(seed: int, kind: FloorKind, texture: float, noise: float) -> RenderedPair:
    """Render a pair on a floor with a texture under the noise of a sensor, standard deviations in grey levels.

    ``glossy``: a mirrored strip moves with the camera; ``shadows`` of boxes; ``nodding``: each view tilted by up to 1.5
    degrees; ``turning``: up to 90 degrees between the views; ``discs``: marks without corners; ``touching``: marks side
    by side; ``alike``: walls whose shading crosses the floor's grey, boxes with squares of it.
    """
    camera = sample_camera()
    random = np.random.default_rng([seed, 11])
    poses = random_poses(random, QUARTER if kind == "turning" else MAX_TURN)
    scene = _scene(seed, kind, np.array(poses[0][:2]), random)
    scene = replace(scene, floor=_floor(random, kind, texture, noise))
    if kind == "alike":
        scene = _alike(scene, random)
    tilts = tuple(_tilt(random, NOD) if kind == "nodding" else (0.0, 0.0) for _ in poses)
    views = [render(scene, camera, pose, index, tilts[index]) for index, pose in enumerate(poses)]
    return RenderedPair(views[0], views[1], camera, poses, scene, (tilts[0], tilts[1]))


def floor_sequence(seed: int, num_views: int, texture: float, noise: float, nod: float = 0.0) -> RenderedSequence:
    """Views of a robot that drives a curve through a scene, each tilted by up to `nod` radians on a bearing of its own."""
    camera, random = sample_camera(), np.random.default_rng([seed, 12])
    poses = _path(random, num_views)
    scene = _scene(seed, "plain", np.array([pose[:2] for pose in poses]), random)
    scene = replace(scene, floor=_floor(random, "plain", texture, noise))
    tilts = [_tilt(random, nod) if nod else (0.0, 0.0) for _ in poses]
    views = (render(scene, camera, pose, index, tilts[index]) for index, pose in enumerate(poses))
    return RenderedSequence(tuple(views), tuple(poses), scene, tuple(tilts))


def _path(random: np.random.Generator, num_views: int) -> list[PlanarPose]:
    bearing, bend = random.uniform(0, 2 * np.pi), random.uniform(-0.06, 0.06)
    headings = bearing + bend * np.arange(num_views)
    places = np.cumsum(STEP * np.stack([np.cos(headings), np.sin(headings)], axis=1), axis=0)
    places -= places.mean(axis=0)
    return [(float(x), float(y), float(heading)) for (x, y), heading in zip(places, headings, strict=True)]


def _scene(seed: int, kind: FloorKind, clear_of: np.ndarray, random: np.random.Generator) -> World:
    own: dict[FloorKind, MarkKind] = {"discs": "discs", "touching": "touching"}
    return random_scene(int(random.integers(1 << 30)) ^ seed, 0.9, clear_of, own.get(kind, "mixed"))


def _alike(scene: World, random: np.random.Generator) -> World:
    """The scene with things that have the floor's grey in places."""
    shading = float(random.uniform(30, 60)), float(random.uniform(1.5, 3.0))
    boxes = tuple(
        replace(box, squares=(float(random.uniform(0.02, 0.045)), scene.ground_grey), label_contrast=0.0)
        for box in scene.boxes
    )
    return replace(scene, boxes=boxes, room=replace(scene.room, grey=scene.ground_grey, shading=shading))


def _floor(random: np.random.Generator, kind: FloorKind, texture: float, noise: float) -> Floor:
    light = (float(random.uniform(0, 2 * np.pi)), float(random.uniform(0.8, 2.5)))
    near = float(random.uniform(0.55, 0.8))
    streak = (
        float(random.uniform(0, 2 * np.pi)), near, near + float(random.uniform(0.3, 0.9)),
        float(random.uniform(0.06, 0.1)), float(random.uniform(45, 90)),
    )  # fmt: skip
    return Floor(texture, noise, light if kind == "shadows" else None, streak if kind == "glossy" else None)


def _tilt(random: np.random.Generator, most: float) -> Tilt:
    size, bearing = random.uniform(0, most), random.uniform(0, 2 * np.pi)
    return float(size * np.cos(bearing)), float(size * np.sin(bearing))
