"""Which files a run writes for each image: one row for each kind, by name, that loads nothing until it is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from ffseg.errors import UsageError

_HERE = "ffseg.batch.outputs"


@dataclass(frozen=True, slots=True)
class Output:
    """One kind of output.

    Attributes
    ----------
    name : str
        What asks for it: a name of ``--export``, or of an option of its own.
    folder, suffix : str
        Where it is stored below the output folder.
    encode : str
        ``module:function`` that makes its bytes, called as ``encode(made, target)`` with a `Made` and the path it will
        be stored at.
    merge : str
        ``module:function`` that makes one file of those of all images, called as ``merge(contents)``, where every call
        of ``contents()`` gives the bytes of each image's file in order; gives pieces of bytes. Empty for none.
    merged : str
        Name of that file below the output folder.
    """

    name: str
    folder: str
    suffix: str
    encode: str
    merge: str = ""
    merged: str = ""

    def path(self, stem: str) -> str:
        """Of one image's output below the output folder."""
        return f"{self.folder}/{stem}{self.suffix}"


MASK = Output("mask", "masks", ".png", f"{_HERE}.encoding:mask")
CONTOURS = Output("contours", "contours", ".svg", f"{_HERE}.encoding:contours")
OVERLAY = Output("overlay", "overlays", ".png", f"{_HERE}.encoding:overlay")
COCO = Output("coco", "coco", ".json", f"{_HERE}.encoding:coco", f"{_HERE}.encoding:coco_of_all", "coco.json")
LABELME = Output("labelme", "labelme", ".json", f"{_HERE}.encoding:labelme")
GEOJSON = Output("geojson", "geojson", ".geojson", f"{_HERE}.encoding:geojson")
SVG = Output("svg", "svg", ".svg", f"{_HERE}.encoding:drawing")
FILM = Output("animation", "animations", ".webp", f"{_HERE}.encoding:film")
STRIP = Output("animation", "animations", ".svg", f"{_HERE}.encoding:strip")

OUTPUTS = (MASK, CONTOURS, OVERLAY, COCO, LABELME, GEOJSON, SVG, FILM, STRIP)
"""Every kind, in the order in which they are written. A new one is a row here and an encoder."""
EXPORTS = {output.name: output for output in (COCO, LABELME, GEOJSON, SVG)}
"""Those that ``--export`` asks for by name."""
OUTPUT_FOLDERS = (*dict.fromkeys(output.folder for output in OUTPUTS), "panels")
"""Folders below an output folder whose images are no inputs; ``panels`` is written by ``compare``."""


def resolve(target: str) -> Any:  # noqa: ANN401 - any function
    """Function that a row names as ``module:function``."""
    module, name = target.split(":")
    return getattr(import_module(module), name)


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is to be written beside masks and contours.

    Attributes
    ----------
    overlay : bool
    exports : tuple of str
        Names of `EXPORTS`.
    animation : bool
    more : tuple of Output
        Kinds that are not ffseg's own: the workers import what their rows name.
    pack : bool
        Into tar files, one for each folder, instead of a file each.
    """

    overlay: bool = False
    exports: tuple[str, ...] = ()
    animation: bool = False
    more: tuple[Output, ...] = ()
    pack: bool = False

    @property
    def kinds(self) -> tuple[Output, ...]:
        """All outputs of an image."""
        overlay = (OVERLAY,) if self.overlay else ()
        films = (FILM, STRIP) if self.animation else ()
        return (MASK, CONTOURS, *overlay, *(EXPORTS[name] for name in self.exports), *films, *self.more)


MASKS_AND_CONTOURS = Wanted()


def read_pack(text: str) -> bool:
    """Whether outputs go into tar files.

    Raises
    ------
    UsageError
        For a kind of archive that is not written.
    """
    if text not in ("", "tar"):
        raise UsageError(f"--pack: there is no '{text}'; choose tar, or leave it out for a file each")
    return text == "tar"


def read_exports(texts: Sequence[str]) -> tuple[str, ...]:
    """Formats named by texts such as ``coco,labelme``, each once.

    Raises
    ------
    UsageError
        For a name that is none of `EXPORTS`.
    """
    names = [name.strip().lower() for text in texts for name in text.split(",")]
    unknown = next((name for name in names if name not in EXPORTS), None)
    if unknown is not None:
        from ffseg.schema.kinds import nearest_word

        near = nearest_word(unknown, tuple(EXPORTS)) or f"; choose from {', '.join(EXPORTS)}"
        raise UsageError(f"--export: there is no format '{unknown}'{near}")
    return tuple(dict.fromkeys(names))
