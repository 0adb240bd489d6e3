"""What a result can do beside being looked at: files, documents, a short text and a picture of itself."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from ffseg.errors import OutputError
from ffseg.io.saving.source import NO_SOURCE, Source
from ffseg.io.tables import counted

if TYPE_CHECKING:
    from ffseg.io.exports import Document
    from ffseg.result import Segmentation

_PICTURE_SIDE = 640
"""Pixels: a picture that fits beside the code of a notebook."""
_INSIDE, _OUTSIDE = 235, 70
"""Grey levels of a region and of what surrounds it, apart from each other and from the lines on a light or dark page."""


class Savable:
    """Mixed into `Segmentation`."""

    __slots__ = ()

    def save_mask(self, path: str | os.PathLike[str]) -> None:
        """Write the mask as a PNG file: 255 inside, 0 outside.

        Raises
        ------
        OutputError
            If the suffix is not .png, or the file cannot be written.
        """
        self._save(path, "mask")

    def save_svg(self, path: str | os.PathLike[str], title: str = "", behind: str = "") -> None:
        """Write the exact contours as an SVG file of the image's size.

        Parameters
        ----------
        path : path
        title : str
        behind : str
            Name of the image file, relative to the SVG, to be shown behind the contours.

        Raises
        ------
        OutputError
            If the suffix is not .svg or `behind` is no name, or the file cannot be written.
        """
        if not isinstance(behind, str):  # perhaps the image itself
            raise OutputError(f"behind is of type {type(behind).__name__}; give the name of an image file")
        self._save(path, "svg", Source(title, behind=behind))

    def save_overlay(self, path: str | os.PathLike[str], image: NDArray[np.uint8]) -> None:
        """Write the image with the region tinted and its contours drawn: PNG, JPEG or WebP by the suffix.

        Parameters
        ----------
        path : path
        image : ndarray of uint8, shape (H, W) or (H, W, 3)
            The one that was segmented, BGR.

        Raises
        ------
        OutputError
            For another suffix or an image of another size, or if the file cannot be written.
        """
        self._save(path, "overlay", Source(image=image))

    def to_geojson(self, name: str = "") -> Document:
        """GeoJSON feature collection in pixels: a Polygon per region with its holes; `name` stands for the image."""
        return self._document("geojson", name)

    def to_coco(self, name: str = "") -> Document:
        """COCO document of one image called `name`: an annotation per region."""
        return self._document("coco", name)

    def __repr__(self) -> str:
        result = self._result()
        height, width = result.mask.shape
        regions = counted(result.num_regions, "region")
        return (
            f"<Segmentation of {width} x {height} px: {np.count_nonzero(result.mask)} px inside, {regions}, "
            f"{counted(result.num_holes, 'hole')}; {result.stats.stop_reason} after "
            f"{counted(result.stats.iterations, 'iteration')}>"
        )

    def _repr_png_(self) -> bytes:
        """What a notebook shows: the region light on dark, with its contours."""
        from ffseg.io.overlays import Polyline, encode_overlay, polylines

        result = self._result()
        step = -(-max(result.mask.shape) // _PICTURE_SIDE)
        canvas = np.where(result.mask[::step, ::step], np.uint8(_INSIDE), np.uint8(_OUTSIDE))
        lines = [Polyline(line.points / step, line.kind) for line in polylines(result.contours)]
        return encode_overlay(canvas, lines)

    def _result(self) -> Segmentation:
        return cast("Segmentation", self)

    def _document(self, kind: str, name: str) -> Document:
        from ffseg.io.saving.kinds import documents

        return documents(self._result(), kind, name)

    def _save(self, path: str | os.PathLike[str], kind: str, source: Source = NO_SOURCE) -> None:
        from ffseg.io.files import write_bytes_atomic
        from ffseg.io.saving.kinds import encoded
        from ffseg.io.saving.suffixes import kind_of

        text = os.fspath(path)
        suffix = os.path.splitext(text)[1].lower()
        kind_of(text, (kind,))
        write_bytes_atomic(text, encoded(self._result(), kind, source, suffix))
