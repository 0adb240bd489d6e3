"""Which files a run writes for each image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ffseg.errors import UsageError

OutputKind = tuple[str, str]
"""Folder and suffix."""

MASK, CONTOURS, OVERLAY = ("masks", ".png"), ("contours", ".svg"), ("overlays", ".png")
COCO, LABELME, GEOJSON = ("coco", ".json"), ("labelme", ".json"), ("geojson", ".geojson")
FILM, STRIP = ("animations", ".webp"), ("animations", ".svg")

EXPORTS = {"coco": COCO, "labelme": LABELME, "geojson": GEOJSON}
OUTPUT_FOLDERS = ("masks", "contours", "overlays", "coco", "labelme", "geojson", "animations", "panels")


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is to be written beside masks and contours.

    Attributes
    ----------
    overlay : bool
    exports : tuple of str
        Names of `EXPORTS`.
    animation : bool
    """

    overlay: bool = False
    exports: tuple[str, ...] = ()
    animation: bool = False

    @property
    def kinds(self) -> tuple[OutputKind, ...]:
        """All outputs of an image."""
        overlay = (OVERLAY,) if self.overlay else ()
        films = (FILM, STRIP) if self.animation else ()
        return (MASK, CONTOURS, *overlay, *(EXPORTS[name] for name in self.exports), *films)


MASKS_AND_CONTOURS = Wanted()


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
        raise UsageError(f"--export: there is no format '{unknown}'; choose from {', '.join(EXPORTS)}")
    return tuple(dict.fromkeys(names))
