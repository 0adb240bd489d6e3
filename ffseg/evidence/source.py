"""Sources from outside: a model file (``edges.model``), or a map that comes with the image (``--evidence``)."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from ffseg.arrays import Mask, Plane
from ffseg.errors import ImageReadError, ParameterError, SegmentationError
from ffseg.evidence.clicks import with_clicks
from ffseg.evidence.features import features, reduced_mean, startless_planes
from ffseg.evidence.forest import Model, load_model
from ffseg.evidence.gradient import gradient
from ffseg.evidence.maps import LEVEL, at_level, certain_odds, evidence_edges, probability, strength_edges
from ffseg.evidence.prior import appearance_of, prior
from ffseg.evidence.recent import Recent
from ffseg.image.appearance import Appearance
from ffseg.image.checked import require_size
from ffseg.image.edges import PRIOR_CALIBRATION, EdgeMap, ScoreCalibration
from ffseg.image.parts import connected_parts
from ffseg.image.raster import rasterize
from ffseg.io.files import printable, read_bytes
from ffseg.parameters import Network, Parameters
from ffseg.scene import NothingThereError, Scene
from ffseg.starts.initial import circle_start, middles
from ffseg.starts.parts import start_core
from ffseg.starts.pockets import discs
from ffseg.starts.rivals import seeds

FOREST_SUFFIX, NETWORK_SUFFIX = ".ffmodel", ".onnx"

MAX_NETWORK_BYTES = 1 << 30

MIN_START_RADIUS = 2.0
"""Pixels of the reduced image: a start that a model finds is not smaller."""

CACHED_ANSWERS = 4
"""Answers of models that are kept for the next click: while the hand moves, a reduced copy is asked again and again, and only
what the last click changes is new."""

FIRST_CIRCLES = 2
"""A model is asked from so many circles, mostly its own start and a click; later ones correct what it says. With all of them
each click changes the region everywhere: 4.8 % of 1650 clicks on drawings lose more than .02, for 2.6 % (6.6 clicks to an IoU
of .85, for 6.8). With one, a start of the model's that is wrong stays in the way (7.0 clicks)."""


_answers = Recent[Any](CACHED_ANSWERS)


def model_edges(scene: Scene) -> EdgeMap:
    """Edges where the model in ``edges.model`` falls to ``region.probability``: the source ``model``.

    Raises
    ------
    ParameterError
        If the model cannot be used.
    SegmentationError
        If a network cannot be asked.
    """
    path = scene.params.edges.model
    if path is None:
        raise ParameterError("edges.source: model needs a model; set edges.model to a file")
    own, (joined, boxed) = gradient(scene), _with_boxes(scene)
    if path.endswith(NETWORK_SUFFIX):
        return _edges(scene, joined(_network_map(scene, path)), own, "model", boxed or PRIOR_CALIBRATION)

    model = ready(path)
    appearance = scene.appearance if isinstance(scene.appearance, Appearance) else _seen(scene, model)

    def say(start: Mask) -> Plane:
        make = partial(model_odds, model, appearance, start)
        return joined(_answers.of(scene.image, (path, _mark(path)), make, start) if scene.has_hints else make())

    promised = boxed or model.calibration
    return _edges(scene, say(_before_clicks(scene)), own, "model", promised, lambda start: certain_odds(say(start)))


def _seen(scene: Scene, model: Model) -> Appearance:
    """The image as a model expects it."""
    return appearance_of(scene, model.size, even=model.exposed)


def _with_boxes(scene: Scene) -> tuple[Callable[[Plane], Plane], ScoreCalibration | None]:
    """What joins a model's probabilities of inside with what is seen in boxes, shape (H, W) both, and what that promises."""
    if not scene.boxes or scene.params.edges.evidence == "edges":
        return (lambda values: values), None
    from ffseg.evidence.box import CALIBRATION, box_odds, looks, with_said  # load features of the box's forest

    seen = looks(scene)

    def joined(values: Plane) -> Plane:
        said = certain_odds(values)
        return probability(box_odds(scene, with_said(scene, seen, said), said))

    return joined, CALIBRATION


def _before_clicks(scene: Scene) -> Mask:
    """The start region; of several circles the first ones, which the others correct, and beside boxes the middles of these."""
    if not scene.params.init.circles or scene.start_mask is not None:
        return start_core(scene)
    if scene.boxes:
        return rasterize(middles(scene.params, scene.shape), scene.shape)
    return start_core(replace(scene, starts=scene.starts[:FIRST_CIRCLES]))


def model_odds(model: Model, image: Appearance, start: Mask) -> Plane:
    """Probability of inside by a model, for an image as it sees it and a start region, with the prior where the model uses it.

    Returns
    -------
    ndarray of float32, shape (H, W)
        Probability of inside.
    """
    seen = features(image, start)
    if not model.prior:
        return model.map(seen)
    return model.map(seen, prior(image.usual, start))


def _network_map(scene: Scene, path: str) -> Plane:
    from ffseg.image.onnx import map_of  # loads OpenCV's networks

    try:
        return map_of(scene.image, _net(path, _mark(path)), scene.params.network)
    except ValueError as error:
        raise SegmentationError(f"the network {printable(path)}: {error}") from error


def map_edges(scene: Scene) -> EdgeMap:
    """Edges of the map that came with the image: the source ``evidence``.

    Raises
    ------
    SegmentationError
        If there is none, or it has another size than the image.
    """
    if scene.evidence is None:
        raise SegmentationError("edges.source: evidence needs a map of each image; name their folder with --evidence")
    require_size("the map of evidence", scene.evidence, scene.shape, "it must have the image's size")
    return _edges(scene, scene.evidence, gradient(scene), "evidence")


def _edges(
    scene: Scene,
    values: Plane,
    own: EdgeMap,
    source: str,
    calibration: ScoreCalibration = PRIOR_CALIBRATION,
    ask: Callable[[Mask], Plane] | None = None,
) -> EdgeMap:
    if scene.params.edges.evidence == "edges":
        return strength_edges(values, own)
    if scene.has_hints:
        return with_clicks(scene, own, certain_odds(values), ask, calibration)
    edges = evidence_edges(at_level(values, scene.params.region.probability), own, source)
    return edges if edges is own else replace(edges, calibration=calibration)


def finds_all(params: Parameters) -> bool:
    """Whether the model of these parameters is one of many things, of which it tells all."""
    path = params.edges.model
    return path is not None and path.endswith(FOREST_SUFFIX) and ready(path).parts


def with_all_parts(scene: Scene) -> Scene:
    """The scene, which asks for all parts if its model tells all of many things and nobody has said otherwise."""
    params = scene.params
    if params.region.islands is not True or scene.evidence is not None or not finds_all(params):
        return scene
    return replace(scene, params=replace(params, region=replace(params.region, islands="all")))


def with_model_start(scene: Scene) -> Scene:
    """The scene with the start that a model finds, if any; further circles given in its parameters follow it.

    Raises
    ------
    SegmentationError
        If it lies outside, no circle is given, and the model finds no other.
    NothingThereError
        If a model of many things finds none of them, and no circle is given.

    Notes
    -----
    The start is a disc in the largest region of which the model is sure without a start; if what is known to lie outside
    lies in that, the circles take its place or, without any, a disc in what is left. A centre, boxes or a mask that are named
    take its place, too.
    """
    params, image = scene.params, scene.image
    path, init = params.edges.model, params.init
    elsewhere = init.center != "auto" or init.boxes or init.mask
    if path is None or elsewhere or not path.endswith(FOREST_SUFFIX):
        return scene
    model, most = ready(path), init.radius_in(image.shape)
    seen = _seen(scene, model)
    scene, find = replace(scene, appearance=seen), partial(model_start, seen, model, most)
    circle = _answers.of(image, (path, _mark(path), most), find) if init.circles or init.background else find()
    if circle is not None and scene.clicked_outside:
        outside = seeds(init.background, np.zeros(scene.shape, np.bool_), scene.background)
        if (outside & rasterize([circle_start(circle, params)], outside.shape)).any():
            if init.circles:
                return scene
            circle = model_start(seen, model, most, outside)
            if circle is None and not model.parts:
                raise SegmentationError(
                    "the model finds no start beside what is known to lie outside; add one, in init.circles"
                )
    if circle is None:
        if model.parts and model.start is not None and not init.circles:
            raise NothingThereError("the model tells of none of the things that it has learned")
        return scene
    later = tuple((*seed[:3], seed[3] + 1) if len(seed) == 4 else seed for seed in init.background)
    return replace(scene, params=replace(params, init=replace(init, circles=(circle, *init.circles), background=later)))


def proposes(params: Parameters) -> bool:
    """Whether a model tells of an image in which nothing was picked: where all images start, or a forest finds a start.

    A network takes the middle of the image.
    """
    path, init = params.edges.model, params.init
    named = init.center != "auto" or init.mask is not None
    return path is not None and (named or not path.endswith(FOREST_SUFFIX) or ready(path).start is not None)


def model_start(
    image: Appearance, model: Model, most: float, outside: Mask | None = None
) -> tuple[float, float, float] | None:
    """Centre and radius (px, at most `most`) of a disc in the largest sure region not known `outside`, or None."""
    if model.start is None:
        return None
    factor = image.factor
    sure = probability(model.start.log_odds(startless_planes(image, model.start.features))) >= LEVEL
    if outside is not None:
        sure &= reduced_mean(outside.astype(np.float32), factor) == 0
    if not sure.any():
        return None
    regions = connected_parts(sure)
    ((x, y, depth),) = discs(sure, regions, np.array([regions.areas.argmax()]), np.inf)
    middle = (factor - 1) / 2  # which the last block may not have
    x, y = (min(at * factor + middle, size - 1.0) for at, size in zip((x, y), image.image.shape[1::-1], strict=True))
    return x, y, min(most, max(depth, MIN_START_RADIUS) * factor)


def ready(path: str) -> Model:
    """A model, kept in memory while the file is unchanged.

    Raises
    ------
    ParameterError
        If it cannot be used.
    """
    return _model(path, _mark(path))


def learned_from(params: Parameters) -> frozenset[str]:
    """Names of the images that ``edges.model`` was learned from, if its file has them."""
    path = params.edges.model
    if path is None or not path.endswith(FOREST_SUFFIX):
        return frozenset()
    names = ready(path).about.get("images")
    return frozenset(one for one in names if isinstance(one, str)) if isinstance(names, list) else frozenset()


def check_model(path: str, network: Network | None = None) -> None:
    """Refuse an unusable model before anything is run; a network is tried in a process of its own.

    Raises
    ------
    ParameterError
        Naming the file.
    """
    if path.endswith(FOREST_SUFFIX):
        ready(path)
    elif path.endswith(NETWORK_SUFFIX):
        _require_harmless(path, _mark(path), network or Network())
    else:
        raise ParameterError(f"edges.model {printable(path)}: it is neither a .ffmodel nor an .onnx file")


@lru_cache(maxsize=4)
def _require_harmless(path: str, mark: tuple[int, int, int], network: Network) -> None:  # noqa: ARG001 - part of the key
    from ffseg.image.onnx import require_harmless

    try:
        read_bytes(path, MAX_NETWORK_BYTES)
        require_harmless(path, network)
    except (ImageReadError, ValueError) as error:
        raise ParameterError(f"edges.model {printable(path)}: {error}") from error


def _mark(path: str) -> tuple[int, int, int]:
    """What changes when a file does."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return (0, 0, 0)
    return status.st_mtime_ns, status.st_size, status.st_ino


@lru_cache(maxsize=4)
def _model(path: str, mark: tuple[int, int, int]) -> Model:  # noqa: ARG001 - part of the key
    return load_model(path)


@lru_cache(maxsize=2)
def _net(path: str, mark: tuple[int, int, int]) -> Any:  # noqa: ANN401, ARG001 - OpenCV's; part of the key
    from ffseg.image.onnx import load_net

    try:
        return load_net(read_bytes(path, MAX_NETWORK_BYTES))
    except (ImageReadError, ValueError) as error:
        raise ParameterError(f"edges.model {printable(path)}: {error}") from error
