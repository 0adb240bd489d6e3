"""Snapshots of an evolution, scaled for film writers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import cv2
import numpy as np

from ffseg.arrays import Image
from ffseg.geometry.freeform import FreeForm
from ffseg.io.overlays import as_colour


class Snapshot(Protocol):
    """What a segmenter hands to its callback."""

    @property
    def iteration(self) -> int:
        """How many iterations were done."""

    @property
    def contours(self) -> Sequence[FreeForm]:
        """In pixels; outer ones of positive area, holes negative."""


def evenly_spaced(snapshots: Sequence[Snapshot], count: int) -> list[Snapshot]:
    """At most `count` snapshots evenly from first to last, both kept."""
    if len(snapshots) <= count:
        return list(snapshots)
    places = np.rint(np.linspace(0, len(snapshots) - 1, count)).astype(int)
    return [snapshots[place] for place in dict.fromkeys(places.tolist())]


MAX_HEIGHT = 4096
"""Pixels of a scaled picture: more than any screen has, and WebP ends at 16383."""


def scaled_down(image: Image, width: int) -> tuple[Image, float]:
    """Image of at most `width` px, and `MAX_HEIGHT` high, as BGR, and its scale; never enlarged."""
    height, full = image.shape[:2]
    scale = min(1.0, width / full, MAX_HEIGHT / height)
    size = (max(1, round(full * scale)), max(1, round(height * scale)))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA) if scale < 1 else image
    return as_colour(np.asarray(small, np.uint8)), scale


def scaled_contour(contour: FreeForm, scale: float) -> FreeForm:
    """Contour in the scaled image: corners at 0 stay, so pixel centres move by half a pixel less."""
    return contour.affine(np.eye(2) * scale, (scale / 2 - 0.5, scale / 2 - 0.5))
