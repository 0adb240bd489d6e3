"""What must not decide a segmentation: how the image lies, how bright it is, where in the region it starts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import mean

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.api import segment
from ffseg.errors import FfsegError
from ffseg.metrics import INSIDE, iou
from ffseg.parameters import Parameters
from tests.campaigns.real_images import Photograph

SHIFT = 7
LEAST = 0.995
"""Mean IoU between the region and that of the changed image, from which the change counts as harmless."""

Mask = NDArray[np.bool_]
Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Change:
    """A change of a photograph, and how its region is laid over the unchanged one's."""

    name: str
    of: Callable[[Photograph], Photograph]
    back: Callable[[Mask], Mask] = lambda mask: mask
    before: Callable[[Photograph], Photograph] = lambda one: one
    common: Callable[[Mask], Mask] = lambda mask: mask


def _mirrored(one: Photograph) -> Photograph:
    x, y, radius = one.circle
    return _with(one, one.image[:, ::-1], one.truth[:, ::-1], (one.image.shape[1] - 1 - x, y, radius))


def _turned(one: Photograph) -> Photograph:
    x, y, radius = one.circle
    return _with(one, np.rot90(one.image), np.rot90(one.truth), (y, one.image.shape[1] - 1 - x, radius))


def _shifted(one: Photograph) -> Photograph:
    x, y, radius = one.circle
    return _with(one, one.image[SHIFT:, SHIFT:], one.truth[SHIFT:, SHIFT:], (x - SHIFT, y - SHIFT, radius))


def _moved(one: Photograph) -> Photograph:
    """Started elsewhere in the truth, not farther than four radii; where no disc fits, half a radius aside."""
    x, y, radius = one.circle
    room = cv2.distanceTransform(np.pad(one.truth == INSIDE, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    v, u = np.nonzero(room > radius + 2)
    near = np.hypot(u - x, v - y) < 4 * radius
    if not near.any():
        return replace(one, circle=(x + radius / 2, y, radius))
    pick = np.random.default_rng(len(u)).integers(np.count_nonzero(near))
    return replace(one, circle=(float(u[near][pick]), float(v[near][pick]), radius))


def _scaled(factor: float) -> Callable[[Photograph], Photograph]:
    def change(one: Photograph) -> Photograph:
        return replace(one, image=np.rint(one.image * factor).astype(np.uint8))

    return change


def _with(one: Photograph, image: Image, truth: Image, circle: tuple[float, float, float]) -> Photograph:
    return replace(one, image=np.ascontiguousarray(image), truth=np.ascontiguousarray(truth), circle=circle)


CHANGES = (
    Change("mirrored", _mirrored, back=lambda mask: mask[:, ::-1]),
    Change("turned", _turned, back=lambda mask: np.rot90(mask, -1)),
    Change("shifted", _shifted, common=lambda mask: mask[SHIFT:, SHIFT:]),
    Change("start moved", _moved),
    Change("brightness x 0.5", _scaled(0.5)),
    Change("brightness x 1.5", _scaled(1.5), before=_scaled(1 / 1.5)),
)
"""The last one begins with an image of two thirds of the brightness, so that nothing is clipped."""


def table(photographs: Sequence[Photograph], params: Parameters) -> str:
    """Mean and least IoU between the regions before and after each change."""
    lines = [f"invariance over {len(photographs)} images (mean IoU wanted: {LEAST})"]
    for change in CHANGES:
        kept = sorted((agreement(one, change, params), one.name) for one in photographs)
        figure = mean(value for value, _ in kept)
        verdict = "held" if figure >= LEAST else "MISSED"
        least = ", ".join(f"{name} {value:.3f}" for value, name in kept[:3])
        lines.append(f"  {change.name:<17} {figure:.4f} {verdict:<7} below {LEAST}: "
                     f"{sum(value < LEAST for value, _ in kept)}; least {least}")  # fmt: skip
    return "\n".join(lines)


def agreement(one: Photograph, change: Change, params: Parameters) -> float:
    """IoU between the regions before and after a change."""
    base = change.before(one)
    before, after = region(base, params), change.back(region(change.of(base), params))
    return iou(after, change.common(before).astype(np.uint8) * np.uint8(INSIDE))


def region(one: Photograph, params: Parameters) -> Mask:
    """The region of a photograph; empty where it fails."""
    try:
        return segment(one.image, one.placed(params)).mask
    except FfsegError:
        return np.zeros(one.truth.shape, bool)
