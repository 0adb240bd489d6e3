"""Ray casting of a scene through a camera: image, truth mask and labels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Array, Image, Mask
from ffseg.camera.model import Camera
from ffseg.rendering.scene import Box, Mark, Room, World
from ffseg.rendering.texture import Noise

SurfaceLabels = NDArray[np.int16]

OUTSIDE, GROUND, FIRST_MARK, STREAK, SHADOW, FIRST_BOX, FIRST_WALL = -1, 0, 1, 90, 91, 100, 200
SUBSAMPLES = 4
"""Per axis, in pixels where two surfaces meet."""
ROBOT_GREY, OUTSIDE_GREY = 28.0, 4.0
RADIANS_PER_PIXEL = 1.0 / 160.0
"""Typical of a mirror that spreads half the sphere over 300 pixels; only the fading of texture uses it."""
MAX_RANGE = 50.0
"""Metres; stands for rays that meet no wall."""

GROUND_OCTAVES = ((0.02, 3.0), (0.04, 3.5), (0.08, 3.5), (0.16, 3.0), (0.5, 5.0), (1.6, 9.0))
FACE_OCTAVES = ((0.015, 3.0), (0.03, 4.0), (0.06, 4.0), (0.12, 4.0))
WALL_OCTAVES = ((0.05, 3.0), (0.2, 3.0), (0.8, 6.0))


@dataclass(frozen=True, slots=True, eq=False)
class Rendering:
    """One view.

    Attributes
    ----------
    image : ndarray of uint8, shape (H, W)
    truth : ndarray of bool, shape (H, W)
        Free space: ground and marks connected with the robot, and the robot's own disc.
    labels : ndarray of int16, shape (H, W)
        What the pixel's centre shows: -1 robot or nothing, 0 ground, from 1 marks, 90 a mirrored streak, 91 a box's
        shadow, from 100 boxes, from 200 walls.
    """

    image: Image
    truth: Mask
    labels: SurfaceLabels


@dataclass(frozen=True, slots=True, eq=False)
class _Hits:
    """What rays meet: label, a finer number that also tells faces and patterns apart, and the grey."""

    label: SurfaceLabels
    part: NDArray[np.int32]
    grey: Array


FLOOR_OCTAVES = ((0.02, 3.0), (0.04, 3.5), (0.08, 3.5), (0.16, 3.0), (0.5, 5.0))
VALUE_NOISE_SIGMA = 0.429
"""Standard deviation of value noise of amplitude 1: nodes are uniform (1/3), smoothstep weights leave 0.552 of that."""
SHADOW_GREY = 0.62
"""Part of the light that reaches a shadow."""


def render(
    scene: World,
    camera: Camera,
    pose: tuple[float, float, float],
    noise_seed: int = 0,
    tilt: tuple[float, float] = (0.0, 0.0),
    subsamples: int = SUBSAMPLES,
) -> Rendering:
    """Render a view.

    Parameters
    ----------
    camera : Camera
        Level (``up`` is (0, 0, -1)), with mount height and rim radius.
    pose : tuple of float
        (x, y, theta) on the ground, metres and radians.
    noise_seed : int
        Of the sensor noise.
    tilt : tuple of float
        Turns of the camera about its own x and then y axis, radians: a robot that nods.
    subsamples : int
        Per axis, in pixels where two surfaces meet.
    """
    caster = _Caster(scene, camera, pose, tilt)
    x, y = np.meshgrid(np.arange(camera.width, dtype=np.float64), np.arange(camera.height, dtype=np.float64))
    seen = camera.domain() & (np.hypot(x - camera.center[0], y - camera.center[1]) > camera.robot_radius)
    hits = caster.cast(np.stack([x[seen], y[seen]], axis=1))
    labels = np.full(seen.shape, OUTSIDE, dtype=np.int16)
    parts = np.full(seen.shape, -1, dtype=np.int32)
    grey = np.full(seen.shape, OUTSIDE_GREY)
    grey[~seen & camera.domain()] = ROBOT_GREY
    labels[seen], parts[seen], grey[seen] = hits.label, hits.part, hits.grey
    parts[~seen & camera.domain()] = -2
    _smooth_edges(grey, parts, caster, subsamples)
    noise = np.random.default_rng([scene.seed, 7, noise_seed]).normal(0.0, scene.floor.noise_sigma, grey.shape)
    image = np.clip(np.rint(grey + noise), 0, 255).astype(np.uint8)
    return Rendering(image, _truth(labels, camera), labels)


def _smooth_edges(grey: Array, parts: NDArray[np.int32], caster: _Caster, subsamples: int) -> None:
    """Replace pixels on a border between parts by the mean of ``subsamples**2`` rays."""
    border = np.zeros(parts.shape, dtype=np.bool_)
    for part, marked in ((parts, border), (parts.T, border.T)):
        differs = np.diff(part, axis=0) != 0
        marked[:-1] |= differs
        marked[1:] |= differs
    rows, columns = np.nonzero(border)
    offsets = (np.arange(subsamples) + 0.5) / subsamples - 0.5
    total = np.zeros(len(rows))
    for dy in offsets:
        for dx in offsets:
            total += caster.shade(np.stack([columns + dx, rows + dy], axis=1))
    grey[rows, columns] = total / subsamples**2


class _Caster:
    def __init__(
        self, scene: World, camera: Camera, pose: tuple[float, float, float], tilt: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        self._scene, self._camera, self._pose = scene, camera, pose
        self._tilt = tilt_matrix(*tilt)
        self._height = camera.mounting()
        self._ground = Noise([scene.seed, 2], _ground_octaves(scene.floor.texture_sigma))
        self._faces = Noise([scene.seed, 3], FACE_OCTAVES)
        self._walls = Noise([scene.seed, 4], WALL_OCTAVES)

    def shade(self, pixels: Array) -> Array:
        """Grey of pixels anywhere, shape (n, 2): scene, robot's disc or outside."""
        camera = self._camera
        radius = np.hypot(pixels[:, 0] - camera.center[0], pixels[:, 1] - camera.center[1])
        grey = np.where(radius <= camera.robot_radius, ROBOT_GREY, OUTSIDE_GREY)
        inside = (radius > camera.robot_radius) & (radius <= (camera.rim_radius or np.inf))
        grey[inside] = self.cast(pixels[inside]).grey
        return grey

    def cast(self, pixels: Array) -> _Hits:
        """Meet rays of pixels, shape (n, 2), with the scene."""
        rays = self._camera.lift(pixels) @ self._tilt.T
        c, s = np.cos(self._pose[2]), np.sin(self._pose[2])
        ways = np.stack([c * rays[:, 0] - s * rays[:, 1], s * rays[:, 0] + c * rays[:, 1], -rays[:, 2]], axis=1)
        eye = np.array([self._pose[0], self._pose[1], self._height])
        with np.errstate(divide="ignore", invalid="ignore"):
            ground = np.where(ways[:, 2] < 0, -self._height / ways[:, 2], np.inf)
            label = np.full(len(ways), GROUND, dtype=np.int16)
            hits = _Hits(label, np.empty(len(ways), np.int32), np.empty(len(ways)))
            reach = self._room_hits(eye, ways, ground, hits)
            for index, box in enumerate(self._scene.boxes):
                reach = self._box_hits(eye, ways, reach, (index, box), hits)
            low = label == GROUND  # which nothing hides
            label[low], hits.grey[low] = self._ground_hits(eye, ways[low], np.minimum(ground[low], MAX_RANGE))
            hits.part[low] = label[low]
        return hits

    def _ground_hits(self, eye: Array, ways: Array, reach: Array) -> tuple[SurfaceLabels, Array]:
        points = eye[:2] + ways[:, :2] * reach[:, None]
        slope = np.maximum(-ways[:, 2], 0.02)
        grey = np.full(len(points), self._scene.ground_grey)
        label = np.full(len(points), GROUND, dtype=np.int16)
        for index, mark in enumerate(self._scene.marks):
            inside = _inside(mark, points)
            label[inside] = FIRST_MARK + index
            grey[inside] = mark.grey
        if self._scene.floor.light is not None:
            shaded = _shaded(self._scene, points)
            grey[shaded] *= SHADOW_GREY
            label[shaded] = SHADOW
        grey += self._ground(points, reach * RADIANS_PER_PIXEL / slope)
        if self._scene.floor.streak is not None:
            shining = _shining(self._scene.floor.streak, points - eye[:2])
            grey[shining] += self._scene.floor.streak[4]
            label[shining] = STREAK
        return label, grey

    def _room_hits(self, eye: Array, ways: Array, reach: Array, hits: _Hits) -> Array:
        room: Room = self._scene.room
        origin, along = _turned(eye[:2], room.angle), _turned(ways[:, :2], room.angle)
        exits = (np.sign(along) * room.half - origin) / along
        wall = np.argmin(exits, axis=1)
        far = exits[np.arange(len(exits)), wall]
        met = far < reach
        point = eye + ways[met] * far[met, None]
        across = _turned(point[:, :2], room.angle)[np.arange(met.sum()), 1 - wall[met]]
        surface = np.stack([across, point[:, 2]], axis=1)
        side = wall[met] * 2 + (along[met, wall[met]] > 0)
        skirting, poster = _wall_pattern(surface) if room.shading is None else np.zeros((2, len(surface)), np.bool_)
        grey = np.where(skirting, 45.0, room.grey - 9.0 * side) + np.where(poster, -60.0, 0.0)
        if room.shading is not None:
            swing, wave = room.shading
            grey = room.grey + swing * np.sin((across / wave + 0.3 * side) * 2.0 * np.pi)
        grey += self._walls(surface + 10.0 * side[:, None], far[met] * RADIANS_PER_PIXEL)
        hits.label[met] = FIRST_WALL + side
        hits.part[met] = (FIRST_WALL + side) * 4 + 2 * skirting + poster
        hits.grey[met] = grey
        return np.where(met, far, reach)

    def _box_hits(self, eye: Array, ways: Array, reach: Array, item: tuple[int, Box], hits: _Hits) -> Array:
        index, box = item
        origin = np.append(_turned(eye[:2] - box.center, box.angle), eye[2] - box.height / 2)
        half = np.append(box.half, box.height / 2)
        aimed = _toward(ways, np.append(box.center, box.height / 2) - eye, float(np.linalg.norm(half)))
        ways = ways[aimed]
        along = np.column_stack([_turned(ways[:, :2], box.angle), ways[:, 2]])
        enter = (-np.sign(along) * half - origin) / along
        leave = (np.sign(along) * half - origin) / along
        near = np.maximum(np.maximum(*enter.T[:2]), enter.T[2])
        met = (near > 0) & (near <= np.minimum(np.minimum(*leave.T[:2]), leave.T[2])) & (near < reach[aimed])
        axis = np.argmax(enter[met], axis=1)
        point = origin + along[met] * near[met, None]
        face = np.where(axis == 2, 0, 1 + 2 * axis + (along[met, axis] > 0))
        others = np.array([[1, 2], [0, 2], [0, 1]])[axis]
        surface = np.take_along_axis(point, others, axis=1)
        sticker = np.all(np.abs(surface / half[others] - [0.2, 0.1]) < [0.45, 0.35], axis=1) & (box.label_contrast > 0)
        contrast = box.label_contrast * (1.0 if box.greys[0] < 128 else -1.0)
        grey = np.array(box.greys)[face] + contrast * sticker
        square = np.zeros(len(surface), dtype=np.bool_)
        if box.squares is not None:
            square = np.floor(surface / box.squares[0]).sum(axis=1) % 2 == 0
            grey[square] = box.squares[1]
        grey += self._faces(surface + 3.0 * (index + face)[:, None], near[met] * RADIANS_PER_PIXEL)
        rays = aimed[met]
        hits.label[rays] = FIRST_BOX + index
        hits.part[rays] = ((FIRST_BOX + index) * 8 + face) * 4 + 2 * square + sticker
        hits.grey[rays] = grey
        reach[rays] = near[met]
        return reach


def _toward(ways: Array, middle: Array, radius: float) -> NDArray[np.intp]:
    """Unit rays that may meet a sphere round a point, relative to the eye: those within the cone that touches it."""
    tangent = float(middle @ middle) - radius**2
    if tangent <= 0:
        return np.arange(len(ways))
    return np.flatnonzero(ways @ middle >= np.sqrt(tangent) * (1 - 1e-9))


def tilt_matrix(about_x: float, about_y: float) -> Array:
    """Rotation from a tilted camera's frame to the level one: about its x axis, then about its y axis."""
    c, s, d, t = np.cos(about_x), np.sin(about_x), np.cos(about_y), np.sin(about_y)
    turned: Array = np.array([[d, 0, t], [0, 1, 0], [-t, 0, d]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return turned


def _ground_octaves(texture_sigma: float | None) -> tuple[tuple[float, float], ...]:
    if texture_sigma is None:
        return GROUND_OCTAVES
    own = VALUE_NOISE_SIGMA * float(np.sqrt(sum(amplitude**2 for _, amplitude in FLOOR_OCTAVES)))
    return tuple((wave, amplitude * texture_sigma / own) for wave, amplitude in FLOOR_OCTAVES)


def _shaded(scene: World, points: Array) -> Mask:
    """Ground points from which a box hides the light: a step toward the light from them meets the box."""
    bearing, slope = scene.floor.light or (0.0, 1.0)
    shaded = np.zeros(len(points), dtype=np.bool_)
    for box in scene.boxes:
        origin = _turned(points - box.center, box.angle)
        along = _turned(np.array([np.cos(bearing), np.sin(bearing)]), box.angle)
        enter = ((-np.sign(along) * box.half - origin) / along).max(axis=1)
        leave = ((np.sign(along) * box.half - origin) / along).min(axis=1)
        shaded |= (leave > np.maximum(enter, 0.0)) & (np.maximum(enter, 0.0) * slope < box.height)
    return shaded


def _shining(streak: tuple[float, float, float, float, float], away: Array) -> Mask:
    """Ground points, relative to the camera, that lie in the strip."""
    along = _turned(away, streak[0])
    shining: Mask = (along[:, 0] > streak[1]) & (along[:, 0] < streak[2]) & (np.abs(along[:, 1]) < streak[3])
    return shining


def _wall_pattern(surface: Array) -> tuple[Mask, Mask]:
    """Where a wall has its dark skirting and its posters; surface (along, height), metres."""
    skirting = surface[:, 1] < 0.12
    poster = (np.abs(np.mod(surface[:, 0], 1.3) - 0.6) < 0.35) & (np.abs(surface[:, 1] - 0.75) < 0.3)
    return skirting, poster


def _turned(points: Array, angle: float) -> Array:
    """Points or directions, shape (..., 2), in axes turned by ``angle``."""
    c, s, x, y = np.cos(angle), np.sin(angle), points[..., 0], points[..., 1]
    return np.stack([c * x + s * y, c * y - s * x], axis=-1)


def _inside(mark: Mark, points: Array) -> Mask:
    """Points inside a convex outline of either orientation."""
    inside = np.ones(len(points), dtype=np.bool_)
    edges = np.roll(mark.outline, -1, axis=0) - mark.outline
    sign = np.sign(np.sum(mark.outline[:, 0] * edges[:, 1] - mark.outline[:, 1] * edges[:, 0]))
    for corner, edge in zip(mark.outline, edges, strict=True):
        side = edge[0] * (points[:, 1] - corner[1]) - edge[1] * (points[:, 0] - corner[0])
        inside &= sign * side >= 0
    return inside


def _truth(labels: SurfaceLabels, camera: Camera) -> Mask:
    """Ground and marks connected with the robot by pixel sides, found row by row from the robot's disc."""
    x = np.arange(camera.width) - camera.center[0]
    y = np.arange(camera.height) - camera.center[1]
    disc = x[None, :] ** 2 + y[:, None] ** 2 <= camera.robot_radius**2
    open_ground = ((labels >= GROUND) & (labels < FIRST_BOX)) | disc
    reached = disc
    while True:
        grown = _sweep(_sweep(reached, open_ground).T, open_ground.T).T
        if np.array_equal(grown, reached):
            return reached
        reached = grown


def _sweep(reached: Mask, free: Mask) -> Mask:
    """Grow along every row through free pixels: a run of free pixels is reached whole when one of it is."""
    run = np.cumsum(np.diff(free, axis=1, prepend=False), axis=1)
    index = run + (run.max() + 1) * np.arange(free.shape[0])[:, None]
    hit = np.zeros(int(index.max()) + 1, dtype=np.bool_)
    hit[index[reached]] = True
    grown: Mask = hit[index] & free
    return grown
