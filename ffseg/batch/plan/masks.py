"""The masks that come with images: those the parameters name for all, and an image's own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from ffseg.io.images import Limits
from ffseg.io.masks import load_mask
from ffseg.parameters import Parameters


class Bounds(TypedDict):
    """Where the contour may go, start and may not be, as arguments of `ffseg.segment`."""

    domain: NDArray[np.uint8] | None
    start_mask: NDArray[np.uint8] | None
    background: NDArray[np.uint8] | None


@dataclass(frozen=True, slots=True, eq=False)
class Masks:
    """What is known of an image's pixels before it is segmented: 255 or 0, as `load_mask` gives them, or nothing."""

    domain: NDArray[np.uint8] | None = None
    start: NDArray[np.uint8] | None = None
    background: NDArray[np.uint8] | None = None

    @property
    def bounds(self) -> Bounds:
        """As arguments."""
        return {"domain": self.domain, "start_mask": self.start, "background": self.background}

    def within(self, path: str, limits: Limits | None = None) -> Masks:
        """With the domain of one image out of ``domain.masks``; the same without a path."""
        return replace(self, domain=load_mask("domain.masks", path, limits)) if path else self


NO_MASKS = Masks()


def named_masks(params: Parameters, limits: Limits | None = None) -> Masks:
    """The masks that the parameters name."""
    return Masks(
        load_mask("domain.mask", params.domain.mask, limits),
        load_mask("init.mask", params.init.mask, limits),
        load_mask("init.background_mask", params.init.background_mask, limits),
    )
