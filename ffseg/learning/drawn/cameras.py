"""Cameras that see a scene: perspective ones at a robot's or a car's height, mirrors and fisheyes looking down."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ffseg.learning.drawn.rays import GROUND, World, shaded
from ffseg.learning.drawn.skins import AnyArray, colour

Generator = np.random.Generator

MAX_SIDE = 380
"""Pixels a side: about what the features are made at."""

CLEAR_OF_CAMERA = 0.25
"""Metres round the camera that no box reaches."""


@dataclass(frozen=True, slots=True, eq=False)
class Viewpoint:
    """Where it stands, its (H, W, 3) rays, and, under a mirror, the distance of each pixel from its middle in radii."""

    origin: AnyArray
    rays: AnyArray
    radii: AnyArray | None = None


def perspective(rng: Generator, *, road: bool) -> Viewpoint:
    """At 0.1 to 1.7 m on a robot, at 0.9 to 1.8 m in a car."""
    width = int(rng.integers(220, 400))
    shape = rng.choice([0.75, 0.5625, 0.6, 1.6], p=[0.6, 0.3, 0.1, 0] if road else [0.35, 0.35, 0.2, 0.1])
    height = int(width * shape)
    if height > MAX_SIDE:
        width, height = int(width * MAX_SIDE / height), MAX_SIDE
    focal = width * rng.uniform(0.5, 1.2) if width >= height else height * rng.uniform(0.5, 1)
    pitch, yaw = (rng.uniform(-0.03, 0.2), rng.normal(0, 0.1)) if road else (rng.uniform(0, 0.6), rng.normal(0, 0.3))
    roll = rng.normal(0, 0.02)
    up = rng.uniform(0.9, 1.8) if road else rng.choice([rng.uniform(0.12, 0.5), rng.uniform(0.5, 1.7)])
    y, x = np.mgrid[:height, :width]
    rays = np.stack([np.ones(y.shape), (width / 2 - x) / focal, (height / 2 - y) / focal], -1)
    rays = rays @ rotation(roll, 1, 2).T @ rotation(-pitch, 0, 2).T @ rotation(yaw, 0, 1).T
    return Viewpoint(np.array([0, 0, up]), rays / np.linalg.norm(rays, axis=2)[..., None])


def rotation(angle: float, one: int, other: int) -> AnyArray:
    """Rotation in the plane of two axes."""
    found = np.eye(3)
    found[[one, other], [one, other]] = np.cos(angle)
    found[one, other], found[other, one] = -np.sin(angle), np.sin(angle)
    return found


def mirror(rng: Generator) -> Viewpoint:
    """Under a mirror (unified sphere model) or a fisheye (angle in proportion to the radius), looking down."""
    height = int(rng.integers(260, 420))
    width = int(height * rng.choice([1, 4 / 3]))
    rim, widest, xi = height * rng.uniform(0.36, 0.6), rng.uniform(1.2, 1.9), rng.uniform(0.6, 1.1)
    middle = np.array([width, height]) / 2 + rng.normal(0, height * 0.02, 2)
    y, x = np.mgrid[:height, :width]
    right, down = (x - middle[0]) / rim, (y - middle[1]) / rim
    radii = np.hypot(right, down)
    if rng.random() < 0.6:
        m = radii * np.sin(widest) / (np.cos(widest) + xi)
        lift = (xi + np.sqrt(np.maximum(1 + (1 - xi * xi) * m * m, 0))) / (1 + m * m)
        angle = np.arctan2(lift * m, lift - xi)
    else:
        angle = radii * widest
    turn = np.arctan2(down, right)
    rays = np.stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), -np.cos(angle)], -1)
    return Viewpoint(np.array([0, 0, rng.uniform(0.5, 1.8)]), rays, radii)


def photographed(scene: World, camera: Viewpoint, rng: Generator, *, road: bool) -> tuple[AnyArray, AnyArray]:
    """The picture, (H, W, 3) bytes, and which pixels show the ground."""
    shape = camera.rays.shape[:2]
    found, hits = shaded(scene, camera.origin, camera.rays.reshape(-1, 3), rng)
    light, ground = np.maximum(found, 0).reshape(*shape, 3), (hits.index == GROUND).reshape(shape)
    if camera.radii is not None:
        housing(light, ground, camera.radii, rng)
        lit = camera.radii <= 1
    else:
        lit = np.ones(shape, np.bool_)
        _vignette(light, rng)
        if road and rng.random() < 0.5:
            bonnet(light, ground, rng)
    light = light * (1 + rng.normal(0, 0.06, 3)) / (np.median(light[lit]) + 1e-3) * _exposure(rng, 0.08, 0.8)
    if road and ground.any() and rng.random() < 0.5:
        light = light * _exposure(rng, 0.005, 0.12) / (np.median(light[ground]) + 1e-3)
    return developed(light, rng, hazy=True), ground


def _exposure(rng: Generator, least: float, most: float) -> float:
    """A level between two, as even in its logarithm."""
    return float(np.exp(rng.uniform(np.log(least), np.log(most))))


def _vignette(light: AnyArray, rng: Generator) -> None:
    height, width = light.shape[:2]
    y, x = np.mgrid[:height, :width]
    away = np.hypot(y - height / 2, x - width / 2) / np.hypot(height / 2, width / 2)
    light *= (1 - rng.uniform(0, 0.35) * away**2)[..., None]


def housing(light: AnyArray, ground: AnyArray, radii: AnyArray, rng: Generator) -> None:
    """The dark round a mirror, the camera's own image in its middle, sometimes a rod across."""
    light *= (1 - rng.uniform(0, 0.5) * np.clip(radii, 0, 1) ** 2)[..., None]
    height, width = radii.shape
    own = rng.uniform(0.05, 0.22) if rng.random() < 0.8 else rng.uniform(0.2, 0.38)
    hidden = [(radii > 1, 0.06), (radii < own, 0.3)]
    if rng.random() < 0.4:  # the mirror's own rim
        hidden.append(((radii < 1) & (radii > 1 - rng.uniform(0.02, 0.12)), 0.15))
    y, x = np.mgrid[:height, :width]
    for _ in range(int(rng.choice([0, 1, 3], p=[0.5, 0.35, 0.15]))):  # rods of its mount
        turn = rng.uniform(0, 2 * np.pi)
        along = (x - width / 2) * np.cos(turn) + (y - height / 2) * np.sin(turn)
        across = abs((x - width / 2) * np.sin(turn) - (y - height / 2) * np.cos(turn))
        hidden.append(((across < rng.uniform(2, 7)) & (along > 0) & (radii < 1), 0.25))
    for region, brightest in hidden:
        light[region] = rng.uniform(0, brightest)
        ground &= ~region


def bonnet(light: AnyArray, ground: AnyArray, rng: Generator) -> None:
    """The car's own bonnet at the lower border."""
    height, width = ground.shape
    y, x = np.mgrid[:height, :width]
    own = y > height * (rng.uniform(0.88, 0.97) + 0.04 * (2 * x / width - 1) ** 2)
    light[own] = colour(rng, (0.03, 0.6), 0.4) * rng.uniform(0.5, 1.2)
    ground &= ~own


def developed(light: AnyArray, rng: Generator, *, hazy: bool = False, noise: Generator | None = None) -> AnyArray:
    """What a camera makes of that light: blur, noise (of its own, if given), a tone curve, haze, compression; bytes.

    The noise is that of photons, whose deviation goes with the root of the signal, and of reading it out.
    """
    found = _blurred(light.astype(np.float32), rng)
    photons, read = np.exp(rng.uniform(np.log(3e2), np.log(1e5))), rng.uniform(0.0005, 0.006)
    grain = (noise or rng).standard_normal(found.shape).astype(np.float32)
    found = found + grain * np.sqrt(np.clip(found, 0, None) / photons + read**2)
    found = np.clip(1 - np.exp(-1.6 * found) if rng.random() < 0.5 else found, 0, 1)
    found = found ** (1 / rng.uniform(1.0 if rng.random() < 0.2 else 1.3, 2.4))
    if rng.random() < 0.3:  # steeper in the middle
        found = found + rng.uniform(0, 0.6) * (found * found * (3 - 2 * found) - found)
    if hazy and rng.random() < 0.2:
        veil = rng.uniform(0.05, 0.6)
        found = veil + (1 - veil) * found
    levels: AnyArray = np.clip(found * 255, 0, 255).astype(np.uint8)
    if rng.random() < 0.1:
        levels = np.repeat(cv2.cvtColor(levels, cv2.COLOR_BGR2GRAY)[..., None], 3, axis=2)
    if rng.random() < 0.75:
        how = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(30, 96)), cv2.IMWRITE_JPEG_SAMPLING_FACTOR, _sampling(rng)]
        levels = np.asarray(cv2.imdecode(cv2.imencode(".jpg", levels, how)[1], cv2.IMREAD_COLOR), np.uint8)
    return levels


def _sampling(rng: Generator) -> int:
    """How many pixels share a colour in a JPEG file: one, two or four."""
    return int(rng.choice([getattr(cv2, f"IMWRITE_JPEG_SAMPLING_FACTOR_{name}") for name in ("444", "422", "420")]))


def _blurred(light: AnyArray, rng: Generator) -> AnyArray:
    """Out of focus a little, sometimes more, sometimes moved."""
    sigma = rng.uniform(0.5, 1.1) if rng.random() < 0.8 else rng.uniform(1.0, 2.2)
    found = cv2.GaussianBlur(light, (0, 0), float(sigma))
    if rng.random() < 0.12:
        reach, turn = int(rng.integers(1, 5)), rng.uniform(0, np.pi)
        steps = np.rint(np.arange(-reach, reach + 1)[:, None] * [np.sin(turn), np.cos(turn)]).astype(int)
        way = np.zeros((2 * reach + 1, 2 * reach + 1), np.float32)
        way[steps[:, 0] + reach, steps[:, 1] + reach] = 1
        found = cv2.filter2D(found, -1, way / way.sum())
    return np.asarray(found)
