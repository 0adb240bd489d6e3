"""The free-form active contour (Algorithms 2 to 4): parameters and values round the native core."""

from __future__ import annotations

import numpy as np

from ffseg.arrays import Image
from ffseg.errors import ParameterError
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed, unpacked
from ffseg.image.edges import GRADIENT_SCALE
from ffseg.methods.effort import budget, evolve, iterations, stats_of
from ffseg.native import _core
from ffseg.parameters import ZERO_BALLOON, Parameters
from ffseg.scene import BlockedStartError, Outcome, Progress, Scene

RIDGE_FRACTION = 0.5
"""The gradient along a ridge may fall to this fraction of the low Canny threshold: between samples an edge fades and
returns."""

WORK = 4
"""Budget: patches moved or examined per pixel of the domain. Measured: 0.4 per filled pixel on photographs and random
textures; in the narrowest passages (spirals 6.5 and 7 px wide) 0.3 per pixel of 360 x 360 images, and more the longer
the passage, since the whole front is examined though most of it rests: 2.4 at 1080 x 1080."""


def run(scene: Scene) -> Outcome:
    """Evolve the start contours on an edge map until they stop (Algorithm 4), then settle them on its ridges.

    Parameters
    ----------
    scene : Scene
        Of its parameters ``contour``, ``region.weight`` and ``region.window`` are used; of the image, where that weight is
        above 0, the colours. A negative ``contour.balloon`` closes in from outside.

    Returns
    -------
    Outcome

    Raises
    ------
    BlockedStartError
        If every sample of every start lies on an edge or outside the domain; its text is the remedy.
    ParameterError
        If ``contour.balloon`` is 0, which only the snake and the level set can do with.

    Notes
    -----
    Differs: a contour that closes in is evolved as the hole of a growing one; its orientation is turned round
    on the way in and out.
    """
    edge_map, starts, params, callback = scene.edges, scene.starts, scene.params, scene.callback
    if params.contour.balloon == 0:
        raise ParameterError(ZERO_BALLOON)
    shrinking = params.contour.balloon < 0
    oriented = tuple(c.reversed() for c in starts) if shrinking else starts
    evolution = _core.Evolution(
        *packed(oriented),
        edge_map.edges,
        edge_map.domain,
        _options(scene),
        _colours(scene),
        None if scene.footprint is None else scene.footprint.cells,
    )
    if evolution.stop_reason == "blocked":
        if scene.footprint is not None:
            raise BlockedStartError(
                f"nothing can move with the footprint of {scene.footprint.radius_m:g} m: give a smaller one"
            )
        raise BlockedStartError("move init.center, change init.radius or raise edges.canny")

    def current() -> tuple[FreeForm, ...]:
        points, offsets = evolution.contours()
        contours = unpacked(points, offsets, params.contour.degree)
        return tuple(c.reversed() for c in contours) if shrinking else contours

    evolve(evolution.advance, scene, lambda: Progress(evolution.counts()["iterations"], current()))
    evolution.settle(edge_map.gradient)
    contours = current()
    if all(contour.signed_area < 0 for contour in contours):  # turned inside out where an image is narrower than a step
        contours = ()
    if callback is not None:
        callback(Progress(evolution.counts()["iterations"], contours))
    return Outcome(contours, stats_of(evolution, starts, contours))


def native_options(params: Parameters, low: float) -> _core.EvolutionOptions:
    """Options of the core, which has no defaults of its own; `low` is the low Canny threshold, grey levels per pixel."""
    contour, options = params.contour, _core.EvolutionOptions()
    options.degree = contour.degree
    options.split_threshold = contour.split_threshold
    options.balloon = abs(contour.balloon)
    options.refine = contour.refine
    options.topology = contour.topology
    options.max_iterations = iterations(params)
    options.clearance = contour.clearance
    options.settle = contour.settle
    options.ridge_low = RIDGE_FRACTION * low * GRADIENT_SCALE
    options.weight, options.window = params.region.weight, params.region.window
    return options


def _options(scene: Scene) -> _core.EvolutionOptions:
    options = native_options(scene.params, scene.edges.thresholds[0])
    options.budget = budget(scene, WORK)
    if scene.footprint is not None:
        options.clearance = scene.footprint.diameter
    return options


def _colours(scene: Scene) -> Image | None:
    """The image by channels, shape (H, W, C), where its colours have a weight."""
    if scene.params.region.weight == 0:
        return None
    return np.ascontiguousarray(scene.image[..., None] if scene.image.ndim == 2 else scene.image)
