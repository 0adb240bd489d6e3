"""The table of output kinds: one row for each, by name, importing nothing until it is written."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from ffseg.errors import ParameterError, UsageError
from ffseg.plugins import EXPORTS, find, home_of, load

_HERE = "ffseg.batch.outputs"
PACKS = "packs"
"""Folder below a state folder with the tar files that are being written."""


def tar_name(kind: str) -> str:
    """Name of the tar file of a kind in the output folder."""
    return f"{kind}.tar"


@dataclass(frozen=True, slots=True)
class Output:
    """One kind of output."""

    name: str
    """What asks for it: a name of ``--export``, or of an option of its own."""
    folder: str
    suffix: str
    """Where it is stored below the output folder."""
    encode: str
    """``module:function`` that makes its bytes, called as ``encode(result, context)`` with a `Segmentation` and a
    `ffseg.batch.outputs.encoding.Context`; empty where `ffseg.io.saving` writes it by its name."""
    merge: str = ""
    """``module:function`` that makes one file of those of all images, called as ``merge(contents, label)``, where every
    call of ``contents()`` gives the bytes of each image's file in order, and the label is the class of the regions; gives
    pieces of bytes. Empty for none."""
    merged: str = ""
    """Name of that file below the output folder."""

    def path(self, stem: str) -> str:
        """Of one image's output below the output folder."""
        return f"{self.folder}/{stem}{self.suffix}"


MASK = Output("mask", "masks", ".png", "")
CONTOURS = Output("contours", "contours", ".svg", f"{_HERE}.encoding:contours")
OVERLAY = Output("overlay", "overlays", ".png", f"{_HERE}.encoding:overlay")
COCO = Output("coco", "coco", ".json", "", f"{_HERE}.encoding:coco_of_all", "coco.json")
LABELME = Output("labelme", "labelme", ".json", f"{_HERE}.encoding:labelme")
GEOJSON = Output("geojson", "geojson", ".geojson", "")
YOLO = Output("yolo", "yolo", ".txt", "", f"{_HERE}.encoding:yolo_of_all", "yolo.yaml")
SVG = Output("svg", "svg", ".svg", f"{_HERE}.encoding:drawing")
CUTOUT = Output("cutout", "cutouts", ".png", "")
FILM = Output("animation", "animations", ".webp", f"{_HERE}.encoding:film")
STRIP = Output("animation", "animations", ".svg", f"{_HERE}.encoding:strip")
GROUND = Output("map", "ground", ".geojson", f"{_HERE}.metric:ground")
SCAN = Output("map", "scans", ".csv", f"{_HERE}.metric:scan_csv")
SCAN_JSON = Output("map", "scans", ".json", f"{_HERE}.metric:scan_json")
BIRDS_EYE = Output("map", "birdseye", ".png", f"{_HERE}.metric:picture")

OUTPUTS = (
    MASK, CONTOURS, OVERLAY, COCO, LABELME, GEOJSON, YOLO, SVG, CUTOUT, FILM, STRIP, GROUND, SCAN, SCAN_JSON, BIRDS_EYE,
)  # fmt: skip
"""Every kind of ffseg's own, in the order in which they are written."""
MAP_FILES = tuple(
    f"map/{name}"
    for name in ("map.pgm", "map.yaml", "map.png", "trajectory.csv", "graph.geojson", "graph.graphml", "graph.svg")
)
"""Of all frames together, where each has a ground."""
MAP_BAG = "map/drive.mcap"
"""The map and the scans as a bag, where the images come from one."""
MAP_PICTURE = MAP_FILES[2]
OUTPUT_FOLDERS = (*dict.fromkeys(output.folder for output in OUTPUTS), "panels", "map")
"""Folders below an output folder whose images are no inputs; ``panels`` is written by ``compare``."""
TIMINGS, RUN, OBSTACLES, PARQUET = "timings.csv", "run.json", "obstacles.csv", "timings.parquet"
REPORT = "report.html"
_JOINT = {TIMINGS, RUN, OBSTACLES, PARQUET, REPORT, *(output.merged for output in OUTPUTS)}


@cache
def output_named(name: str) -> Output:
    """The row of a name of ``--export``: one of ffseg's, of an installed plug-in, or of ``module:function``.

    A function says with attributes where its outputs go: ``suffix`` (``.bin`` without) and ``folder`` (the name without,
    of ``module:function`` the module's).

    Raises
    ------
    ParameterError
        If there is none, it cannot be loaded, or its folder or suffix is no name of its own.
    """
    found = find("outputs", name)
    if not isinstance(found, Output):
        if not callable(found):
            raise ParameterError(f"--export: {name} is no function; name one as docs/extending.md shows")
        folder = getattr(found, "folder", name.partition(":")[0].rpartition(".")[2])
        found = Output(name, folder, getattr(found, "suffix", ".bin"), home_of("outputs", name))
    if name not in EXPORTS:
        _check_names(name, found)
    return found


def _check_names(name: str, found: Output) -> None:
    """Refuse a row of somebody's whose names lead elsewhere or are ffseg's own, or whose `merge` is nothing."""
    plain = _is_name(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,99}", found.folder)
    if not (plain and _is_name(r"\.[A-Za-z0-9_.-]{1,20}", found.suffix)):
        wrong = f"folder {found.folder!r} and suffix {found.suffix!r}"
        raise ParameterError(f"--export: {name} has {wrong}; give one plain name, and one that begins with a dot")
    if found.folder in OUTPUT_FOLDERS:
        raise ParameterError(f"--export: {name} has the folder {found.folder!r}, which is ffseg's own; give another")
    if not found.merge:
        return
    if not _is_name(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}(?<!\.tar)", found.merged) or found.merged in _JOINT:
        what = f"puts all images into {found.merged!r}"
        raise ParameterError(f"--export: {name} {what}; give a plain name of a file that is not ffseg's own")
    try:
        load(found.merge)
    except ValueError as error:
        raise ParameterError(f"--export: {name}: {error}") from error


def _is_name(form: str, text: object) -> bool:
    return isinstance(text, str) and re.fullmatch(form, text) is not None


@dataclass(frozen=True, slots=True)
class Products:
    """What is to be written beside masks and contours."""

    overlay: bool = False
    exports: tuple[str, ...] = ()
    """Names that `output_named` takes."""
    animation: bool = False
    pack: bool = False
    """Into tar files, one for each folder, instead of a file each."""
    metric: bool = False
    """In metres, of a camera's images: ground, scan and a picture from above."""
    films: tuple[str, ...] = ()
    """Kinds of films made of all frames: ``mask``, ``overlay``, ``cutout``."""

    @property
    def kinds(self) -> tuple[Output, ...]:
        """All outputs of an image."""
        overlay = (OVERLAY,) if self.overlay else ()
        films = (FILM, STRIP) if self.animation else ()
        metric = (GROUND, SCAN, SCAN_JSON, BIRDS_EYE) if self.metric else ()
        return (MASK, CONTOURS, *overlay, *map(output_named, self.exports), *films, *metric)


FILM_KINDS = {"mask": "mp4", "overlay": "mp4", "cutout": "webm"}
"""Films made of the outputs of all frames, as ``--film-out`` names them, and their containers."""
MASKS_AND_CONTOURS = Products()


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
    """Formats named by texts such as ``coco,labelme``, each once."""
    names = [name.strip() for text in texts for name in text.split(",")]
    known = tuple(dict.fromkeys(name.lower() if name.lower() in EXPORTS else name for name in names))
    rows = [output_named(name) for name in known]
    doubled = next((row for row in rows if sum(row.folder == other.folder for other in rows) > 1), None)
    if doubled is not None:
        raise ParameterError(f"--export: two formats would share the folder {doubled.folder}; give one another folder")
    return known
