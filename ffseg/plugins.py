"""The table of everything chosen by name: methods, evidence sources, outputs and executors; importing none of them.

A name is that of a row here, that of an installed plug-in (an entry point of the group ``ffseg.methods``,
``ffseg.evidence``, ``ffseg.outputs`` or ``ffseg.executors``), or ``module:function``: a function of the user's own, with
the same signature as ours (see docs/extending.md).
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from operator import attrgetter
from traceback import walk_tb
from typing import Any

from ffseg.errors import ParameterError, SegmentationError, UsageError
from ffseg.schema.kinds import nearest_word


def require(module: str, what: str, extra: str) -> None:
    """Refuse what needs a package that is not installed, and say which of ffseg's extras brings it.

    Raises
    ------
    UsageError
        If the module cannot be imported.
    """
    if find_spec(module) is None:
        raise UsageError(f"{what}; install it with: pip install 'ffseg[{extra}]'")


def require_lightgbm() -> None:
    """Refuse to grow a forest where there is nothing that does.

    Raises
    ------
    UsageError
        If LightGBM is not installed.
    """
    require("lightgbm", "learning, and finding all that look alike, need LightGBM", "learn")


def check_source(source: str, model: str | None, *, alike: bool = False) -> None:
    """Refuse the evidence source of a command that gives it no map and no model where it needs them.

    Parameters
    ----------
    alike : bool
        Whether without either all things alike are asked for.

    Raises
    ------
    ParameterError
        Saying what it needs.
    UsageError
        If LightGBM is needed, and not installed.
    """
    if source == "alike" or (alike and source == "auto" and model is None):
        require_lightgbm()
    if source == "model" and model is None:
        raise ParameterError("edges.source: model needs a model; set edges.model to a file")
    if source == "evidence" and model is None:
        raise ParameterError(
            "edges.source: evidence needs a map of each image; name them with --evidence of run, compare or segment"
        )


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

    Examples
    --------
    >>> from ffseg.plugins import METHODS
    >>> METHODS["snake"].home, METHODS["snake"].altitudes
    ('ffseg.methods.snake:run', True)
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
    "prior": "ffseg.evidence.auto:prior_edges",
    "model": "ffseg.evidence.source:model_edges",
    "evidence": "ffseg.evidence.source:map_edges",
    "hints": "ffseg.evidence.clicks:hint_edges",
    "alike": "ffseg.evidence.alike:alike_edges",
    "box": "ffseg.evidence.box:box_edges",
}
"""Evidence sources by the name they have in ``edges.source``: ``source(scene) -> EdgeMap`` (`ffseg.Scene`)."""


EXPORTS: dict[str, str] = {
    name: f"ffseg.batch.outputs.table:{name.upper()}"
    for name in ("coco", "labelme", "geojson", "yolo", "svg", "cutout")
}
"""Outputs by the name they have in ``--export``: an `ffseg.batch.outputs.table.Output`, or a function as it names one."""

EXECUTORS: dict[str, str] = {
    "processes": "ffseg.batch.executors.processes:Processes",
    "inprocess": "builtins:map",
    "dask": "ffseg.batch.executors.dask:Dask",
}
"""Executors by the name they have in ``--executor``: ``executor(do, tasks)`` gives ``do(task)`` for each task in any order;
the classes among ours are asked in turns instead (`ffseg.batch.executors.base.Executor`)."""

TABLE: dict[str, Mapping[str, str]] = {
    "methods": {name: row.home for name, row in METHODS.items()},
    "evidence": EDGE_SOURCES,
    "outputs": EXPORTS,
    "executors": EXECUTORS,
}
"""Where each built-in lives, by kind and name."""

_ARGUMENTS = {
    "methods": ("scene",),
    "evidence": ("scene",),
    "outputs": ("result", "context"),
    "executors": ("do", "tasks"),
}
"""What the function of each kind is called with."""
_ASKED_BY = {"methods": "method", "evidence": "edges.source", "outputs": "--export", "executors": "--executor"}
"""What a message calls each kind."""


@cache
def installed(kind: str) -> Mapping[str, str]:
    """``module:function`` of every installed plug-in of a kind that has no built-in's name, by its name."""
    from importlib.metadata import entry_points  # 10 ms that only a name of no row should cost

    return {one.name: one.value for one in entry_points(group=f"ffseg.{kind}") if one.name not in TABLE[kind]}


def home_of(kind: str, name: str) -> str:
    """``module:function`` behind a name.

    Raises
    ------
    ParameterError
        If there is none; with the nearest name.
    """
    home = TABLE[kind].get(name) or (name if ":" in name else installed(kind).get(name, ""))
    if not home:
        names = (*TABLE[kind], *installed(kind))
        near = nearest_word(name, names) or f"; choose from {', '.join(names)}, or name your own as module:function"
        raise ParameterError(f"{_ASKED_BY[kind]}: there is no '{name}'{near}")
    return home


def find(kind: str, name: str) -> Any:  # noqa: ANN401 - the caller knows what the kind is
    """What a name stands for, loaded.

    Raises
    ------
    ParameterError
        If there is no such name, or it cannot be loaded.
    """
    try:
        found = load(home_of(kind, name))
    except ValueError as error:
        raise ParameterError(f"{_ASKED_BY[kind]}: {error}") from error
    if kind != "outputs" and not callable(found):
        raise ParameterError(f"{_ASKED_BY[kind]}: {name} is no function; name one as docs/extending.md shows")
    if name not in TABLE[kind] and callable(found) and not hasattr(found, "replies"):  # the class of an executor
        _require_shape(kind, name, found)
    return found


def _require_shape(kind: str, name: str, function: Callable[..., Any]) -> None:
    """Refuse a function of somebody's that cannot be called as its kind is; of some built into Python that cannot be told."""
    from inspect import signature

    arguments = _ARGUMENTS[kind]
    try:
        signature(function).bind(*arguments)
    except ValueError:
        return
    except TypeError as error:
        what = f"{name} cannot be called as {name.rpartition(':')[2]}({', '.join(arguments)}): {error}"
        raise ParameterError(f"{_ASKED_BY[kind]}: {what}; name one as docs/extending.md shows") from error


def check(kind: str, name: str) -> str:
    """File of a plug-in's function, which is loaded now so that nothing fails later; empty for a built-in.

    Raises
    ------
    ParameterError
        As `find`.
    """
    if name in TABLE[kind]:
        return ""
    module = sys.modules.get(getattr(find(kind, name), "__module__", ""))
    return getattr(module, "__file__", None) or ""


def method(name: str | Callable[..., Any]) -> Method:
    """The row of a method's name, a built-in one or that of a plug-in, or of a function.

    Raises
    ------
    ParameterError
        If there is no method of that name.
    """
    if not isinstance(name, str):
        return Method("", getattr(name, "__name__", "function"), function=name)
    return METHODS.get(name) or Method(home_of("methods", name), name)


def methods_named(text: str) -> tuple[str, ...]:
    """Methods of a comma-separated list; ``all`` stands for all of ffseg's own and every peer, ``peers`` for these.

    Raises
    ------
    ParameterError
        If there is none of a name, or it cannot be loaded.
    SegmentationError
        If no package of them is installed.
    """
    groups = {"all": (*SEGMENTERS, *PEERS), "peers": tuple(PEERS)}
    parts = [part.strip() for part in text.split(",")]
    names = tuple(dict.fromkeys(name for part in parts for name in groups.get(part, (part,))))
    for name in names:
        check("methods", name)
    rows = [method(name) for name in names]
    if not any(row.installed for row in rows):
        rows[0].loaded()
    return names


_LOADED: set[str] = set()
"""Top level modules, not ffseg's, of everything that has been loaded by a name."""


def described(error: BaseException) -> str:
    """Kind and text of an unexpected error, and the file and line of the plug-in that it came from, if it did."""
    for frame, line in reversed(list(walk_tb(error.__traceback__))):
        if frame.f_globals.get("__name__", "").partition(".")[0] in _LOADED:
            file = os.path.basename(frame.f_code.co_filename)
            return f"{type(error).__name__} in {file}, line {line}: {error}"
    return f"{type(error).__name__}: {error}"


def load(home: str) -> Any:  # noqa: ANN401 - the caller knows the signature
    """Bring the function that ``module:function`` names; the working directory is importable, as ``python -m`` has it.

    Raises
    ------
    ValueError
        If there is no such module or function, or the module fails.
    """
    module, _, name = home.partition(":")
    if not module.startswith("ffseg."):
        _LOADED.add(module.partition(".")[0])
        if not {"", here := os.getcwd()} & set(sys.path):
            sys.path.insert(0, here)
    try:
        found = attrgetter(name)(import_module(module))  # which waits while another thread imports it
    except (Exception, SystemExit) as error:  # of somebody's module: whatever it raises
        kind = "" if isinstance(error, ImportError | AttributeError) else f"{type(error).__name__}: "
        remedy = (
            "" if module.startswith("ffseg.") else "; check the name, and that its file is in this folder or installed"
        )
        raise ValueError(f"{home!r} cannot be loaded: {kind}{error}{remedy}") from error
    return found
