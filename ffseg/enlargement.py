"""Enlarged images are segmented at their original size, so that both have the same region."""

from __future__ import annotations

from dataclasses import replace
from math import ceil, pi, sqrt
from typing import cast

import numpy as np

from ffseg.arrays import Image
from ffseg.geometry.freeform import FreeForm
from ffseg.image.magnified import magnification
from ffseg.image.resized import resized
from ffseg.io.masks import Masks
from ffseg.parameters import MIN_START_RADIUS, Circle, Init, Parameters, Seed
from ffseg.scene import Scene

HALF_SET = 128
"""Mean of a mask's pixels, 0 or 255, from which on half of them are set."""


def before_enlargement(scene: Scene) -> Scene:
    """The scene at the size that its image had before an enlargement by an integer factor; else unchanged.

    Interpolated pixels carry no information. The image is used as it is if more than masks is given at its size: edges,
    maps, models, camera measurements, or lengths in pixels other than the defaults. So is a draft: it is a reduced copy itself.
    """
    params = scene.params
    given = scene.edges_given or scene.evidence is not None or scene.footprint is not None or len(scene.altitudes) > 0
    as_printed = scene.method is not None and bool(scene.method.source)
    at_its_size = scene.draft or given or as_printed or params.edges.model is not None
    if at_its_size or _lengths(params) != DEFAULT_LENGTHS:
        return scene
    smallest = min((abs(start.signed_area) for start in scene.starts), default=0.0)
    factor, image = magnification(scene.image, sqrt(smallest / pi) / MIN_START_RADIUS)
    return scene if factor == 1 else _reduced(scene, factor, image)


def enlarged(contours: tuple[FreeForm, ...], factor: int) -> tuple[FreeForm, ...]:
    """Contours at the size of the enlargement."""
    return tuple(one.affine(factor * np.eye(2), ((factor - 1) / 2,) * 2) for one in contours)


def _reduced(scene: Scene, factor: int, image: Image) -> Scene:
    callback, bounds = scene.callback, Masks(scene.domain, scene.start_mask, scene.background)
    return replace(
        scene,
        image=image,
        factor=factor,
        params=smaller(scene.params, factor),
        starts=tuple(one.affine(np.eye(2) / factor, (_small(0, factor),) * 2) for one in scene.starts),
        **smaller_masks(bounds, (image.shape[0], image.shape[1])).bounds,
        center=None if scene.center is None else _point(scene.center, factor),
        robot=scene.robot / factor,
        callback=callback and (lambda now: callback(replace(now, contours=enlarged(now.contours, factor)))),
    )


def smaller(params: Parameters, factor: float) -> Parameters:
    """The parameters for a copy of a picture of which one pixel stands for `factor` a side: starts, clearance and areas.

    Other lengths are as they are in a picture of that size.
    """
    if factor == 1:
        return params
    contour, region = params.contour, params.region
    few = replace(region, min_area=ceil(region.min_area / factor**2), fill_holes=ceil(region.fill_holes / factor**2))
    contour = replace(contour, clearance=contour.clearance / factor)
    return replace(params, init=_placed(params.init, factor), contour=contour, region=few)


def smaller_masks(masks: Masks, shape: tuple[int, int]) -> Masks:
    """The masks of a picture in its copy of this shape; of the background, pixels of which any part is set."""
    domain, start = (None if one is None else smaller_mask(one, shape) for one in (masks.domain, masks.start))
    return Masks(domain, start, None if masks.background is None else smaller_mask(masks.background, shape, 1))


def smaller_mask(mask: Image, shape: tuple[int, int], least: float = HALF_SET) -> Image:
    """Pixels of which half of a mask of 0 and 255 is set or, if there are none, any part."""
    means = resized(mask, shape)
    least = least if (means >= least).any() else 1
    return np.where(means >= least, np.uint8(255), np.uint8(0))


def _placed(init: Init, factor: float) -> Init:
    return replace(
        init,
        center="auto" if init.center == "auto" else _point(init.center, factor),
        radius="auto" if init.radius == "auto" else init.radius / factor,
        circles=tuple(cast(Circle, scaled_seed(one, factor)) for one in init.circles),
        boxes=tuple((*_point((x0, y0), factor), *_point((x1, y1), factor)) for x0, y0, x1, y1 in init.boxes),
        background=tuple(scaled_seed(one, factor) for one in init.background),
    )


def scaled_seed(seed: Seed, factor: float) -> Seed:
    """A seed or a circle in a picture smaller by this factor."""
    return cast(Seed, (*_point(seed[:2], factor), *(radius / factor for radius in seed[2:3]), *seed[3:]))


def _point(point: tuple[float, float], factor: float) -> tuple[float, float]:
    return _small(point[0], factor), _small(point[1], factor)


def _small(place: float, factor: float) -> float:
    """A coordinate in the original: pixels begin half a pixel before their centres."""
    return (place + 0.5) / factor - 0.5


def _lengths(params: Parameters) -> tuple[object, ...]:
    contour, edges = params.contour, params.edges
    own = (contour.split_threshold, contour.balloon, contour.clearance, contour.settle, params.region.window)
    return (*own, edges.sigma, edges.canny, edges.highlights, params.snake, params.levelset)


DEFAULT_LENGTHS = _lengths(Parameters())
"""Lengths in pixels as they are where nobody has named any: only these may be taken for those of a smaller picture."""
