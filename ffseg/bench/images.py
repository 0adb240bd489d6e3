"""Suites on images, ``scenes``, ``method``, ``peers`` and ``size``, and ``patches``: one iteration in an empty map."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from ffseg.arrays import Image, Mask
from ffseg.batch.workers.pictures import read_truth
from ffseg.bench.drawing import MAX_ITERATIONS, draw
from ffseg.bench.measure import Fact, Schedule, Skipped, Task, TaskGroup, timed
from ffseg.errors import ImageReadError, UsageError
from ffseg.geometry.freeform import FreeForm
from ffseg.image.edges import edge_map
from ffseg.image.keypoints import grey_image
from ffseg.io.files import printable
from ffseg.io.images import read_image
from ffseg.methods.freeform import native_options
from ffseg.methods.peers import method_parameters
from ffseg.metrics import iou
from ffseg.native import _core
from ffseg.parameter_files import load_params
from ffseg.parameters import Parameters
from ffseg.pipeline import segment
from ffseg.plugins import PEERS
from ffseg.plugins import method as row_of
from ffseg.samples.scenes import SCENES
from ffseg.scene import Scene
from ffseg.starts.initial import start_contours

SUFFIXES = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm"}
NUM_DRAWN = 4
WIDTHS, QUICK_WIDTHS = (400, 800, 1600, 3200, 6400), (100, 150, 200)
BESIDE = ("sitk_fast_marching", "cv_edges_opened")
"""Peers that the free form has to beat; ``ffseg compare`` measures all of them."""
COUNTS, QUICK_COUNTS = (10, 30, 100, 300, 1000, 3000, 10_000, 20_000), (10, 30, 100)
PATCHES = 10
"""Patches of one circle; contours of N patches are N / 10 circles on a square lattice."""
WARM_UP, ITERATIONS = 1, 3
"""Iterations before the clock starts, the first of which sorts the patches and fills the lists, and those timed: circles
that touch meet in the first of them, and have merged on all sides after the last."""
MIN_WORK = 1000
"""Patches moved in one sample at least, by as many evolutions as that takes: the clock must not show."""
CASES = {"still": (2.5, False), "filtered": (2.5, True), "merging": (0.75, True)}
"""Space between the circles, in the way the front goes meanwhile (twice that closes it), and whether topology changes
are looked for: never looked for; looked for, none happening; every circle merging with its neighbours."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """An image to measure on, its truth (255 inside, 128 ignored, 0 outside) if known, and parameters."""

    name: str
    image: Image
    truth: Image | None
    params: Parameters


def scenes(order: Schedule, _: Path) -> Iterator[TaskGroup]:
    """Edge map, evolution and the whole segmentation of the user's images, or of samples and drawn scenes."""
    for picture in _pictures(order):
        yield _segmented("scenes", picture, "freeform", picture.name)


def method(order: Schedule, _: Path) -> Iterator[TaskGroup]:
    """Every method that is asked for on a simple and a complex image."""
    for picture in _own(order):
        for name in order.methods if picture.name in ("simple", "complex", "small") else ():
            yield _segmented("method", picture, name, f"{picture.name} by {name}")


def size(order: Schedule, _: Path) -> Iterator[TaskGroup]:
    """The same scene from 400x300 to 6400x4800 pixels; what is measured grows with the pixels."""
    for width in QUICK_WIDTHS if order.quick else WIDTHS:
        picture = _drawn(1, width)
        name = f"scene, {width}x{picture.image.shape[0]}"
        yield _segmented("size", picture, "freeform", name, x=picture.image.size)


def peers(order: Schedule, _: Path) -> Iterator[TaskGroup | Skipped]:
    """The whole segmentation by the free form and by a peer, in turns, on the user's images or the samples."""
    for picture in _pictures(order):
        for name in () if picture.name.startswith("drawn") else BESIDE:
            if PEERS[name].installed:
                yield _beside(picture, name)
            else:
                yield Skipped(
                    "peers", f"{picture.name}, {name}", f"{PEERS[name].package} is not installed; add ffseg[peers]"
                )


def _beside(picture: Picture, name: str) -> TaskGroup:
    theirs, section = method_parameters(picture.params, name)
    own, other = Scene(picture.image, picture.params), Scene(picture.image, theirs, row_of(name), options=section)
    cases = f"{picture.name}, freeform beside {name}", f"{picture.name}, {name}"
    facts: dict[str, Fact] = {"size": f"{picture.image.shape[1]}x{picture.image.shape[0]}"}
    if picture.truth is not None:
        facts |= {"iou": _score(segment(own).mask, picture), "peer iou": _score(segment(other).mask, picture)}
    tasks = [Task(case, "segment", timed(partial(segment, one))) for case, one in zip(cases, (own, other), strict=True)]
    ratio = (f"{picture.name}: freeform over {name}", *cases)
    return TaskGroup("peers", f"{picture.name}, {name}", grey_image(picture.image), tasks, facts, [ratio])


def _score(mask: Mask, picture: Picture) -> float:
    return round(iou(mask, picture.truth), 5) if picture.truth is not None else float("nan")


def _segmented(suite: str, picture: Picture, method_name: str, case: str, x: float = 0.0) -> TaskGroup:
    """Tasks for the three stages of a segmentation, and what it found."""
    image, params, row = picture.image, picture.params, row_of(method_name)
    edges, shape = edge_map(image, params.edges), (image.shape[0], image.shape[1])
    works: dict[str, Callable[[], object]] = {
        "edges": lambda: edge_map(image, params.edges),
        "evolve": lambda: row.loaded()(Scene(image, params, edges=edges, starts=start_contours(shape, params))),
        "segment": lambda: segment(Scene(image, params, row)),
    }
    result = segment(Scene(image, params, row))
    stats = result.stats
    facts: dict[str, Fact] = {
        "size": f"{shape[1]}x{shape[0]}",
        "iterations": stats.iterations,
        "patches": stats.patches,
    }
    facts |= {"flips": stats.flips, "holes": result.num_holes, "stopped": stats.stop_reason}
    if picture.truth is not None:
        facts["iou"] = _score(result.mask, picture)
    return TaskGroup(
        suite, case, grey_image(image), [Task(case, name, timed(work), x) for name, work in works.items()], facts
    )


def check(order: Schedule) -> None:
    """Read the images once, before anything is measured.

    Raises
    ------
    UsageError
        As `image_files`, or if an image or its truth cannot be used.
    """
    try:
        deque(_pictures(order), maxlen=0)
    except ImageReadError as error:
        raise UsageError(f"--images: {error}") from error


def _pictures(order: Schedule) -> Iterator[Picture]:
    if order.images is None:
        yield from _own(order)
        return
    for path in image_files(order.images):
        image, name = read_image(path), f"{path.stem}.png"
        places = (path.with_name(f"{path.stem}_truth.png"), path.parent / "truth" / name)
        truths = (read_truth(str(place), (image.shape[0], image.shape[1])) for place in places if place.is_file())
        yield Picture(printable(path.stem), image, next(truths, None), Parameters())


def _own(order: Schedule) -> Iterator[Picture]:
    """The project's samples and some drawn scenes."""
    if order.quick:
        yield _drawn(1, 160, "small")
        return
    for name, scene in SCENES.items():
        drawing = scene()
        image = drawing.image if drawing.image.ndim == 2 else np.ascontiguousarray(drawing.image[:, :, ::-1])
        yield Picture(name, image, drawing.truth, Parameters())
    yield from (_drawn(seed, 800, f"drawn {seed}") for seed in range(NUM_DRAWN))


def _drawn(seed: int, width: int, name: str = "scene") -> Picture:
    drawing = draw(seed, width, width * 3 // 4)
    params = load_params(None, {"init.radius": drawing.start_radius, "contour.max_iterations": MAX_ITERATIONS})
    return Picture(name, drawing.image, None, params)


def image_files(folder: Path) -> list[Path]:
    """Image files of a folder but for their truths, ``NAME_truth.png``.

    Raises
    ------
    UsageError
        If there is no such folder, it holds no image, or figures of two images would have one key.
    """
    if not os.path.isdir(folder):
        raise UsageError(f"--images: there is no folder {printable(folder)}; check the name")
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    paths = [path for path in paths if not path.stem.endswith("_truth")]
    if not paths:
        raise UsageError(f"--images: {printable(folder)} holds no image; give a folder of images")
    for one, other in pairwise(sorted(paths, key=lambda path: path.stem)):
        if one.stem == other.stem:
            names = f"{printable(one.name)} and {printable(other.name)}"
            raise UsageError(f"--images: figures of {names} would have the same keys; rename one")
    return paths


def patches(order: Schedule, _: Path) -> Iterator[TaskGroup]:
    """Time of one iteration, for each number of patches."""
    grey = draw(1).image
    for count in QUICK_COUNTS if order.quick else COUNTS:
        tasks = [_iterations(case, count) for case in CASES]
        yield TaskGroup("patches", f"N = {count}", grey, tasks, {"circles": count // PATCHES})


def _iterations(case: str, count: int) -> Task:
    """Circles whose patches are half as long as those that are split, in the map that holds them."""
    (space, topology), circles = CASES[case], count // PATCHES
    options = native_options(Parameters(), 0.0)
    options.topology = topology
    way = options.balloon * (WARM_UP + ITERATIONS)
    radius = PATCHES * options.split_threshold / (4 * np.pi)
    spacing, margin = 2 * radius + space * way, 2 * (radius + way)
    circle = FreeForm.circle((0.0, 0.0), radius, PATCHES, options.degree).control_points
    columns = int(np.ceil(np.sqrt(circles)))
    places = np.stack(np.divmod(np.arange(circles), columns)[::-1], axis=1) * spacing + margin
    points = np.ascontiguousarray((places[:, None, :] + circle[None]).reshape(-1, 2))
    side = int(np.ceil((columns - 1) * spacing + 2 * margin))
    empty, copies = np.zeros((side, side), np.uint8), max(1, MIN_WORK // count)

    def advance(evolutions: list[_core.Evolution], iterations: int) -> None:
        for evolution in evolutions:
            evolution.advance(iterations)

    def fresh() -> Callable[[], None]:
        starts = np.arange(circles + 1) * len(circle)
        evolutions = [_core.Evolution(points, starts, empty, None, options) for _ in range(copies)]
        advance(evolutions, WARM_UP)
        return partial(advance, evolutions, ITERATIONS)

    return Task(f"{case}, {count}", "iteration", timed(fresh, ITERATIONS * copies, fresh=True), x=count)
