"""A simulated user, who clicks deepest in the largest error; evidence learns from its clicks, and campaigns count them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ffseg.arrays import Image, Mask
from ffseg.metrics import IGNORED, INSIDE
from ffseg.parameters import Circle, Seed
from ffseg.starts.rivals import add_disc


@dataclass(frozen=True, slots=True)
class Clicks:
    """Circles (x, y, radius) inside, and (x, y, radius, after) outside, after so many of these; px."""

    inside: tuple[Circle, ...] = ()
    outside: tuple[Seed, ...] = ()

    def next(self, mask: Mask, truth: Image, radius: float) -> Clicks:
        """With one more in what a mask misses or has too much; a circle is no larger than the error is deep."""
        depths = [
            cv2.distanceTransform(np.pad(error.astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
            for error in ((truth == INSIDE) & ~mask, (truth != INSIDE) & (truth != IGNORED) & mask)
        ]
        outside = bool(depths[1].max() > depths[0].max())
        deepest = float(depths[outside].max())
        row, column = np.unravel_index(int(depths[outside].argmax()), truth.shape)
        if deepest == 0:
            return self
        circle = (float(column), float(row), min(radius, max(1.0, deepest - 1)))
        if outside:
            return replace(self, outside=(*self.outside, (*circle, float(len(self.inside)))))
        return replace(self, inside=(*self.inside, circle))

    def last(self, inside: bool) -> Circle:
        """The last circle of a side."""
        x, y, radius = (self.inside if inside else self.outside)[-1][:3]  # type: ignore[misc]  # all have a radius
        return x, y, radius

    def regions(self, shape: tuple[int, ...]) -> tuple[Mask, Mask]:
        """Pixels known to lie inside, and outside."""
        return disc_mask(self.inside, shape), disc_mask(self.outside, shape)


def disc_mask(circles: tuple[Seed, ...], shape: tuple[int, ...]) -> Mask:
    """Pixels of circles."""
    found = np.zeros(shape[:2], np.bool_)
    for circle in circles:
        add_disc(found, *circle[:3])
    return found
