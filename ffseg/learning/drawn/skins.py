"""Colours of surfaces as functions of the place on them: plain, tiled, planked, painted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

AnyArray = NDArray[Any]
Skin = Callable[[AnyArray, AnyArray], AnyArray]
"""From (N, 2) metres on a face and (N,) heights above its foot to (N, 3) albedos, blue first, 0 to about 1."""


def noise(rng: np.random.Generator, side: int, waves: list[int], rough: float = 0.5) -> AnyArray:
    """A periodic picture of smooth noise with mean 0 and deviation 1; ``waves`` are its knots a side, octave by octave."""
    total, share = np.zeros((side, side), np.float32), 1.0
    for knots in waves:
        grid = np.pad(rng.standard_normal((knots, knots)).astype(np.float32), 2, mode="wrap")
        fine = cv2.resize(grid, None, fx=side / knots, fy=side / knots, interpolation=cv2.INTER_CUBIC)
        margin = int(2 * side / knots)
        total += share * fine[margin : margin + side, margin : margin + side]
        share *= rough
    return np.asarray((total - total.mean()) / (total.std() + 1e-6))


def look_up(texture: AnyArray, place: AnyArray, metres: float) -> AnyArray:
    """Values of a periodic texture of that size at (N, 2) places, bilinear."""
    side = texture.shape[0]
    at = np.mod(place / metres * side, side)
    near = at.astype(np.int32) % side
    part = (at - np.floor(at)).astype(np.float32)
    far = (near + 1) % side
    x, y = part[:, 0], part[:, 1]
    above = texture[near[:, 1], near[:, 0]] * (1 - x) + texture[near[:, 1], far[:, 0]] * x
    below = texture[far[:, 1], near[:, 0]] * (1 - x) + texture[far[:, 1], far[:, 0]] * x
    return np.asarray(above * (1 - y) + below * y)


def colour(rng: np.random.Generator, light: tuple[float, float] = (0.08, 0.8), saturation: float = 0.25) -> AnyArray:
    """An albedo, mostly grey or brown."""
    hue = rng.choice([rng.uniform(0, 360), rng.normal(32, 12), rng.normal(210, 20)], p=[0.35, 0.5, 0.15]) % 360
    hsv = np.array([[[hue, min(abs(rng.normal(0, saturation)), 1), rng.uniform(*light)]]], np.float32)
    return np.asarray(cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR)[0, 0])


def tinted(rng: np.random.Generator, base: AnyArray, gain: tuple[float, float], tint: float) -> AnyArray:
    """A colour near another: some gain, and a little of another hue."""
    return np.asarray(base * rng.uniform(*gain) * (1 + rng.normal(0, tint, 3)), np.float32)


def plain(rng: np.random.Generator, base: AnyArray | None = None, depth: float | None = None) -> Skin:
    """One colour under smooth noise of that depth."""
    tone = colour(rng) if base is None else base
    texture = noise(rng, 256, [int(rng.integers(2, 7)), 16, 64, 128], float(rng.uniform(0.4, 0.9)))
    contrast = abs(rng.normal(0, 0.05)) if depth is None else depth
    metres, tint = float(rng.uniform(0.5, 4)), 1 + rng.normal(0, 0.02, 3)
    return lambda at, _: tone * (1 + contrast * look_up(texture, at, metres)[:, None] * tint)


def tiled(rng: np.random.Generator, base: AnyArray | None = None) -> Skin:
    """Tiles, slabs or bricks with joints, each a little different; sometimes a chequerboard."""
    tone = colour(rng) if base is None else base
    size = rng.uniform(0.2, 1.2) * np.array([1, rng.choice([1, 1, 0.5, 0.25, 3])])
    joint = rng.uniform(0.004, 0.03)
    depth = float(rng.choice([rng.uniform(-0.5, -0.03), rng.uniform(0.03, 0.3)], p=[0.75, 0.25]))
    each = rng.normal(0, abs(rng.normal(0, 0.05)), (64, 64)).astype(np.float32)
    other = rng.uniform(-0.4, 0.4) if rng.random() < 0.15 else 0.0
    bond, grain, rough = rng.random() < 0.35, noise(rng, 256, [8, 32, 128], 0.8), abs(rng.normal(0, 0.05))
    turn = 0.0 if rng.random() < 0.6 else rng.uniform(0, np.pi)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])

    def skin(at: AnyArray, _: AnyArray) -> AnyArray:
        place = at @ axes / size
        if bond:
            place[:, 0] += 0.5 * (np.floor(place[:, 1]) % 2)
        cell = np.floor(place).astype(int)
        within = (place - cell) * size
        edge = np.minimum(within, size - within).min(axis=1)
        gain = 1 + each[cell[:, 1] % 64, cell[:, 0] % 64] + rough * look_up(grain, at, 2.0)
        gain = gain + other * (cell.sum(axis=1) % 2)
        return np.asarray(tone * (gain * (1 + depth * np.clip(1.5 - edge / joint, 0, 1)))[:, None])

    return skin


def planked(rng: np.random.Generator, base: AnyArray) -> Skin:
    """Boards side by side."""
    width, length = rng.uniform(0.07, 0.2), rng.uniform(0.8, 2)
    each = rng.normal(0, rng.uniform(0.02, 0.12), (64, 64)).astype(np.float32)
    grain, rough, along = noise(rng, 256, [16, 64, 128], 0.8), rng.uniform(0.01, 0.08), rng.random() < 0.5

    def skin(at: AnyArray, _: AnyArray) -> AnyArray:
        place = at if along else at[:, ::-1]
        row = np.floor(place[:, 1] / width).astype(int)
        board = np.floor(place[:, 0] / length + row * 0.37).astype(int)
        edge = np.minimum(np.mod(place[:, 1], width), width - np.mod(place[:, 1], width))
        fibre = look_up(grain, place * [0.2, 2], 1.0)
        gain = (1 + each[row % 64, board % 64] + rough * fibre) * (1 - 0.25 * np.clip(1.5 - edge / 0.003, 0, 1))
        return np.asarray(base * gain[:, None])

    return skin


def patched(rng: np.random.Generator, cell: tuple[float, float] | None = None) -> Skin:
    """Rectangles of many colours: shelves, facades, stacks of goods."""
    ground = colour(rng)
    across, up = (rng.uniform(0.04, 0.5), rng.uniform(0.15, 0.6)) if cell is None else cell
    colours = np.stack([colour(rng, (0.05, 0.95), 0.5) for _ in range(256)]).reshape(16, 16, 3)
    filled, rim = rng.random((16, 16)) < rng.uniform(0.2, 1), rng.uniform(0.02, 0.2)

    def skin(at: AnyArray, _: AnyArray) -> AnyArray:
        place = at / [across, up]
        whole = np.floor(place).astype(int)
        within = ((place - whole > rim) & (place - whole < 1 - rim)).all(axis=1)
        row, column = whole[:, 1] % 16, whole[:, 0] % 16
        return np.where((within & filled[row, column])[:, None], colours[row, column], ground)

    return skin


def leaves(rng: np.random.Generator) -> Skin:
    """Hedges, grass, crowns of trees."""
    base = colour(rng, (0.1, 0.5), 0.3) * np.array([0.6, 1.0, 0.7])
    texture, metres = noise(rng, 256, [8, 32, 64, 128], 0.9), float(rng.uniform(1, 4))
    return lambda at, _: base * np.clip(1 + 0.5 * look_up(texture, at, metres), 0.05, 3)[:, None]


def marked(rng: np.random.Generator, under: Skin) -> Skin:
    """Lines, discs, rugs and stains on what lies under them: they belong to the ground."""
    count = int(rng.integers(1, 8))
    kinds = rng.choice(["line", "disc", "rug", "stain"], count, p=[0.5, 0.15, 0.15, 0.2])
    centres = rng.uniform(-4, 4, (count, 2)) + [3, 0]
    turns = [rng.choice([0, np.pi / 2, rng.uniform(0, np.pi)]) for _ in range(count)]
    sizes = rng.uniform([0.03, 0.5, 0.4], [0.12, 6, 1], (count, 3))
    tones = [colour(rng, (0.5, 1), 0.5) if kind in ("line", "disc") else colour(rng) for kind in kinds]
    texture = noise(rng, 128, [8, 16, 32], 0.6)

    def skin(at: AnyArray, height: AnyArray) -> AnyArray:
        found = under(at, height)
        for kind, centre, turn, (width, length, cover), tone in zip(kinds, centres, turns, sizes, tones, strict=True):
            if kind == "stain":
                found = found * (1 - np.clip(look_up(texture, at, 3.0) - 0.6, 0, 1) * 0.4 * cover)[:, None]
                continue
            along = (at - centre) @ [np.cos(turn), np.sin(turn)]
            across = (at - centre) @ [-np.sin(turn), np.cos(turn)]
            hit = {
                "line": (abs(across) < width) & (abs(along) < length),
                "disc": np.hypot(along, across) < 3 * width,
                "rug": (abs(along) < 0.2 * length) & (abs(across) < 0.12 * length),
            }[kind]
            found = np.where(hit[:, None], found * (1 - cover) + tone * cover, found)
        return found

    return skin


def skirted(rng: np.random.Generator, wall: Skin, ground: AnyArray) -> Skin:
    """A wall with a skirting board, sometimes a rail and another colour below it."""
    board = rng.uniform(0.04, 0.15)
    board_tone = colour(rng) if rng.random() < 0.6 else ground * rng.uniform(0.5, 1.2)
    rail, rail_width, rail_tone = rng.uniform(0.7, 1.2), rng.uniform(0.03, 0.2), colour(rng, (0.1, 0.9), 0.6)
    has_rail, has_dado, dado = rng.random() < 0.25, rng.random() < 0.2, colour(rng)

    def skin(at: AnyArray, height: AnyArray) -> AnyArray:
        found = wall(at, height)
        if has_dado:
            found = np.where((height < rail)[:, None], dado, found)
        if has_rail:
            found = np.where((abs(height - rail) < rail_width)[:, None], rail_tone, found)
        return np.where((height < board)[:, None], board_tone, found)

    return skin


def flooring(rng: np.random.Generator) -> tuple[Skin, AnyArray]:
    """A floor, and its colour."""
    base = colour(rng, (0.12, 0.8))
    kind = rng.choice(["plain", "tiled", "planked"], p=[0.5, 0.35, 0.15])
    skin = {"plain": plain, "tiled": tiled, "planked": planked}[kind](rng, base)
    return (marked(rng, skin) if rng.random() < 0.4 else skin), base


def furniture(rng: np.random.Generator, ground: AnyArray) -> Skin:
    """The surface of some thing that stands on a floor; one in five nearly has the floor's colour."""
    kind = rng.choice(["alike", "plain", "patched", "tiled"], p=[0.2, 0.45, 0.25, 0.1])
    if kind == "alike":
        return plain(rng, tinted(rng, ground, (0.6, 1.4), 0.05))
    if kind == "plain":
        return plain(rng, colour(rng, (0.03, 0.95), 0.5))
    return patched(rng) if kind == "patched" else tiled(rng)
