"""What can be chosen by name: the methods and the evidence sources, one row each, and nothing is loaded for them.

A row says where its function lives; `load` brings it. A name of the form ``module:function`` names a function of the
user's own, with the same signature as ours (see docs/extending.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from ffseg.errors import ParameterError, SegmentationError


@dataclass(frozen=True, slots=True)
class Method:
    """A row of `METHODS`.

    Attributes
    ----------
    home : str
        ``module:function``; the function is ``run(scene) -> outcome`` (`ffseg.Scene`, `ffseg.Outcome`).
    name : str
        What it is called in ``method`` and ``--methods``.
    package : str
        What to install for it; empty for ffseg's own methods.
    module : str
        What that package is imported as.
    uses_edges : bool
        False: the edge map is made all the same, but its time is not counted.
    merges : bool
        It takes several starts, and what grows from them merges.
    source : str
        What ``edges.source: auto`` stands for, where the method is not to see what was learned.
    slits : bool
        Its contour crosses open ground, so that a part of it lies on no edge though nothing leaks.
    altitudes : bool
        It tells marks on the ground from obstacles itself, by interest points of a pair (Eq. 11).
    function : callable, optional
        The function itself, where it was given as one.
    """

    home: str
    name: str = ""
    package: str = ""
    module: str = ""
    uses_edges: bool = True
    merges: bool = False
    source: str = ""
    slits: bool = False
    altitudes: bool = False
    function: Callable[..., Any] | None = None

    @property
    def installed(self) -> bool:
        """Whether its package can be imported."""
        return not self.module or find_spec(self.module.partition(".")[0]) is not None

    def run(self, scene: object) -> Any:  # noqa: ANN401 - an Outcome, of a floor above
        """What the method finds in a scene.

        Raises
        ------
        ParameterError
            If there is no such function.
        SegmentationError
            If its package is not installed.
        """
        return self.loaded()(scene)

    def loaded(self) -> Callable[..., Any]:
        """The function, brought with its package: its loading is not its time.

        Raises
        ------
        ParameterError
            If there is no such function.
        SegmentationError
            If its package is not installed.
        """
        if self.function is not None:
            return self.function
        if not self.installed:
            raise SegmentationError(f"method {self.name} needs the package {self.package}; install it, or ffseg[peers]")
        try:
            if self.module:
                load(f"{self.module}:__name__")
            found: Callable[..., Any] = load(self.home)
        except ValueError as error:
            raise ParameterError(f"method: {error}") from error
        if not callable(found):
            raise ParameterError(f"method: {self.home} is no function; name one that takes a scene")
        return found


def _peer(name: str, package: str, module: str, *, uses_edges: bool = True) -> Method:
    return Method(f"ffseg.methods.peers:{name}", name, package, module, uses_edges, source="gradient")


SEGMENTERS: dict[str, Method] = {
    "freeform": Method("ffseg.methods.freeform:run", "freeform", merges=True),
    "levelset": Method("ffseg.methods.levelset:run", "levelset", merges=True),
    "paper": Method("ffseg.methods.paper:run", "paper", source="gradient"),
    "snake": Method("ffseg.methods.snake:run", "snake", slits=True, altitudes=True),
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
    "auto": "ffseg.evidence.auto:auto",
    "gradient": "ffseg.evidence.gradient:gradient",
    "prior": "ffseg.evidence.prior:prior_edges",
    "model": "ffseg.evidence.source:model_edges",
    "evidence": "ffseg.evidence.source:map_edges",
}
"""Evidence sources by the name they have in ``edges.source``: ``source(scene) -> EdgeMap`` (`ffseg.Scene`)."""


def method(name: str | Callable[..., Any]) -> Method:
    """The row of a method's name, of ``module:function``, or of a function.

    Raises
    ------
    ParameterError
        If there is no method of that name.
    """
    if not isinstance(name, str):
        return Method("", getattr(name, "__name__", "function"), function=name)
    if name not in METHODS and ":" not in name:
        raise ParameterError(f"method: there is no segmenter '{name}'; choose one of {', '.join(METHODS)}")
    return METHODS.get(name) or Method(name, name)


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
