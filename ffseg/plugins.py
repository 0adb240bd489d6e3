"""What can be chosen by name: the methods and the edge sources, one row each, and nothing is loaded for them.

A row says where its function lives; `load` brings it. A name of the form ``module:function`` names a function of the
user's own, with the same signature as ours (see docs/extending.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any


@dataclass(frozen=True, slots=True)
class Method:
    """A row of `METHODS`.

    Attributes
    ----------
    home : str
        ``module:function``; the function is ``run(view) -> outcome`` (`ffseg.View`, `ffseg.Outcome`).
    package : str
        What to install for it; empty for ffseg's own methods.
    module : str
        What that package is imported as.
    uses_edges : bool
        False: the edge map is made all the same, but its time is not counted.
    """

    home: str
    package: str = ""
    module: str = ""
    uses_edges: bool = True

    @property
    def installed(self) -> bool:
        """Whether its package can be imported."""
        return not self.module or find_spec(self.module.partition(".")[0]) is not None


def _peer(name: str, package: str, module: str, *, uses_edges: bool = True) -> Method:
    return Method(f"ffseg.methods.peers:{name}", package, module, uses_edges)


SEGMENTERS: dict[str, Method] = {
    "freeform": Method("ffseg.methods.freeform:run"),
    "levelset": Method("ffseg.methods.levelset:run"),
    "paper": Method("ffseg.methods.paper:run"),
    "snake": Method("ffseg.methods.snake:run"),
}
"""ffseg's own methods by the name they have in ``method`` and ``--methods``."""

PEERS: dict[str, Method] = {
    "cv_floodfill": _peer("cv_floodfill", "opencv-python", "cv2", uses_edges=False),
    "cv_edges": _peer("cv_edges", "opencv-python", "cv2"),
    "cv_edges_opened": _peer("cv_edges_opened", "opencv-python", "cv2"),
    "cv_watershed": _peer("cv_watershed", "opencv-python", "cv2", uses_edges=False),
    "cv_grabcut": _peer("cv_grabcut", "opencv-python", "cv2", uses_edges=False),
    "skimage_gac": _peer("skimage_gac", "scikit-image", "skimage.segmentation"),
    "skimage_chan_vese": _peer("skimage_chan_vese", "scikit-image", "skimage.segmentation", uses_edges=False),
    "skimage_snake": _peer("skimage_snake", "scikit-image", "skimage.segmentation", uses_edges=False),
    "sitk_fast_marching": _peer("sitk_fast_marching", "SimpleITK", "SimpleITK"),
    "sitk_gac": _peer("sitk_gac", "SimpleITK", "SimpleITK"),
    "skfmm": _peer("skfmm", "scikit-fmm", "skfmm"),
}
"""Other packages' methods, for comparison."""

METHODS: dict[str, Method] = {**SEGMENTERS, **PEERS}
"""Every method by its name."""

EDGE_SOURCES: dict[str, str] = {
    "auto": "ffseg.image.edges:gradient_edges",
    "gradient": "ffseg.image.edges:gradient_edges",
    "prior": "ffseg.evidence.prior:prior_edges",
    "model": "ffseg.evidence.source:model_edges",
    "evidence": "ffseg.evidence.source:map_edges",
}
"""Edge sources by the name they have in ``edges.source``: ``source(scene) -> EdgeMap`` (`ffseg.image.edges.Scene`)."""


def load(home: str) -> Any:  # noqa: ANN401 - the caller knows the signature
    """Bring the function that ``module:function`` names.

    Raises
    ------
    ValueError
        If there is no such module or function.
    """
    module, _, name = home.partition(":")
    try:
        found = getattr(import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise ValueError(f"{home!r} cannot be loaded: {error}") from error
    return found
