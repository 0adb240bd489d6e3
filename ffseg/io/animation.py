"""The evolution of a contour as an animated picture."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ffseg.io.overlays import draw_overlay, polylines
from ffseg.io.snapshots import Snapshot, scaled_contour, scaled_down

FRAME_MS = 90
"""A snapshot every ten iterations at this pace crosses an 800-pixel image in two seconds."""
LAST_MS = 2000
"""How long the result stands before the film begins again."""
_QUALITY = 80


def animation_bytes(
    image: NDArray[np.uint8],
    snapshots: Sequence[Snapshot],
    kind: Literal["webp", "gif"] = "webp",
    width: int = 640,
) -> bytes:
    """Animated WebP or GIF that repeats for ever.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey or BGR.
    snapshots : sequence of Snapshot
        A frame each, such as a callback of ``ffseg.segment`` collects them; at least one.
    kind : {"webp", "gif"}
    width : int
        Pixels; a larger image is scaled down to it, contours with it.

    Returns
    -------
    bytes
        A whole file; the same for the same input.
    """
    if not snapshots:
        raise ValueError("an animation needs at least one snapshot")
    small, scale = scaled_down(image, width)
    frames = [Image.fromarray(_frame(small, snapshot, scale)) for snapshot in snapshots]
    durations = [FRAME_MS] * (len(frames) - 1) + [LAST_MS]
    buffer = io.BytesIO()
    options = {"save_all": True, "append_images": frames[1:], "duration": durations, "loop": 0}
    if kind == "webp":
        frames[0].save(buffer, "WEBP", quality=_QUALITY, method=4, **options)
    else:
        frames[0].save(buffer, "GIF", optimize=False, disposal=1, **options)
    return buffer.getvalue()


def _frame(small: NDArray[np.uint8], snapshot: Snapshot, scale: float) -> NDArray[np.uint8]:
    lines = polylines(scaled_contour(contour, scale) for contour in snapshot.contours)
    return np.ascontiguousarray(draw_overlay(small, lines)[..., ::-1])
