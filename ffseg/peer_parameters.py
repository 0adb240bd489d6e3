"""Parameters of the peers `ffseg compare` runs; ``configs/peers.yaml`` is written from these defaults."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from ffseg.errors import ParameterError
from ffseg.schema import strict_yaml
from ffseg.schema.kinds import Flag, Integer, Number
from ffseg.schema.nodes import Problems
from ffseg.schema.sections import Section, build, collect, declared, subsection

_SIGMA = Number(0, 20, above=True)
_SIGMA_DOC = "px, smoothing of its edge map"
_THRESHOLD = Number(0, 1000, above=True)
_THRESHOLD_DOC = "grey levels per pixel from which on a pixel is an edge"


@dataclass(frozen=True, slots=True)
class FloodFill(Section):
    """OpenCV floodFill on the smoothed image, fixed range round the median of the start."""

    sigma: float = declared(0.8, _SIGMA, "px, smoothing of the image")
    tolerance: int = declared(50, Integer(0, 255), "grey levels, every channel")


@dataclass(frozen=True, slots=True)
class EdgeComponents(Section):
    """Edge threshold and OpenCV connectedComponents."""

    sigma: float = declared(0.8, _SIGMA, _SIGMA_DOC)
    threshold: float = declared(8.0, _THRESHOLD, _THRESHOLD_DOC)
    grow: float = declared(2.5, Number(0, 100), "px the region is grown by at the end: it stops before the edge")


@dataclass(frozen=True, slots=True)
class EdgeOpened(EdgeComponents):
    """The same, opened against gaps by a disc."""

    radius: float = declared(3.0, Number(0, 1000), "px; passages narrower than twice this are closed")


@dataclass(frozen=True, slots=True)
class Watershed(Section):
    """OpenCV watershed from the start and the image border; its heights are the differences between pixels."""

    sigma: float = declared(0.8, _SIGMA, "px, smoothing of the image")


@dataclass(frozen=True, slots=True)
class GrabCut(Section):
    """OpenCV grabCut; the start is sure, the border excluded, what is near the start probably inside, the rest outside."""

    iterations: int = declared(5, Integer(1, 100), "iterations")
    probable: float = declared(4.0, Number(1, 1000), "radii of the start within which a pixel is probably inside")


@dataclass(frozen=True, slots=True)
class SkimageGac(Section):
    """scikit-image morphological_geodesic_active_contour."""

    sigma: float = declared(1.5, _SIGMA, _SIGMA_DOC)
    alpha: float = declared(1.0, Number(0, 1e6, above=True), "stopping function 1 / sqrt(1 + alpha |grad|)")
    threshold: float = declared(0.35, Number(0, 1), "stopping function below which the balloon rests")
    smoothing: int = declared(1, Integer(0, 10), "smoothing steps per iteration")
    iterations: int = declared(420, Integer(1, 100_000), "iterations, one pixel each")


@dataclass(frozen=True, slots=True)
class SkimageChanVese(Section):
    """scikit-image morphological_chan_vese from a checkerboard; the phase and part that hold the start."""

    sigma: float = declared(1.0, _SIGMA, "px, smoothing of the image")
    smoothing: int = declared(1, Integer(0, 10), "smoothing steps per iteration")
    iterations: int = declared(40, Integer(1, 100_000), "iterations")


@dataclass(frozen=True, slots=True)
class SkimageSnake(Section):
    """scikit-image active_contour, closing in from an ellipse in the image: it has no balloon to grow with."""

    sigma: float = declared(3.0, _SIGMA, "px, smoothing of the image")
    points: int = declared(400, Integer(5, 2000), "points; it solves a dense system of them")
    alpha: float = declared(0.01, Number(0, 1000), "weight of the length")
    beta: float = declared(0.1, Number(0, 1000), "weight of the smoothness")
    gamma: float = declared(0.001, Number(0, 1000, above=True), "time step")
    iterations: int = declared(2500, Integer(1, 1_000_000), "most iterations")


@dataclass(frozen=True, slots=True)
class SitkFastMarching(EdgeComponents):
    """SimpleITK FastMarching with speed F_diff, zero on edges."""


@dataclass(frozen=True, slots=True)
class SitkGac(Section):
    """SimpleITK GeodesicActiveContour started where its fast marching stopped."""

    sigma: float = declared(0.8, _SIGMA, _SIGMA_DOC)
    threshold: float = declared(8.0, _THRESHOLD, _THRESHOLD_DOC)
    scale: float = declared(2.0, Number(1e-6, 1000), "gradient at which the stopping function is one half")
    propagation: float = declared(0.3, Number(0, 1000), "weight of the balloon")
    curvature: float = declared(0.1, Number(0, 1000), "weight of the smoothness")
    advection: float = declared(3.0, Number(0, 1000), "weight of the pull to edges")
    iterations: int = declared(150, Integer(1, 100_000), "most iterations")


@dataclass(frozen=True, slots=True)
class SkFmm(EdgeComponents):
    """scikit-fmm travel_time with speed F_diff, edges masked."""


@dataclass(frozen=True, slots=True)
class PeerParameters(Section):
    """Parameters of every peer, by its name."""

    shared_edges: bool = declared(False, Flag(), "all use the edge map of the method under test, whatever their sigma")
    cv_floodfill: FloodFill = subsection(FloodFill)
    cv_edges: EdgeComponents = subsection(EdgeComponents)
    cv_edges_opened: EdgeOpened = subsection(EdgeOpened)
    cv_watershed: Watershed = subsection(Watershed)
    cv_grabcut: GrabCut = subsection(GrabCut)
    skimage_gac: SkimageGac = subsection(SkimageGac)
    skimage_chan_vese: SkimageChanVese = subsection(SkimageChanVese)
    skimage_snake: SkimageSnake = subsection(SkimageSnake)
    sitk_fast_marching: SitkFastMarching = subsection(SitkFastMarching)
    sitk_gac: SitkGac = subsection(SitkGac)
    skfmm: SkFmm = subsection(SkFmm)


def load_peer_parameters(path: str | os.PathLike[str] | None = None) -> PeerParameters:
    """Read a file like ``configs/peers.yaml``; None gives that file's values, which are the defaults.

    Raises
    ------
    ParameterError
        One line for everything that is wrong.
    """
    if path is None:
        return PeerParameters()
    problems = Problems()
    found = strict_yaml.read(os.fspath(Path(path)), problems)
    values = collect(PeerParameters, found, problems, "; configs/peers.yaml lists every key")
    problems.raise_as(ParameterError)
    return build(PeerParameters, values)
