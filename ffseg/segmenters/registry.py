"""Segmenters by name, and the one function that runs any of them."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ffseg.errors import ParameterError, SegmentationError
from ffseg.image.edges import EdgeMap, edge_map
from ffseg.image.raster import rasterize
from ffseg.parameters import Parameters
from ffseg.segmenters.base import Progress, Segmentation, Segmenter, Timings
from ffseg.segmenters.starts import start_contours

SEGMENTERS = {name: f"ffseg.segmenters.{name}" for name in ("freeform", "levelset", "snake")}
"""Modules by the name of the segmenter, whose function ``run`` it is; loaded when asked for, as a run has one."""


def segmenter(name: str) -> Segmenter:
    """The segmenter of that name.

    Raises
    ------
    ParameterError
        If there is none.
    """
    if name not in SEGMENTERS:
        from ffseg.segmenters.peers import PEERS

        known = ", ".join([*sorted(SEGMENTERS), *PEERS])
        raise ParameterError(f"method: there is no segmenter '{name}'; choose one of {known}")
    found: Segmenter = import_module(SEGMENTERS[name]).run
    return found


def segment(
    image: NDArray[np.uint8],
    params: Parameters,
    method: str | Segmenter | None = None,
    *,
    domain: NDArray[np.uint8] | None = None,
    start_mask: NDArray[np.uint8] | None = None,
    center: tuple[float, float] | None = None,
    callback: Callable[[Progress], None] | None = None,
) -> Segmentation:
    """Segment one image: edge map, start contours, evolution, mask.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey or BGR.
    params : Parameters
    method : str or Segmenter, optional
        Takes the place of ``params.method``: a name, or what evolves the contours itself. A peer runs with the parameters
        of ``configs/peers.yaml``.
    domain : ndarray of uint8, shape (H, W), optional
        Nonzero where the contour may go.
    start_mask : ndarray of uint8, shape (H, W), optional
        Nonzero inside the start regions.
    center : tuple of float, optional
        What ``init.center: auto`` stands for; without it the image centre.
    callback : callable, optional
        Called with snapshots of the evolution.

    Returns
    -------
    Segmentation

    Raises
    ------
    SegmentationError
        If the image cannot be segmented as asked.
    ParameterError
        If there is no such method.
    """
    name = method or params.method
    shape = _checked_shape(image, domain)
    if isinstance(name, str) and name not in SEGMENTERS:
        from ffseg.peer_parameters import PeerParameters
        from ffseg.segmenters.peers import PEERS, segment_peer

        if name in PEERS:
            peers = PeerParameters()
            return segment_peer(image, params, name, peers, domain=domain, start_mask=start_mask, center=center)
    run = segmenter(name) if isinstance(name, str) else name
    begin = perf_counter()
    edges = edge_map(image, params.edges, domain)
    edges_done = perf_counter()
    starts = start_contours(shape, params, start_mask, center)
    contours, stats = run(edges, starts, params, callback)
    evolved = perf_counter()
    mask = rasterize(contours, shape)
    end = perf_counter()
    timings = Timings((edges_done - begin) * 1e3, (evolved - edges_done) * 1e3, (end - begin) * 1e3)
    return Segmentation(mask, contours, stats, timings)


def _checked_shape(image: NDArray[np.uint8], domain: NDArray[np.uint8] | None) -> tuple[int, int]:
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or image.size == 0:
        raise SegmentationError(f"the image must be uint8 (H, W) or (H, W, 3), not {image.dtype} {image.shape}")
    shape = (image.shape[0], image.shape[1])
    if domain is not None and domain.shape != shape:
        raise SegmentationError(
            f"the domain has {domain.shape[1]} x {domain.shape[0]} pixels, the image {shape[1]} x {shape[0]}; "
            "domain.mask must have the image's size"
        )
    return shape


__all__ = ["SEGMENTERS", "EdgeMap", "segment", "segmenter"]
