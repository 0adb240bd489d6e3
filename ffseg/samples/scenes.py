"""The sample scenes: the binary toy of the paper's first figure, a simple and a complex ground seen from above.

Each leaves a disc of radius 70 px round the image centre free, where the default start circle lies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ffseg.arrays import Array, Image, Mask
from ffseg.samples import texture
from ffseg.samples.paint import SampleGrid, centers, coverage

WIDTH, HEIGHT = 800, 600
SHAPE = (HEIGHT, WIDTH)
GRAIN = 3.0
"""Grey levels, standard deviation of the noise of a good camera."""


@dataclass(frozen=True, slots=True, eq=False)
class SampleImage:
    """A drawn image and its free region.

    Attributes
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey, or red, green, blue.
    truth : ndarray of uint8, shape (H, W)
        255 where the pixel centre is free.
    """

    image: Image
    truth: Image


def toy() -> SampleImage:
    """Draw a white shape on black with deep concavities and four holes."""
    paper = SampleGrid(WIDTH, HEIGHT)
    body = paper.blob(
        [(60, 330), (40, 120), (180, 20), (330, 90), (430, 10), (600, 40), (700, 60), (780, 200), (700, 330)]
        + [(770, 470), (680, 590), (520, 560), (400, 590), (250, 580), (110, 560), (70, 450)]
    )
    bays = (
        paper.stroke([(428, -10), (420, 110), (474, 170)], 34)
        | paper.stroke([(30, 250), (150, 235), (240, 290)], 30)
        | paper.stroke([(790, 330), (640, 340), (560, 280)], 26)
        | paper.stroke([(330, 610), (310, 490), (240, 420)], 32)
        | paper.polygon([(560, 610), (600, 450), (640, 610)])
    )
    holes = (
        paper.disc((230, 150), 42)
        | paper.ellipse((600, 160), (58, 30))
        | paper.polygon([(440, 420), (520, 440), (505, 510), (430, 490)])
        | paper.disc((160, 490), 24)
    )
    truth = centers(body & ~bays & ~holes)
    return SampleImage(truth.copy(), truth)


def simple() -> SampleImage:
    """Draw a bright sandy place with one boulder, ringed by dark ground; grey."""
    paper = SampleGrid(WIDTH, HEIGHT)
    sand = paper.blob(
        [(120, 300), (90, 120), (260, 60), (420, 110), (610, 40), (730, 190), (690, 330), (740, 480), (560, 560)]
        + [(400, 500), (230, 570), (70, 470)]
    )
    boulder = paper.blob([(550, 200), (610, 190), (640, 240), (610, 290), (560, 280), (530, 240)])
    ground = 78 + texture.mottling(SHAPE, 60, 12, 1) + texture.mottling(SHAPE, 11, 6, 2)
    light = 165 + texture.mottling(SHAPE, 90, 5, 3) + texture.shading(SHAPE, 14, 8)
    stone = 96 + texture.mottling(SHAPE, 24, 9, 4)
    picture = _laid(ground, [(sand, light), (boulder, stone)])
    return SampleImage(
        texture.to_bytes(texture.softened(picture) + texture.grain(SHAPE, GRAIN, 5)), centers(sand & ~boulder)
    )


def complex_scene() -> SampleImage:
    """Draw a paved yard between lawn and walls, with beds, stones, posts, a hose and painted kerbs; colour.

    What lies inside the ring is not free: no way leads there.
    """
    paper = SampleGrid(WIDTH, HEIGHT)
    yard, wall, kerb = _yard(paper)
    beds, stones, posts, hose = _things(paper)
    ring, inside_ring = paper.ring((390, 450), 26, 6), paper.disc((390, 450), 26)
    mottled = texture.mottling(SHAPE, 48, 5, 11) + texture.shading(SHAPE, -16, 10)
    lawn = texture.mottling(SHAPE, 9, 14, 12) + texture.mottling(SHAPE, 50, 10, 13)
    layers: list[tuple[Mask, Array]] = [
        (wall, _tinted((92, 84, 82), texture.mottling(SHAPE, 30, 8, 14))),
        (yard, _tinted((186, 174, 156), mottled)),
        (kerb, _tinted((236, 234, 228), mottled / 2)),
        (beds, _tinted((112, 66, 48), texture.mottling(SHAPE, 14, 16, 15))),
        (stones, _tinted((96, 100, 108), texture.mottling(SHAPE, 20, 14, 16))),
        (posts | ring, _tinted((40, 42, 48), mottled / 3)),
        (hose, _tinted((30, 110, 70), mottled / 3)),
    ]
    picture = texture.softened(_laid(_tinted((74, 118, 58), lawn), layers))
    noise = np.stack([texture.grain(SHAPE, GRAIN, 20 + 4 * channel) for channel in range(3)], axis=2)
    return SampleImage(
        texture.to_bytes(picture + noise), centers(yard & ~(kerb | beds | stones | posts | hose | ring | inside_ring))
    )


SCENES: dict[str, Callable[[], SampleImage]] = {"toy": toy, "simple": simple, "complex": complex_scene}


def _yard(paper: SampleGrid) -> tuple[Mask, Mask, Mask]:
    """The paved yard with its bays, the walls behind it, and the kerb drawn along part of its edge."""
    yard = paper.blob(
        [(110, 150), (210, 60), (360, 90), (470, 30), (640, 70), (700, 180), (760, 250), (680, 360), (720, 500)]
        + [(590, 560), (470, 520), (330, 570), (200, 540), (60, 480), (130, 340)]
    )
    alley = paper.polygon([(600, 330), (790, 352), (788, 384), (600, 372)])
    wall = paper.polygon([(0, 0), (300, 0), (180, 60), (70, 190), (100, 330), (0, 420)])
    wall |= paper.polygon([(800, 180), (740, 300), (690, 420), (760, 600), (800, 600)])
    spurs = paper.stroke([(470, 20), (462, 120)], 5) | paper.stroke([(60, 470), (190, 440)], 5)
    spurs |= paper.stroke([(620, 570), (590, 470), (545, 455)], 5)
    return yard | alley, wall, spurs


def _things(paper: SampleGrid) -> tuple[Mask, Mask, Mask, Mask]:
    """Beds, stones, posts and a hose: islands, some of them thin."""
    beds = paper.ellipse((240, 190), (52, 30)) | paper.polygon([(520, 420), (560, 370), (600, 400), (560, 450)])
    stones = paper.blob([(590, 170), (640, 160), (665, 200), (640, 240), (600, 230), (575, 200)])
    stones |= paper.blob([(250, 430), (290, 420), (310, 450), (290, 480), (255, 475), (235, 455)])
    posts = paper.disc((420, 150), 8) | paper.disc((510, 250), 7) | paper.disc((180, 350), 9)
    hose = paper.stroke([(300, 250), (270, 300), (290, 345), (260, 380)], 6)
    return beds, stones, posts, hose


def _laid(base: Array, layers: list[tuple[Mask, Array]]) -> Array:
    """Lay surfaces over one another, each where its stencil covers the pixel."""
    for stencil, surface in layers:
        share = coverage(stencil)
        share = share[:, :, None] if base.ndim == 3 else share
        base = base * (1 - share) + surface * share
    return base


def _tinted(color: tuple[int, int, int], variation: Array) -> Array:
    """Lay a brightness variation over a colour, shape (H, W, 3)."""
    return np.asarray(np.array(color, dtype=np.float64) + variation[:, :, None])
