"""``ffseg.segment``: accepts common Python inputs, and explains in one sentence what is wrong with others."""

from __future__ import annotations

import reprlib
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg import pipeline, plugins
from ffseg.errors import ParameterError, SegmentationError
from ffseg.image.checked import Pixels, refuse_masked, taken_image
from ffseg.image.edges import EdgeMap, require_edges
from ffseg.io.masks import load_mask
from ffseg.parameter_files import ParametersLike, parameter_set
from ffseg.parameters import MAX_COORDINATE
from ffseg.result import Segmentation
from ffseg.scene import NO_EDGES, Progress, Scene, Segmenter

MAX_INTEREST_RADIUS = 10_000
"""Pixels: the largest radius round a matched interest point."""


def segment(  # noqa: PLR0913 - everything that is particular to one image has its name here
    image: Pixels,
    params: ParametersLike = None,
    method: str | Segmenter | None = None,
    *,
    edges: EdgeMap | None = None,
    domain: NDArray[np.uint8] | None = None,
    start_mask: NDArray[np.uint8] | None = None,
    background: NDArray[np.uint8] | None = None,
    evidence: NDArray[np.float32] | None = None,
    center: tuple[float, float] | None = None,
    altitudes: NDArray[np.float64] | None = None,
    options: object = None,
    rgb: bool = False,
    callback: Callable[[Progress], None] | None = None,
) -> Segmentation:
    """Segment one image: edge map, start contours, evolution, mask.

    Parameters
    ----------
    image : ndarray of uint8, uint16 or float, shape (H, W) or (H, W, 3)
        Grey or BGR. 16 bits are taken by their full range, floats from 0 to 1; ``input.range`` sets others.
    params : Parameters, str, path or mapping, optional
        A parameter set, the name of a preset, a parameter file, or values by dotted key such as
        ``{"contour.degree": 2}``; without it the defaults.
    method : str or Segmenter, optional
        Takes the place of ``params.method``: a name, or a function ``run(scene) -> outcome``. A peer runs with the
        parameters of ``configs/peers.yaml`` and its own sigma.
    edges : EdgeMap, optional
        Takes the place of the edge source that ``edges.source`` names.
    domain : ndarray of uint8 or bool, shape (H, W), optional
        Nonzero where the contour may go; without it the file ``domain.mask`` names, else everywhere.
    start_mask : ndarray of uint8 or bool, shape (H, W), optional
        Nonzero inside the start regions; without it the file ``init.mask`` names. What it has in the domain counts.
    background : ndarray of uint8 or bool, shape (H, W), optional
        Nonzero at what lies outside the region; without it the file ``init.background_mask`` names.
    evidence : ndarray of float32, shape (H, W), optional
        From 0 to 1: probability of inside, or edge strength, as ``edges.evidence`` says.
    center : tuple of float, optional
        What ``init.center: auto`` stands for, (x, y) in pixels; without it the image centre.
    altitudes : ndarray of float64, shape (K, 4), optional
        Interest points of a camera pair for the snake's altitude term (Eq. 11).
    options : object, optional
        The method's own section of parameters, where it has one outside `params`; what a peer needs is then all in
        `params` and `options`.
    rgb : bool
        The image's channels are red, green, blue, as Pillow, imageio and scikit-image read them.
    callback : callable, optional
        Called with snapshots of the evolution.

    Returns
    -------
    Segmentation

    Raises
    ------
    SegmentationError
        If the image is none, or cannot be segmented as asked.
    ParameterError
        If a parameter is wrong, or there is no such method.

    References
    ----------
    Algorithms 4 and 5 of the paper; the departures stand in docs/method.md.

    Examples
    --------
    >>> image = ffseg.read_image("pictures/toy.png")
    >>> result = ffseg.segment(image, {"init.radius": 60, "contour.degree": 2})
    >>> result.mask.shape, result.num_holes, result.stats.stop_reason
    ((600, 800), 4, 'converged')
    """
    chosen = parameter_set(params)
    pixels = taken_image(image, rgb, chosen.input.range)
    _check_method(method, callback)
    _check_extras(pixels, edges, center, altitudes)
    if domain is None and chosen.domain.masks is not None:
        raise ParameterError("domain.masks finds masks by the names of files; give the one of this image: domain=mask")
    if edges is None and chosen.edges.model is not None:
        from ffseg.evidence.source import check_model  # loads what only models need

        check_model(chosen.edges.model, chosen.network)
    return pipeline.segment(
        Scene(
            pixels,
            chosen,
            plugins.method(chosen.method if method is None else method),
            edges=NO_EDGES if edges is None else edges,
            edges_given=edges is not None,
            domain=_mask("domain", domain, "domain.mask", chosen.domain.mask),
            start_mask=_mask("start_mask", start_mask, "init.mask", chosen.init.mask),
            background=_mask("background", background, "init.background_mask", chosen.init.background_mask),
            evidence=_evidence(evidence),
            center=None if center is None else (float(center[0]), float(center[1])),
            options=options,
            altitudes=np.empty((0, 4)) if altitudes is None else np.asarray(altitudes, np.float64),
            callback=callback,
        )
    )


def _check_method(method: object, callback: object) -> None:
    if method is not None and not (callable(method) or (isinstance(method, str) and method)):
        raise ParameterError(
            f"method is {method!r}; give a name such as 'freeform', or a function run(scene) -> outcome"
        )
    if callback is not None and not callable(callback):
        raise SegmentationError(f"callback is of type {type(callback).__name__}; give a function that takes a Progress")


def _check_extras(image: NDArray[np.uint8], edges: object, center: object, altitudes: object) -> None:
    """Refuse an edge map of another image, a centre that is no point, interest points that are none."""
    if edges is not None and not isinstance(edges, EdgeMap):
        raise SegmentationError(f"edges is of type {type(edges).__name__}; give an EdgeMap, as of ffseg.edge_map")
    if isinstance(edges, EdgeMap):
        require_edges(edges, image.shape)
    if center is not None and not (_numbers(center).shape == (2,) and np.isfinite(_numbers(center)).all()):
        raise SegmentationError(f"center is {reprlib.repr(center)}; give (x, y) in pixels")
    if altitudes is None:
        return
    rows = _numbers(altitudes)
    if rows.ndim != 2 or rows.shape[1] != 4:
        raise SegmentationError("altitudes must be an array of shape (K, 4): x, y, altitude in metres, radius")
    places, radii = rows[:, :2], rows[:, 3]
    if not (
        np.isfinite(rows).all()
        and (np.abs(places) <= MAX_COORDINATE).all()
        and ((radii >= 0) & (radii <= MAX_INTEREST_RADIUS)).all()
    ):
        raise SegmentationError(
            f"altitudes must be finite, with x and y from -{MAX_COORDINATE} to {MAX_COORDINATE} "
            f"and radii from 0 to {MAX_INTEREST_RADIUS} pixels"
        )


def _numbers(values: Any) -> NDArray[np.float64]:  # noqa: ANN401 - whatever somebody gives
    """What can be an array of numbers as one; a single number, which is none, otherwise."""
    try:
        return np.asarray(values, np.float64)
    except (TypeError, ValueError, OverflowError):
        return np.asarray(np.nan)


def _evidence(values: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
    if values is None:
        return None
    refuse_masked("evidence", values)
    array = np.asarray(values)
    if array.ndim == 2 and array.dtype.kind in "biuf":
        found = np.ascontiguousarray(array, np.float32)
        if ((found >= 0) & (found <= 1)).all():
            return found
    raise SegmentationError("evidence must be an array of shape (H, W) with values from 0 to 1")


def _mask(
    name: str, mask: NDArray[np.uint8] | NDArray[np.bool_] | None, key: str, path: str | None
) -> NDArray[np.uint8] | None:
    """A mask as 0 and 255: the one given, else that of the file the parameters name."""
    if mask is None:
        return load_mask(key, path)
    refuse_masked(name, mask)
    if not isinstance(mask, np.ndarray) or mask.ndim != 2 or mask.dtype.kind not in "bu":
        raise SegmentationError(f"{name} must be an array of bool or uint8, shape (H, W), nonzero inside")
    return np.where(mask > 0, np.uint8(255), np.uint8(0))
