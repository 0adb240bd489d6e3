"""Rays through boxes over a ground plane: hits, and the light there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ffseg.learning.drawn.skins import AnyArray, Skin

SKY, GROUND = -1, 0
"""What a ray met that met no box; box k is k + 1."""

FAR, NEAR = 1e9, 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """A box on or over the ground: middle of its foot, size, turn about the vertical; ``inner``: a room seen from inside."""

    foot: AnyArray
    size: AnyArray
    yaw: float
    skin: Skin
    inner: bool = False

    def seen_from(self, points: AnyArray) -> AnyArray:
        """Points in the box's own axes, from its foot."""
        return self.turned(points - self.foot)

    def turned(self, vectors: AnyArray) -> AnyArray:
        """Directions in the box's own axes."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
        return np.stack([x * c + y * s, -x * s + y * c, z], -1)

    def distance(self, points: AnyArray) -> AnyArray:
        """Along the ground, from (N, 3) points outside the box (inside a room) to its foot line; 0 on the other side."""
        apart = abs(self.seen_from(points)[:, :2]) - self.size[:2] / 2
        if self.inner:
            return np.asarray(np.maximum(-apart.max(axis=1), 0))
        return np.asarray(np.hypot(*np.maximum(apart, 0).T))


@dataclass(frozen=True, slots=True, eq=False)
class Lamp:
    """A light; ``soft`` 0 casts full shadows, 2 and more none."""

    place: AnyArray
    power: float
    soft: float


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """What there is to see.

    Attributes
    ----------
    boxes : sequence of Box
    ground : Skin
    lamps : sequence of Lamp
    ambient, gloss, occlusion : float
        Light from everywhere; how much the ground mirrors; how dark it is where things touch it.
    sky : tuple of two colours
        At the horizon and overhead.
    sun : ndarray, shape (3,), optional
        Direction towards it.
    patches : sequence of (centre, axes, power)
        Parallelograms of light on the ground: |axes (place - centre)| < 1 in both.
    """

    boxes: Sequence[Box]
    ground: Skin
    lamps: Sequence[Lamp]
    ambient: float
    gloss: float
    occlusion: float
    sky: tuple[AnyArray, AnyArray]
    sun: AnyArray | None = None
    patches: Sequence[tuple[AnyArray, AnyArray, float]] = field(default_factory=list)


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """Where rays end: distance, index of what is met, places, axis of a box's face."""

    distance: AnyArray
    index: AnyArray
    place: AnyArray
    face: AnyArray


def cast(origin: AnyArray, rays: AnyArray, boxes: Sequence[Box], *, ground: bool = True) -> Hits:
    """What (N, 3) rays from one origin, or from one each, meet first."""
    count = len(rays)
    distance, index = np.full(count, FAR, np.float32), np.full(count, SKY, np.int16)
    face = np.full(count, 2, np.int8)
    if ground:
        with np.errstate(divide="ignore", invalid="ignore"):
            down = -origin[..., 2] / rays[:, 2]
        met = (rays[:, 2] < -1e-6) & (down > NEAR)
        distance[met], index[met] = down[met], GROUND
    for number, box in enumerate(boxes, 1):
        start, way = box.seen_from(origin), box.turned(rays)
        way = np.where(abs(way) < 1e-9, 1e-9, way)
        low, high = box.size * [-0.5, -0.5, 0], box.size * [0.5, 0.5, 1]
        one, other = (low - start) / way, (high - start) / way
        enters, leaves = np.minimum(one, other), np.maximum(one, other)
        if box.inner:
            at, axis = leaves.min(axis=1), leaves.argmin(axis=1)
            met = (at > NEAR) & (at < distance)
        else:
            at, axis = enters.max(axis=1), enters.argmax(axis=1)
            met = (at < leaves.min(axis=1)) & (at > NEAR) & (at < distance)
        distance[met], index[met], face[met] = at[met], number, axis[met]
    return Hits(distance, index, origin + rays * distance[:, None], face)


def shaded(
    scene: World, origin: AnyArray, rays: AnyArray, rng: np.random.Generator, *, mirrored: bool = False
) -> tuple[AnyArray, Hits]:
    """Colours that rays bring back, shape (N, 3), and where they ended; what is mirrored casts no shadows of its own."""
    hits = cast(origin, rays, scene.boxes)
    found, normals = _surfaces(scene, rays, hits)
    open_sky, on_ground = hits.index == SKY, hits.index == GROUND
    found[~open_sky] *= _light(scene, hits, normals, shadows=not mirrored)[~open_sky, None]
    if not mirrored and scene.gloss > 0 and on_ground.any():
        found[on_ground] = _glossy(scene, found[on_ground], hits.place[on_ground], rays[on_ground], rng)
    return found, hits


def _surfaces(scene: World, rays: AnyArray, hits: Hits) -> tuple[AnyArray, AnyArray]:
    """Albedos, or the colours of the sky, and normals."""
    found, normals = np.empty((len(rays), 3), np.float32), np.zeros((len(rays), 3), np.float32)
    sky, ground = hits.index == SKY, hits.index == GROUND
    up = np.clip(rays[sky, 2], 0, 1)[:, None]
    found[sky] = scene.sky[0] * (1 - up) + scene.sky[1] * up
    found[ground] = scene.ground(hits.place[ground, :2], hits.place[ground, 2])
    normals[ground, 2] = 1
    for number, box in enumerate(scene.boxes, 1):
        met = hits.index == number
        if not met.any():
            continue
        at, way, face = box.seen_from(hits.place[met]), box.turned(rays[met]), hits.face[met]
        flat = np.where((face == 0)[:, None], at[:, [1, 2]], np.where((face == 1)[:, None], at[:, [0, 2]], at[:, :2]))
        found[met] = box.skin(flat, at[:, 2])
        every = np.arange(len(face))
        outward = np.zeros((len(face), 3))
        outward[every, face] = -np.sign(way[every, face])
        c, s = np.cos(box.yaw), np.sin(box.yaw)
        x, y, z = outward.T
        normals[met] = np.stack([x * c - y * s, x * s + y * c, z], 1)
    return found, normals


def _light(scene: World, hits: Hits, normals: AnyArray, *, shadows: bool) -> AnyArray:
    light = scene.ambient * (1 + 0.15 * normals[:, 2] + 0.1 * normals[:, 0])
    solid = [box for box in scene.boxes if not box.inner]
    above = hits.place + normals * 1e-3
    for lamp in scene.lamps:
        towards = lamp.place - hits.place
        away = np.linalg.norm(towards, axis=1)
        towards = towards / away[:, None]
        part = np.clip((normals * towards).sum(axis=1), 0, 1) * lamp.power / (1 + (away / 4) ** 2)
        if shadows and lamp.soft < 2:
            between = cast(above, towards, solid, ground=False)
            part = part * np.where((between.index >= 0) & (between.distance < away), lamp.soft / 2, 1)
        light = light + part
    if scene.sun is not None:
        part = 1.2 * np.clip(normals @ scene.sun, 0, 1)
        if shadows:
            part = part * (cast(above, np.repeat(scene.sun[None], len(above), 0), solid, ground=False).index < 0)
        light = light + part
    ground = hits.index == GROUND
    for centre, axes, power in scene.patches:
        within = (abs((hits.place[:, :2] - centre) @ axes) < 1).all(axis=1)
        light = light + np.where(ground & within, power, 0)
    light[ground] *= _openness(scene, hits.place[ground])
    return np.asarray(light)


def _openness(scene: World, places: AnyArray) -> AnyArray:
    """How much of the light from everywhere reaches the ground beside things."""
    near = np.full(len(places), 9.0)
    for box in scene.boxes:
        if box.foot[2] < 0.3:
            near = np.minimum(near, box.distance(places) + max(0.0, float(box.foot[2])))
    return np.asarray(1 - scene.occlusion * (np.exp(-near / 0.12) + 0.3 * np.exp(-near / 0.8)) / 1.3)


def _glossy(scene: World, own: AnyArray, places: AnyArray, rays: AnyArray, rng: np.random.Generator) -> AnyArray:
    """The ground's colours with what it mirrors (Schlick's factor) and the lamps' highlights."""
    back = rays * [1, 1, -1]
    back[:, :2] += rng.normal(0, 0.004, (len(back), 2))
    mirror = shaded(scene, places + [0, 0, 2e-3], back, rng, mirrored=True)[0]
    share = (scene.gloss * (0.06 + 0.94 * (1 - abs(rays[:, 2])) ** 4))[:, None]
    found = own * (1 - share) + mirror * share
    for lamp in scene.lamps:
        towards = lamp.place - places
        towards = towards / np.linalg.norm(towards, axis=1)[:, None]
        sharp = rng.choice([60, 200, 800])
        found = found + (scene.gloss * lamp.power * 1.5 * np.clip((back * towards).sum(axis=1), 0, 1) ** sharp)[:, None]
    return np.asarray(found)
