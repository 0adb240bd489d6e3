"""Peers: other packages' segmenters as methods, for comparison only. Skipped by name when not installed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any, TypeVar

import numpy as np

from ffseg.arrays import Array, Image, Mask
from ffseg.errors import SegmentationError
from ffseg.geometry.freeform import FreeForm
from ffseg.image import opencv_peers
from ffseg.image.edges import EdgeMap
from ffseg.image.raster import rasterize
from ffseg.parameters import Edges, Parameters
from ffseg.peer_parameters import (
    EdgeComponents,
    EdgeOpened,
    FloodFill,
    GrabCut,
    PeerParameters,
    SitkFastMarching,
    SitkGac,
    SkFmm,
    SkimageChanVese,
    SkimageGac,
    SkimageSnake,
    Watershed,
)
from ffseg.plugins import PEERS
from ffseg.scene import Outcome, Scene

S = TypeVar("S")


def geodesic(edges: EdgeMap, seeds: Mask, params: SkimageGac, callback: Callable[[Any], object] | None = None) -> Mask:
    """Region of scikit-image's morphological geodesic contour; `callback` hears of the level set of every iteration."""
    skimage: Any = import_module("skimage.segmentation")
    stopping = 1.0 / np.sqrt(1.0 + params.alpha * edges.magnitude())
    found: Mask = skimage.morphological_geodesic_active_contour(
        stopping,
        params.iterations,
        init_level_set=seeds.astype(np.int8),
        smoothing=params.smoothing,
        threshold=params.threshold,
        balloon=1,
        iter_callback=callback or (lambda _: None),
    ).astype(np.bool_)
    return found


def _levels(image: Image, sigma: float) -> Array:
    grey = image if image.ndim == 2 else image.mean(axis=2).astype(np.uint8)
    return opencv_peers.smooth(grey, sigma) / 255.0


def _skimage_chan_vese(image: Image, seeds: Mask, params: SkimageChanVese) -> Mask:
    skimage: Any = import_module("skimage.segmentation")
    levels = _levels(image, params.sigma)
    phase = skimage.morphological_chan_vese(levels, params.iterations, "checkerboard", smoothing=params.smoothing) > 0
    return opencv_peers.connected(phase if 2 * phase[seeds].sum() >= seeds.sum() else ~phase, seeds)


def _skimage_snake(image: Image, params: SkimageSnake) -> Mask:
    skimage: Any = import_module("skimage.segmentation")
    levels = _levels(image, params.sigma)
    angle = np.arange(params.points) * (2 * np.pi / params.points)
    middle = (np.array(levels.shape) - 1) / 2  # row, column
    ellipse = middle + (middle - _MARGIN) * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    found = skimage.active_contour(
        levels,
        ellipse,
        alpha=params.alpha,
        beta=params.beta,
        gamma=params.gamma,
        w_line=0,
        w_edge=1,
        max_num_iter=params.iterations,
    )
    return rasterize([FreeForm.polygon(found[:, ::-1])], levels.shape)


_MARGIN = 2.0
"""Pixels the start ellipse stays inside the image."""


def _speed(edges: EdgeMap, seeds: Mask, threshold: float) -> Array:
    """F_diff with p = 2, zero on edges, one in the start."""
    speed = np.where(opencv_peers.free_of_edges(edges, threshold), edges.diffusion(2.0), 0.0)
    speed[seeds] = 1.0
    return speed


def _sitk_front(edges: EdgeMap, seeds: Mask, threshold: float) -> Mask:
    sitk: Any = import_module("SimpleITK")  # its stubs are partial

    sitk.ProcessObject.SetGlobalDefaultNumberOfThreads(1)
    rows, columns = np.nonzero(seeds)
    middle = len(rows) // 2
    march = sitk.FastMarchingImageFilter()
    march.SetTrialPoints([(int(columns[middle]), int(rows[middle]), 0)])
    march.SetStoppingValue(_MAX_ARRIVAL)
    times = sitk.GetArrayFromImage(march.Execute(sitk.GetImageFromArray(_speed(edges, seeds, threshold))))
    found: Mask = (times < _MAX_ARRIVAL) | seeds
    return found


_MAX_ARRIVAL = 1e9
"""Arrival time no front reaches: 10^5 pixels at the slowest speed a threshold of 100 leaves."""


def _sitk_gac(edges: EdgeMap, seeds: Mask, params: SitkGac) -> Mask:
    sitk: Any = import_module("SimpleITK")  # its stubs are partial

    front = sitk.GetImageFromArray(_sitk_front(edges, seeds, params.threshold).astype(np.uint8))
    distance = sitk.SignedMaurerDistanceMap(front, insideIsPositive=False, squaredDistance=False)
    stopping = 1.0 / (1.0 + (edges.magnitude() / params.scale) ** 2)
    flow = sitk.GeodesicActiveContourLevelSetImageFilter()
    flow.SetPropagationScaling(params.propagation)
    flow.SetCurvatureScaling(params.curvature)
    flow.SetAdvectionScaling(params.advection)
    flow.SetNumberOfIterations(params.iterations)
    flow.SetMaximumRMSError(_RMS_CHANGE)
    feature = sitk.GetImageFromArray(stopping.astype(np.float32))
    level_set = flow.Execute(sitk.Cast(distance, sitk.sitkFloat32), feature)
    found: Mask = sitk.GetArrayFromImage(level_set) <= 0
    return found


_RMS_CHANGE = 0.001
"""Pixels (root mean square) per iteration below which SimpleITK stops."""


def _skfmm(edges: EdgeMap, seeds: Mask, params: SkFmm) -> Mask:
    package: Any = import_module("skfmm")
    speed = _speed(edges, seeds, params.threshold)
    start = np.ma.MaskedArray(np.where(seeds, -1.0, 1.0), speed == 0)
    times = package.travel_time(start, speed)
    reached: Mask = ~np.ma.getmaskarray(times) | seeds
    return opencv_peers.dilated_by_disc(reached, params.grow)


def _sitk_fast_marching(edges: EdgeMap, seeds: Mask, params: SitkFastMarching) -> Mask:
    return opencv_peers.dilated_by_disc(_sitk_front(edges, seeds, params.threshold), params.grow)


def _method(kind: type[S], find: Callable[[Any, Mask, S], Mask], *, edges: bool = False) -> Callable[[Scene], Outcome]:
    """A peer's function as a method: it takes the image or the edge map, the start's pixels, and its own parameters."""

    def run(scene: Scene) -> Outcome:
        seeds = scene.start_region()
        if not seeds.any():
            raise SegmentationError("the start contour covers no pixel, and a peer needs one; raise init.radius")
        params = scene.options if isinstance(scene.options, kind) else kind()
        return Outcome(mask=find(scene.edges if edges else scene.image, seeds, params))

    return run


cv_floodfill = _method(FloodFill, opencv_peers.floodfill)
cv_edges = _method(EdgeComponents, opencv_peers.edge_components, edges=True)
cv_edges_opened = _method(EdgeOpened, opencv_peers.edge_opened, edges=True)
cv_watershed = _method(Watershed, opencv_peers.watershed)
cv_grabcut = _method(GrabCut, opencv_peers.grabcut)
skimage_gac = _method(SkimageGac, geodesic, edges=True)
skimage_chan_vese = _method(SkimageChanVese, _skimage_chan_vese)
sitk_fast_marching = _method(SitkFastMarching, _sitk_fast_marching, edges=True)
sitk_gac = _method(SitkGac, _sitk_gac, edges=True)
skfmm = _method(SkFmm, _skfmm, edges=True)


def skimage_snake(scene: Scene) -> Outcome:
    """scikit-image's snake, which closes in from an ellipse and takes no start."""
    params = scene.options if isinstance(scene.options, SkimageSnake) else SkimageSnake()
    return Outcome(mask=_skimage_snake(scene.image, params))


def edge_parameters(name: str, edges: Edges, peers: PeerParameters) -> Edges:
    """Edge map a peer is run on: its own sigma, unless all are to share one."""
    sigma = getattr(getattr(peers, name), "sigma", edges.sigma)
    return edges if peers.shared_edges or not PEERS[name].uses_edges else replace(edges, sigma=sigma)


def method_parameters(params: Parameters, name: str, peers: PeerParameters | None = None) -> tuple[Parameters, object]:
    """Parameters and options a method is run with: a peer has its own section, and its own sigma."""
    if name not in PEERS:
        return params, None
    peers = peers or PeerParameters()
    return replace(params, edges=edge_parameters(name, params.edges, peers)), getattr(peers, name)
