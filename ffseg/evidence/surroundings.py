"""What the prior looks at beside the features of `ffseg.evidence.features`: the border of the image, passages, texture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ffseg.evidence.features import BARRIER, NAMES, STEP, Features
from ffseg.evidence.openings import widened
from ffseg.native import _core

Plane = NDArray[np.float32]

FRAME = 0.03
"""Width of the border whose colours are compared, in parts of the root of the image's area."""

PASSAGES = (5, 9)
"""Reduced pixels; barriers are also measured where only passages of this width count."""

NEAR = 5.0
"""Radii of the start within which the usual gradient is measured."""

FAINT = 0.02
"""Units of L, a, b per pixel added to gradients before their logarithm: below sensor noise."""

SURROUNDINGS = (
    "frame_barrier",
    "frame_hardness",
    "start_or_frame",
    "start_to_frame",
    *(f"{name}~{width}" for width in PASSAGES for name in BARRIER[1:]),
    "frame_likeness",
    "likeness~3",
    "unusual@0.7",
    "unusual@1.5",
    "rough@0.7",
    "rough@1.5",
    "start_slope",
    "to_border",
    "chroma",
    "busy~3",
    "busy~6",
)
"""Names of the planes in their order."""


def surroundings(seen: Features) -> Plane:
    """The planes that ``SURROUNDINGS`` names, shape (len(SURROUNDINGS), h, w), all finite."""
    inside = seen.inside > 0
    height, width = inside.shape
    size = float(np.sqrt(height * width))
    slope = seen["slope@1.5"]
    frame = _barrier(slope, _frame((height, width), 1))
    own = seen["barrier@1.5"]
    planes = [
        frame[0],
        frame[1],
        np.log((own + 1) / (frame[0] + 1)),
        _even(np.log(np.median(frame[0][inside]) + 1), own),
    ]
    for passage in PASSAGES:
        planes += list(_barrier(widened(slope, passage), seen.inside)[1:])
    light = NAMES.index("light@1.5")
    likeness = np.empty_like(slope)
    border = _frame((height, width), max(2, int(FRAME * size)))
    _core.evidence_likelihood(seen.planes[light : light + 3], border, likeness)
    planes += [_blurred(likeness, 1.0), _blurred(seen["likeness"], 3.0)]
    rows, columns = np.nonzero(inside)
    radius = np.sqrt(np.count_nonzero(inside) / np.pi)
    y, x = np.arange(height)[:, None], np.arange(width)
    near = np.hypot(y - rows.mean(), x - columns.mean()) <= NEAR * radius
    usual = {name: np.median(seen[f"slope@{name}"][near]) + FAINT for name in ("0.7", "1.5")}
    within = {name: np.median(seen[f"slope@{name}"][inside]) + FAINT for name in ("0.7", "1.5")}
    planes += [np.log((seen[f"barrier@{name}"] * STEP + FAINT) / usual[name]) for name in usual]
    planes += [np.log((seen[f"slope@{name}"] + FAINT) / within[name]) for name in within]
    planes += [_even(np.log(within["1.5"]), own)]
    planes += [np.minimum(np.minimum(x, width - 1 - x), np.minimum(y, height - 1 - y)) / size]
    planes += [np.hypot(seen["red@1.5"], seen["blue@1.5"])]
    busy = np.log(slope + FAINT)
    for scale in (3.0, 6.0):
        smooth = _blurred(busy, scale)
        planes.append(smooth - smooth[inside].mean())
    return np.stack([np.asarray(plane, np.float32) for plane in planes])


def _even(value: float, like: Plane) -> Plane:
    return np.full_like(like, value)


def _frame(shape: tuple[int, int], width: int) -> NDArray[np.uint8]:
    frame = np.ones(shape, np.uint8)
    frame[width:-width, width:-width] = 0
    return frame


def _barrier(heights: Plane, start: NDArray[np.uint8]) -> Plane:
    planes = np.empty((len(BARRIER), *heights.shape), np.float32)
    _core.evidence_barrier(np.ascontiguousarray(heights), start, STEP, planes)
    return planes


def _blurred(plane: Plane, sigma: float) -> Plane:
    out = np.empty_like(plane)
    _core.evidence_blur(np.ascontiguousarray(plane), sigma, out)
    return out
