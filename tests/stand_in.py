"""A segmenter for tests of the batch: thresholds the image, and misbehaves when its first pixel says so."""

import ctypes
import time

import numpy as np

from ffseg.errors import SegmentationError
from ffseg.geometry.freeform import FreeForm
from ffseg.result import Segmentation, Timings
from ffseg.scene import Outcome, Scene, Stats

NAME = "stand_in:segment"
METHOD = "stand_in:method"
"""The same for ``--set method=...`` of a command, in an environment whose PYTHONPATH has this folder."""
CRASH, HANG, EAT, FAIL, DEFECT = 251, 252, 253, 254, 255
"""Grey levels of the first pixel of an image that is to go wrong."""


def segment(scene: Scene) -> Segmentation:
    """Pixels above 127 (at the default degree), with one box as the contour; both depend on `contour.degree`."""
    image, params, domain = scene.image, scene.params, scene.domain
    grey = image if image.ndim == 2 else image.max(axis=2)
    _misbehave(int(grey[0, 0]))
    more = params.contour.degree - 3
    mask = grey > 127 + 20 * more
    if domain is not None:
        mask &= domain > 0
    height, width = mask.shape
    box = FreeForm.box(0.0, 0.0, width - 1.0 + more, height - 1.0)
    stats = Stats(1, 0, 0, 0, 0, 4, 4, 4, "converged")
    return Segmentation(mask, (box,), stats, Timings(0.1, 0.2, 0.3))


def method(scene: Scene) -> Outcome:
    """The same pixels, for the command line."""
    return Outcome(mask=segment(scene).mask)


def _misbehave(level: int) -> None:
    if level == CRASH:
        ctypes.string_at(0)
    elif level == HANG:
        time.sleep(600)
    elif level == EAT:
        np.ones(1 << 36, np.uint8)
    elif level == FAIL:
        raise SegmentationError("the start circle lies on an edge; move init.center")
    elif level == DEFECT:
        raise ZeroDivisionError("a defect")
