"""Drawings of planes seen through a microscope, from above, or cut open: tissue, fields, organs, nuclei, colonies, drops."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ffseg.learning.drawn.cameras import MAX_SIDE, developed
from ffseg.learning.drawn.figures import TEXTURE, Canvas, pelt
from ffseg.learning.drawn.skins import AnyArray, colour, noise, tinted

Generator = np.random.Generator


@dataclass(frozen=True, slots=True)
class Tiling:
    """How a plane is parted: each range is drawn from, lengths in pixels.

    Attributes
    ----------
    cells, width : tuple of float
        How many parts; how wide the borders between them.
    bent : tuple of float
        How far places are moved by smooth noise.
    own : tuple of float
        Deviation of the parts' tones, in parts of the mean.
    grain, light : tuple of float
        Deviation of the fine texture, and of the light over the whole, in parts of the mean.
    blur : tuple of float
        Of the borders.
    grey, vessels, round, textured : float
        How often: without colour; with thin lines across; within a circle; each part with a texture of its own.
    """

    cells: tuple[int, int]
    width: tuple[float, float]
    bent: tuple[float, float]
    own: tuple[float, float]
    grain: tuple[float, float]
    light: tuple[float, float]
    blur: tuple[float, float]
    grey: float = 0.0
    vessels: float = 0.0
    round: float = 0.0
    textured: float = 0.0


TISSUE = Tiling((8, 70), (2, 5), (2, 25), (0, 0.12), (0.02, 0.2), (0, 0.2), (0.5, 1.2), grey=0.7, vessels=0.6)
FIELDS = Tiling((4, 25), (0, 6), (0, 8), (0.05, 0.35), (0, 0.1), (0, 0.15), (0.5, 1.0), textured=0.7)
ORGANS = Tiling(
    (3, 12), (0, 3), (10, 45), (0.1, 0.5), (0.02, 0.35), (0.1, 0.5), (0.8, 4.0), grey=0.75, vessels=0.4, round=0.4
)


def canvas(rng: Generator, shapes: tuple[float, ...] = (0.667, 0.75, 1.0, 1.5)) -> Canvas:
    """An empty canvas of some size."""
    width = int(rng.integers(200, MAX_SIDE))
    height = int(width * rng.choice(shapes))
    return Canvas(MAX_SIDE, int(width * MAX_SIDE / height)) if height > MAX_SIDE else Canvas(height, width)


def parted(rng: Generator, kind: Tiling) -> tuple[AnyArray, AnyArray]:
    """A plane in parts: the picture, (H, W, 3) bytes, and the number of each part from 1, 0 on borders and outside."""
    on = canvas(rng)
    height, width = on.shape
    labels, depth = _tiles(rng, on, int(rng.integers(*kind.cells)), rng.uniform(*kind.bent))
    border = rng.uniform(*kind.width)
    tones = _tones(rng, labels, kind)
    lines = rng.choice([rng.uniform(0.05, 0.6), rng.uniform(1.2, 2.2)], p=[0.8, 0.2]) * tones.mean((0, 1))
    faint = 1 - rng.uniform(0, 0.6) * np.clip(_noise(rng, on, [4, 8, 16]), 0, 1)
    cover = np.clip(0.5 + border / 2 - depth, 0, 1) * faint if border else np.zeros(on.shape)
    found = tones * (1 - cover[..., None]) + cover[..., None] * lines
    if rng.random() < kind.vessels:  # thin lines of one height of a hilly plane belong to the part they lie in
        hills = _noise(rng, on, [int(rng.integers(3, 14)), 24])
        line = np.clip(rng.uniform(0.02, 0.12) / (abs(hills - rng.normal()) + 0.02) - 0.5, 0, 1)
        found = found * (1 - rng.uniform(-0.4, 0.7) * line)[..., None]
    found = cv2.GaussianBlur(found.astype(np.float32), (0, 0), float(rng.uniform(*kind.blur)))
    found *= (1 + rng.uniform(*kind.grain) * _noise(rng, on, [64, 128, 256], 0.95))[..., None]
    found *= np.exp(rng.uniform(*kind.light) * _noise(rng, on, [2, 4]))[..., None]
    labels = np.where(depth > border / 2, labels + 1, 0)
    if rng.random() < kind.round:
        axes = rng.uniform(0.4, 0.55, 2) * [width, height]
        outside = on.ellipse(np.array([width, height]) / 2, (axes[0], axes[1])) > 0
        found[outside], labels[outside] = rng.uniform(0, 0.08), 0
    return lit(rng, found), labels


def _tiles(rng: Generator, on: Canvas, count: int, bent: float) -> tuple[AnyArray, AnyArray]:
    """The nearest of some centres to each place, and about how far the border to the next one is."""
    moved = on.at + bent * np.stack([_noise(rng, on, [3, 6, 12]), _noise(rng, on, [3, 6, 12])], -1)
    stretch = np.array([1, rng.uniform(0.5, 1)])
    centres = rng.uniform([0, 0], [on.shape[1], on.shape[0]], (count, 2))
    near, next_near, labels = (np.full(on.shape, np.inf), np.full(on.shape, np.inf), np.zeros(on.shape, np.int32))
    for number, centre in enumerate(centres):
        away = np.linalg.norm((moved - centre) * stretch, axis=2)
        nearer = away < near
        next_near = np.where(nearer, near, np.minimum(next_near, away))
        near = np.where(nearer, away, near)
        labels[nearer] = number
    return labels, (next_near - near) / 2


def _tones(rng: Generator, labels: AnyArray, kind: Tiling) -> AnyArray:
    """Colours of the parts, before borders and light."""
    count = int(labels.max()) + 1
    base = colour(rng, (0.25, 0.85), 0.3)
    spread = rng.uniform(*kind.own)
    own = base * np.exp(rng.normal(0, spread, (count, 1))) * (1 + rng.normal(0, spread / 3, (count, 3)))
    if rng.random() < kind.grey:
        own = np.repeat(own.mean(axis=1, keepdims=True), 3, axis=1)
    found = own[labels].astype(np.float32)
    if rng.random() < kind.textured:
        for number in range(count):
            at = labels == number
            if at.any():
                found[at] = pelt(rng, own[number], labels.shape)[at] if rng.random() < 0.5 else found[at]
    return found


@dataclass(frozen=True, slots=True)
class Specks:
    """Round things on a plane: how many and their radii in pixels; how often near another, dark, rimmed, shining."""

    count: tuple[int, int]
    radii: tuple[float, float]
    clumped: float
    dark: float
    rim: float
    shine: float


NUCLEI = Specks((4, 60), (6, 45), 0.6, 0.5, 0.5, 0.0)
COLONIES = Specks((3, 40), (5, 60), 0.3, 0.4, 0.6, 0.7)

MERGED = 0.15
"""Rims fainter than this part of the tone do not part things that touch."""


def specks(rng: Generator, kind: Specks) -> tuple[AnyArray, AnyArray]:
    """Round things on a plane, and the number of each from 1; those that touch without a rim are one."""
    on = canvas(rng)
    ground = colour(rng, (0.01, 0.9), 0.35)
    if rng.random() < 0.4:
        ground[:] = ground.mean()
    found = ground * (1 + rng.uniform(0, 0.2) * _noise(rng, on, [8, 32, 64]))[..., None]
    rim = rng.uniform(-0.5, 0.3) if rng.random() < kind.rim else 0.0
    shine, soft = rng.random() < kind.shine, rng.uniform(0.8, 3)
    lightness, vary = _lightness(rng, kind, ground), rng.uniform(0, 0.25)
    base = lightness * (1 + rng.uniform(0, 0.25) * _noise(rng, on, [int(rng.integers(8, 40)), 64, 128], 0.8))[..., None]
    ragged: AnyArray = 0.12 * _noise(rng, on, [12, 24])
    labels: AnyArray = np.zeros(on.shape, np.int32)
    for number, (middle, radius) in enumerate(_places(rng, on, kind), 1):
        at, near = on.near(middle, 1.6 * radius + 4)
        away = (
            near.ellipse(middle, (radius, radius * rng.uniform(0.55, 1)), rng.uniform(0, np.pi)) + radius * ragged[at]
        )
        cover = np.clip(0.5 - away / soft, 0, 1)[..., None]
        body = (
            base[at]
            * np.exp(rng.normal(0, vary))
            * (1 + rim * np.exp(-((away / max(2.0, 0.1 * radius)) ** 2)))[..., None]
        )
        if shine:
            spot = near.ellipse(middle - 0.35 * radius, (0.25 * radius, 0.15 * radius), 0.8)
            body = body * (1 + 0.3 * (near.at[..., 1] - middle[1]) / radius)[..., None]
            body = body + np.clip(0.5 - spot, 0, 1)[..., None]
        found[at] = found[at] * (1 - cover) + cover * body
        labels[at][away < 0] = number
    if abs(rim) < MERGED:
        labels = cv2.connectedComponents((labels > 0).astype(np.uint8), connectivity=4)[1]
    return lit(rng, found * np.exp(rng.uniform(0, 0.3) * _noise(rng, on, [2, 4]))[..., None]), labels


def _lightness(rng: Generator, kind: Specks, ground: AnyArray) -> AnyArray:
    if rng.random() < kind.dark and ground.mean() > 0.25:
        return tinted(rng, ground, (0.2, 0.75), 0.15)
    return np.clip(tinted(rng, ground, (1.3, 4), 0.2) + 0.05, 0, 1.2)


def _places(rng: Generator, on: Canvas, kind: Specks) -> list[tuple[AnyArray, float]]:
    size = on.shape[::-1]
    scale, spread = rng.uniform(*kind.radii), rng.uniform(0.05, 0.5)
    middles = [rng.uniform([0, 0], size)]
    for _ in range(int(rng.integers(*kind.count)) - 1):
        about = middles[int(rng.integers(len(middles)))] + rng.normal(0, 1.3 * scale, 2)
        middles.append(np.clip(about, 0, size) if rng.random() < kind.clumped else rng.uniform([0, 0], size))
    return [(middle, float(scale * np.exp(rng.normal(0, spread)))) for middle in middles]


def lit(rng: Generator, light: AnyArray) -> AnyArray:
    """The picture that a camera takes of it, not always as bright."""
    light = np.clip(light, 0, None)
    return developed(light / (light.mean() + 1e-3) * rng.uniform(0.1, 0.5), rng)


def _noise(rng: Generator, on: Canvas, waves: list[int], rough: float = 0.6) -> AnyArray:
    return noise(rng, TEXTURE, waves, rough)[: on.shape[0], : on.shape[1]]
