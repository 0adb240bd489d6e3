"""Peak memory of one segmentation above the decoded image, in a process of its own. Run by the suite ``memory``."""

from __future__ import annotations

import json
import resource
import sys
from pathlib import Path

import numpy as np

from ffseg.batch.bench.suites.children import KILOBYTE
from ffseg.batch.bench.suites.drawing import draw
from ffseg.image.reference import one_thread
from ffseg.parameters import load_params
from ffseg.segmenters.registry import segment

LONG = 1_000_000
"""Iterations: a large image takes as many as it needs."""


def main(image_file: str, radius: float) -> None:
    """Segment an image and write bytes before and at the peak as JSON to stdout."""
    with one_thread():
        segment(draw(1, 160, 120).image, load_params(None, {"init.radius": 8.0}))  # what is loaded once is not counted
        image = np.load(image_file)
        before = _resident()
        segment(image, load_params(None, {"init.radius": radius, "contour.max_iterations": LONG}))
        sys.stdout.write(json.dumps({"before": before, "peak": _peak()}))


def _resident() -> int:
    """Bytes in memory now; the peak begins anew where the system can do that, else it stands for them."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize()
    except OSError:
        return _peak()


def _peak() -> int:
    """Most bytes in memory at any time so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * KILOBYTE


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
