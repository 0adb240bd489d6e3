"""Cameras that see themselves, drawn: how well ``ffseg domain`` finds it; run ``python -m tests.campaigns.own_images``.

A robot's or a car's camera moves through a street or a room, a mirror or fisheye through a room: with a bonnet at the lower
border, or a dark surround, a mount in the middle and perhaps a rod across; and without. The light changes by a third from image
to image. Says for each kind how many of the cameras' own images were found (IoU of 0.8 or more) and what share of the scene was
taken for one, at most and in the mean. Exit code 1 if that is more than 2 % where the camera has moved well and turned.
"""

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import product
from statistics import mean

import numpy as np

from ffseg.arrays import Array, Image, Mask
from ffseg.errors import SegmentationError
from ffseg.image.own import own_image
from ffseg.io.images import prepare_worker
from ffseg.learning.drawn.cameras import Viewpoint, bonnet, developed, housing, mirror, perspective, rotation
from ffseg.learning.drawn.rays import World, shaded
from ffseg.learning.drawn.rooms import room
from ffseg.learning.drawn.sights import clear_of, seen_from_the_middle
from ffseg.learning.drawn.streets import street
from ffseg.metrics import INSIDE, iou
from tests.campaigns import harness

KINDS = ("street", "room", "mirror")
FOUND, MOST_LOST = 0.8, 0.02


@dataclass(frozen=True, slots=True)
class Drive:
    """A camera's way: metres and radians (of a mirror six times as many) between images, and how many there are."""

    step: float
    turn: float
    images: int


DRIVES = (Drive(0.6, 0.15, 12), Drive(0.3, 0.0, 12), Drive(0.6, 0.15, 6), Drive(0.05, 0.01, 12))
WELL = (DRIVES[0], DRIVES[2])
"""Those on which the camera has moved well, and turned."""


@dataclass(frozen=True, slots=True)
class Case:
    kind: str
    seed: int
    drive: Drive


@dataclass(frozen=True, slots=True)
class Place:
    """A camera at one place, the light that reaches it from the scene, (H, W, 3), and what is left to chance there."""

    camera: Viewpoint
    light: Array
    jolt: np.random.Generator


def frames(case: Case) -> Iterator[tuple[list[Image], Mask]]:
    """The images of a case and the camera's own image, (H, W) bool: of a camera that sees itself, and of one that does not."""
    rng = np.random.default_rng([KINDS.index(case.kind), case.seed])
    scene = street(rng) if case.kind == "street" else room(rng)
    camera = mirror(rng) if case.kind == "mirror" else perspective(rng, road=True)
    if case.kind != "street":
        scene = seen_from_the_middle(scene, rng)
    exposure = float(rng.uniform(0.1, 0.45))
    seen = [Place(at, _light(scene, at, case), jolt) for at, jolt in _way(camera, case)]
    yield _exposed(seen, exposure, case, sees_itself=True)
    yield _exposed(seen, exposure, case, sees_itself=False)


def _exposed(seen: list[Place], exposure: float, case: Case, *, sees_itself: bool) -> tuple[list[Image], Mask]:
    found, own, level = list[Image](), np.zeros((0, 0), np.bool_), 0.0
    for place in seen:
        light, jolt = place.light.copy(), deepcopy(place.jolt)
        own = _own(light, place.camera, case) if sees_itself else np.zeros(light.shape[:2], np.bool_)
        level = level or float(np.median(light)) + 1e-3
        light *= exposure * jolt.uniform(0.75, 1.3) / level
        found.append(developed(light, np.random.default_rng([case.seed, 1]), noise=jolt))
    return found, own


def _way(camera: Viewpoint, case: Case) -> Iterator[tuple[Viewpoint, np.random.Generator]]:
    """The camera at each of its places, and what is left to chance there."""
    place = np.zeros(3)
    for number in range(case.drive.images):
        rng = np.random.default_rng([case.seed, 2, number])
        spin = case.drive.turn * (6 if case.kind == "mirror" else 1) * rng.normal()
        if case.kind != "street":
            place = np.array([*rng.normal(0, case.drive.step, 2), 0])
        yield replace(camera, origin=camera.origin + place, rays=camera.rays @ rotation(spin, 0, 1).T), rng
        place = place + [case.drive.step * rng.uniform(0.7, 1.3), rng.normal(0, case.drive.step / 4), 0]


def _light(scene: World, camera: Viewpoint, case: Case) -> Array:
    """What reaches the camera of the scene, (H, W, 3)."""
    clear = clear_of(scene, camera.origin * [1, 1, 0])
    rng = np.random.default_rng([case.seed, 3])
    shape = camera.rays.shape[:2]
    return np.maximum(shaded(clear, camera.origin, camera.rays.reshape(-1, 3), rng)[0], 0).reshape(*shape, 3)


def _own(light: Array, camera: Viewpoint, case: Case) -> Mask:
    """The camera's own image, (H, W) bool, which is drawn over the light."""
    ground = np.ones(light.shape[:2], np.bool_)
    if camera.radii is not None:
        housing(light, ground, camera.radii, np.random.default_rng([case.seed, 4]))
    else:
        bonnet(light, ground, np.random.default_rng([case.seed, 4]))
    return ~ground


@dataclass(frozen=True, slots=True)
class Outcome:
    """What was found: IoU with the camera's own image, share of the scene lost; whether the camera was said to stand."""

    case: Case
    overlap: float
    lost: float
    refused: bool


def judged(case: Case) -> tuple[Outcome, Outcome]:
    """Look for the own image of one case: of a camera that sees itself, and of one that does not."""
    prepare_worker()
    itself, nothing = (_outcome(case, images, own) for images, own in frames(case))
    return itself, nothing


def _outcome(case: Case, images: list[Image], own: Mask) -> Outcome:
    try:
        found = own_image(images)
    except SegmentationError:
        return Outcome(case, 0.0, 0.0, refused=True)
    return Outcome(case, iou(found, own * np.uint8(INSIDE)), float((found & ~own).mean()), False)


def main(cases: int = 12, first: int = 0) -> int:
    """Draw, look, tell."""
    seeds = range(first, first + cases)
    worst = 0.0
    with ProcessPoolExecutor() as pool:
        for drive, kind in product(DRIVES, KINDS):
            itself, nothing = zip(*pool.map(judged, [Case(kind, seed, drive) for seed in seeds]), strict=True)
            print(_told(kind, drive, True, itself), _told(kind, drive, False, nothing), sep="\n", flush=True)
            if drive in WELL:
                worst = max(worst, *(one.lost for one in (*itself, *nothing)))
    return int(worst > MOST_LOST)


def _told(kind: str, drive: Drive, itself: bool, outcomes: tuple[Outcome, ...]) -> str:
    lost = [one.lost for one in outcomes]
    what = f"{kind:7}{drive.images:3} images, {drive.step:.2f} m, {drive.turn:.2f} rad  "
    text = f"lost {mean(lost):.4f}, at most {max(lost):.4f}; refused {sum(one.refused for one in outcomes)}"
    if not itself:
        return f"{what}sees nothing of itself: {text}"
    found = [one.overlap for one in outcomes if one.overlap >= FOUND]
    return f"{what}own image found {len(found)} of {len(outcomes)}, IoU {mean(found) if found else 0:.3f}: {text}"


if __name__ == "__main__":
    harness.as_command(main)
