"""Suites on images: ``scenes``, ``method`` and ``peers`` at one size, ``size`` over many."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ffseg.batch.workers.truth import read_truth
from ffseg.bench.children import LONG
from ffseg.bench.drawing import draw
from ffseg.bench.measure import Comparison, Fact, Group, Order, Skipped, Task, timed
from ffseg.errors import UsageError
from ffseg.image.edges import EdgeMap, edge_map
from ffseg.image.keypoints import grey_image
from ffseg.image.raster import rasterize
from ffseg.io.files import printable
from ffseg.io.images import read_image
from ffseg.methods.peers import configured, geodesic
from ffseg.metrics import iou
from ffseg.parameters import Parameters, load_params
from ffseg.peer_parameters import SkimageGac
from ffseg.pipeline import segment
from ffseg.plugins import PEERS
from ffseg.plugins import method as row_of
from ffseg.samples.scenes import SCENES
from ffseg.scene import Scene
from ffseg.starts.initial import start_contours

Image = NDArray[np.uint8]

SUFFIXES = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm"}
NUM_DRAWN = 4
WIDTHS = (400, 800, 1600, 3200, 6400)
QUICK_WIDTHS = (100, 150, 200)
QUICK_ITERATIONS = 20
SAME = 0.999
"""IoU from which on a peer has reached its result: the one pixel by which it may still move is far less."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """An image to measure on, its truth (255 inside, 128 ignored, 0 outside) if known, and parameters."""

    name: str
    image: Image
    truth: Image | None
    params: Parameters


def scenes(order: Order, _: Path) -> Iterator[Group]:
    """Edge map, evolution and the whole segmentation of the user's images, or of samples and drawn scenes."""
    for picture in _folder(order.images) if order.images else _own(order):
        yield _segmented("scenes", picture, "freeform", picture.name)


def method(order: Order, _: Path) -> Iterator[Group | Skipped]:
    """Every method that is asked for on a simple and a complex image."""
    for picture in _own(order):
        if picture.name not in ("simple", "complex", "small"):
            continue
        for name in order.methods:
            yield _segmented("method", picture, name, f"{picture.name} by {name}")


def size(order: Order, _: Path) -> Iterator[Group]:
    """The same scene from 400x300 to 6400x4800 pixels; what is measured grows with the pixels."""
    for width in QUICK_WIDTHS if order.quick else WIDTHS:
        picture = _drawn(1, width)
        name = f"{picture.image.shape[1]}x{picture.image.shape[0]}"
        yield _segmented("size", picture, "freeform", f"scene, {name}", x=picture.image.size)


def peers(order: Order, _: Path) -> Iterator[Group | Skipped]:
    """The free form beside the peers it has to beat, each pair in turns, on the user's images or the samples."""
    pictures = _folder(order.images) if order.images else _own(order)
    for picture in pictures:
        if picture.name.startswith("drawn"):
            continue
        for name in ("sitk_fast_marching", "cv_edges_opened", "skimage_gac"):
            if PEERS[name].installed:
                yield _beside(picture, name, quick=order.quick)
            else:
                yield Skipped("peers", f"{picture.name}, {name}", f"{PEERS[name].package} is not installed")


def _beside(picture: Picture, name: str, *, quick: bool) -> Group:
    """A peer and the free form on one picture: what comes after the edge map, on the edge map each has by default.

    With ``cv_edges_opened`` it is the whole segmentation, because edges are all that peer does. Making a peer's start
    region is not counted.
    """
    image, params, peer = picture.image, picture.params, row_of(name)
    shape = (image.shape[0], image.shape[1])
    theirs, section = configured(params, name)
    edges, seen, starts = edge_map(image, params.edges), edge_map(image, theirs.edges), start_contours(shape, params)
    facts: dict[str, Fact] = {"size": f"{shape[1]}x{shape[0]}"}
    if isinstance(section, SkimageGac):
        seeds = rasterize(starts, shape)
        section = enough(seen, seeds, replace(section, iterations=QUICK_ITERATIONS) if quick else section)
        facts["peer iterations"] = section.iterations
    cases = f"{picture.name}, freeform beside {name}", f"{picture.name}, {name}"
    works: tuple[Callable[[], object], Callable[[], object]]
    if name == "cv_edges_opened":
        stage, ratio = "segment", Comparison(f"{picture.name}: freeform over {name}", *cases)
        works = (
            lambda: segment(Scene(image, params)),
            lambda: peer.loaded()(
                Scene(image, theirs, edges=edge_map(image, theirs.edges), starts=starts, options=section)
            ),
        )
    else:
        stage, ratio = "evolve", Comparison(f"{picture.name}: {name} over freeform", *cases[::-1])
        own = row_of("freeform")
        works = (lambda: own.loaded()(Scene(image, params, edges=edges, starts=starts))), lambda: peer.loaded()(scene)
    scene = Scene(image, theirs, edges=seen, starts=starts, options=section)
    if picture.truth is not None:
        facts["iou"] = round(iou(segment(Scene(image, params)).mask, picture.truth), 5)
        facts["peer iou"] = round(iou(segment(Scene(image, theirs, peer, options=section)).mask, picture.truth), 5)
    tasks = [Task(case, stage, timed(work)) for case, work in zip(cases, works, strict=True)]
    return Group("peers", f"{picture.name}, {name}", grey_image(image), tasks, facts, [ratio])


def enough(edges: EdgeMap, seeds: NDArray[np.bool_], section: SkimageGac) -> SkimageGac:
    """No more iterations than reach, to an IoU of 0.999, the region that all of them reach."""
    passed: list[NDArray[np.uint8]] = []
    final = geodesic(edges, seeds, section, lambda levels: passed.append(np.packbits(levels > 0)))
    packed, count = np.packbits(final), len(passed)
    while count > 1 and _agree(passed[count - 2], packed):
        count -= 1
    return replace(section, iterations=max(1, count - 1))  # the first that is heard of is the start


def _agree(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> bool:
    """Whether two packed masks have an IoU of `SAME`."""
    both, either = (int(np.count_nonzero(np.unpackbits(bits))) for bits in (one & other, one | other))
    return both >= SAME * either


def _segmented(suite: str, picture: Picture, method_name: str, case: str, x: float = 0.0) -> Group:
    """Tasks for the three stages of a segmentation, and what it found."""
    image, params, row = picture.image, picture.params, row_of(method_name)
    shape = (image.shape[0], image.shape[1])
    edges = edge_map(image, params.edges)
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
        "flips": stats.flips,
        "holes": sum(contour.signed_area < 0 for contour in result.contours),
        "stopped": stats.stop_reason,
    }
    if picture.truth is not None:
        facts["iou"] = round(iou(result.mask, picture.truth), 5)
    tasks = [Task(case, stage, timed(work), x) for stage, work in works.items()]
    return Group(suite, case, grey_image(image), tasks, facts)


def _own(order: Order) -> Iterator[Picture]:
    """The project's samples and some drawn scenes."""
    if order.quick:
        yield _drawn(1, 160, "small")
        return
    for name, scene in SCENES.items():
        drawing = scene()
        image = drawing.image if drawing.image.ndim == 2 else np.ascontiguousarray(drawing.image[:, :, ::-1])
        yield Picture(name, image, drawing.truth, Parameters())
    for seed in range(NUM_DRAWN):
        yield _drawn(seed, 800, f"drawn {seed}")


def _drawn(seed: int, width: int, name: str = "scene") -> Picture:
    drawing = draw(seed, width, width * 3 // 4)
    params = load_params(None, {"init.radius": drawing.start_radius, "contour.max_iterations": LONG})
    return Picture(name, drawing.image, None, params)


def _folder(folder: Path) -> Iterator[Picture]:
    """Images of a folder; ``NAME_truth.png`` and ``truth/NAME.png`` are their truths."""
    for path in listed(folder):
        image = read_image(path)
        truth = _truth_of(path, (image.shape[0], image.shape[1]))
        yield Picture(printable(path.stem), image, truth, Parameters())


def listed(folder: Path) -> list[Path]:
    """Image files of a folder but for their truths.

    Raises
    ------
    UsageError
        If there is no such folder, or it holds no image.
    """
    if not os.path.isdir(folder):
        raise UsageError(f"--images: there is no folder {printable(folder)}; check the name")
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    paths = [path for path in paths if not path.stem.endswith("_truth")]
    if not paths:
        raise UsageError(f"--images: {printable(folder)} holds no image; give a folder of images")
    return paths


def _truth_of(path: Path, shape: tuple[int, int]) -> Image | None:
    places = (path.with_name(f"{path.stem}_truth.png"), path.parent / "truth" / f"{path.stem}.png")
    return next((read_truth(str(place), shape) for place in places if place.is_file()), None)
