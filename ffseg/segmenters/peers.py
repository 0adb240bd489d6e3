"""Peers: other packages' segmenters behind one signature, for comparison only. Skipped by name when not installed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.util import find_spec
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.errors import SegmentationError
from ffseg.geometry.freeform import FreeForm
from ffseg.image import opencv_peers
from ffseg.image.edges import EdgeMap, edge_map
from ffseg.image.raster import rasterize
from ffseg.native import _core
from ffseg.parameters import Edges, Parameters
from ffseg.peer_parameters import (
    PeerParameters,
    SitkFastMarching,
    SitkGac,
    SkFmm,
    SkimageChanVese,
    SkimageGac,
    SkimageSnake,
)
from ffseg.segmenters.base import Segmentation, Stats, Timings
from ffseg.segmenters.starts import start_contours

Mask = NDArray[np.bool_]
Image = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Peer:
    """How a peer is called.

    Attributes
    ----------
    run : callable
        ``run(image, edges, seeds, section) -> mask``; `seeds` is the start region.
    package : str
        What to install.
    module : str
        What to import.
    uses_edges : bool
        False: it is given the edge map all the same, but its time is not counted.
    """

    run: Callable[[Image, EdgeMap, Mask, Any], Mask]
    package: str
    module: str
    uses_edges: bool = True

    @property
    def installed(self) -> bool:
        """Whether the package can be imported."""
        return find_spec(self.module.partition(".")[0]) is not None


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


def _skimage_chan_vese(image: Image, edges: EdgeMap, seeds: Mask, params: SkimageChanVese) -> Mask:  # noqa: ARG001
    skimage: Any = import_module("skimage.segmentation")
    grey = image if image.ndim == 2 else image.mean(axis=2).astype(np.uint8)
    levels = opencv_peers.smooth(grey, params.sigma) / 255.0
    phase = skimage.morphological_chan_vese(levels, params.iterations, "checkerboard", smoothing=params.smoothing) > 0
    return opencv_peers.connected(phase if 2 * phase[seeds].sum() >= seeds.sum() else ~phase, seeds)


def _skimage_snake(image: Image, edges: EdgeMap, seeds: Mask, params: SkimageSnake) -> Mask:  # noqa: ARG001
    skimage: Any = import_module("skimage.segmentation")
    grey = image if image.ndim == 2 else image.mean(axis=2).astype(np.uint8)
    levels = opencv_peers.smooth(grey, params.sigma) / 255.0
    angle = np.arange(params.points) * (2 * np.pi / params.points)
    middle = (np.array(grey.shape) - 1) / 2  # row, column
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
    return rasterize([FreeForm.polygon(found[:, ::-1])], grey.shape)


_MARGIN = 2.0
"""Pixels the start ellipse stays inside the image."""


def _speed(edges: EdgeMap, seeds: Mask, threshold: float) -> NDArray[np.float64]:
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
    march.SetStoppingValue(_NEVER)
    times = sitk.GetArrayFromImage(march.Execute(sitk.GetImageFromArray(_speed(edges, seeds, threshold))))
    found: Mask = (times < _NEVER) | seeds
    return found


_NEVER = 1e9
"""Arrival time no front reaches: 10^5 pixels at the slowest speed a threshold of 100 leaves."""


def _sitk_fast_marching(image: Image, edges: EdgeMap, seeds: Mask, params: SitkFastMarching) -> Mask:  # noqa: ARG001
    return opencv_peers.grown(_sitk_front(edges, seeds, params.threshold), params.grow)


def _sitk_gac(image: Image, edges: EdgeMap, seeds: Mask, params: SitkGac) -> Mask:  # noqa: ARG001
    sitk: Any = import_module("SimpleITK")  # its stubs are partial

    front = sitk.GetImageFromArray(_sitk_front(edges, seeds, params.threshold).astype(np.uint8))
    distance = sitk.SignedMaurerDistanceMap(front, insideIsPositive=False, squaredDistance=False)
    stopping = 1.0 / (1.0 + (edges.magnitude() / params.scale) ** 2)
    flow = sitk.GeodesicActiveContourLevelSetImageFilter()
    flow.SetPropagationScaling(params.propagation)
    flow.SetCurvatureScaling(params.curvature)
    flow.SetAdvectionScaling(params.advection)
    flow.SetNumberOfIterations(params.iterations)
    flow.SetMaximumRMSError(_STEADY)
    feature = sitk.GetImageFromArray(stopping.astype(np.float32))
    level_set = flow.Execute(sitk.Cast(distance, sitk.sitkFloat32), feature)
    found: Mask = sitk.GetArrayFromImage(level_set) <= 0
    return found


_STEADY = 0.001
"""Pixels (root mean square) per iteration below which SimpleITK stops."""


def _skfmm(image: Image, edges: EdgeMap, seeds: Mask, params: SkFmm) -> Mask:  # noqa: ARG001
    skfmm: Any = import_module("skfmm")
    speed = _speed(edges, seeds, params.threshold)
    start = np.ma.MaskedArray(np.where(seeds, -1.0, 1.0), speed == 0)
    times = skfmm.travel_time(start, speed)
    reached: Mask = ~np.ma.getmaskarray(times) | seeds
    return opencv_peers.grown(reached, params.grow)


PEERS: dict[str, Peer] = {
    "cv_floodfill": Peer(
        lambda image, _edges, seeds, p: opencv_peers.floodfill(image, seeds, p), "opencv-python", "cv2", False
    ),
    "cv_edges": Peer(
        lambda _image, edges, seeds, p: opencv_peers.edge_components(edges, seeds, p), "opencv-python", "cv2"
    ),
    "cv_edges_opened": Peer(
        lambda _image, edges, seeds, p: opencv_peers.edge_opened(edges, seeds, p), "opencv-python", "cv2"
    ),
    "cv_watershed": Peer(
        lambda image, _edges, seeds, p: opencv_peers.watershed(image, seeds, p), "opencv-python", "cv2", False
    ),
    "cv_grabcut": Peer(
        lambda image, _edges, seeds, p: opencv_peers.grabcut(image, seeds, p), "opencv-python", "cv2", False
    ),
    "skimage_gac": Peer(
        lambda _image, edges, seeds, p: geodesic(edges, seeds, p), "scikit-image", "skimage.segmentation"
    ),
    "skimage_chan_vese": Peer(_skimage_chan_vese, "scikit-image", "skimage.segmentation", False),
    "skimage_snake": Peer(_skimage_snake, "scikit-image", "skimage.segmentation", False),
    "sitk_fast_marching": Peer(_sitk_fast_marching, "SimpleITK", "SimpleITK"),
    "sitk_gac": Peer(_sitk_gac, "SimpleITK", "SimpleITK"),
    "skfmm": Peer(_skfmm, "scikit-fmm", "skfmm"),
}
"""Every peer by the name it has in ``--methods``, in ``method`` and in ``configs/peers.yaml``."""


def segment_peer(
    image: Image,
    params: Parameters,
    name: str,
    peers: PeerParameters,
    *,
    domain: NDArray[np.uint8] | None = None,
    start_mask: NDArray[np.uint8] | None = None,
    center: tuple[float, float] | None = None,
) -> Segmentation:
    """Segment one image with a peer; arguments and result as in `ffseg.segment`.

    Returns
    -------
    Segmentation
        The contours are polygons half-way between pixels inside and outside, which rasterise to the peer's mask; the
        counts are zero, as peers do not tell. Tracing the contours is not counted in the times.

    Raises
    ------
    SegmentationError
        If the peer's package is not installed, or the start covers no pixel.
    """
    peer = PEERS[name]
    if not peer.installed:
        raise SegmentationError(f"method {name} needs the package {peer.package}; install it, or ffseg[peers]")
    starts = start_contours(image.shape[:2], params, start_mask, center)
    seeds = rasterize(starts, image.shape[:2])
    if not seeds.any():
        raise SegmentationError(f"the start contour covers no pixel, and {name} needs one; raise init.radius")
    import_module(peer.module)  # its loading is not its time
    begin = perf_counter()
    edges = edge_map(image, edge_parameters(name, params.edges, peers), domain)
    edges_done = perf_counter()
    mask = peer.run(image, edges, seeds, getattr(peers, name))
    evolve_ms = (perf_counter() - edges_done) * 1e3
    edges_ms = (edges_done - begin) * 1e3 if peer.uses_edges else 0.0
    if domain is not None:
        mask = mask & (domain > 0)
    return Segmentation(mask, outlines_of(mask), _NO_COUNTS, Timings(edges_ms, evolve_ms, edges_ms + evolve_ms))


def outlines_of(mask: Mask) -> tuple[FreeForm, ...]:
    """Contours of degree 1 half-way between pixels inside and outside; they rasterise to the mask exactly."""
    points, ends = _core.mask_outlines(np.ascontiguousarray(mask).view(np.uint8))
    vertices = points.reshape(-1, 2)
    return tuple(FreeForm(vertices[a:b], 1) for a, b in pairwise(ends))


def edge_parameters(name: str, edges: Edges, peers: PeerParameters) -> Edges:
    """Edge map a peer is run on: its own sigma, unless all are to share one."""
    sigma = getattr(getattr(peers, name), "sigma", edges.sigma)
    return edges if peers.shared_edges or not PEERS[name].uses_edges else replace(edges, sigma=sigma)


_NO_COUNTS = Stats(0, 0, 0, 0, 0, 0, 0, 0, "converged")
