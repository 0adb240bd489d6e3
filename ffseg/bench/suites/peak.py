"""Peak memory of one segmentation above the decoded image, in a process of its own. Run by the suite ``memory``."""

from __future__ import annotations

import json
import resource
import sys
from pathlib import Path

import numpy as np

from ffseg.bench.suites.children import KILOBYTE
from ffseg.bench.suites.drawing import draw
from ffseg.image.reference import one_thread
from ffseg.parameters import load_params
from ffseg.pipeline import segment
from ffseg.scene import Scene

LONG = 1_000_000
"""Iterations: a large image takes as many as it needs."""


def main(image_file: str, radius: float) -> None:
    """Segment an image and write bytes before and at the peak as JSON to stdout."""
    with one_thread():
        segment(
            Scene(draw(1, 160, 120).image, load_params(None, {"init.radius": 8.0}))
        )  # what is loaded once is not counted
        image = np.load(image_file)
        before = _resident()
        segment(Scene(image, load_params(None, {"init.radius": radius, "contour.max_iterations": LONG})))
        sys.stdout.write(json.dumps({"before": before, "peak": _peak()}))


def _resident() -> int:
    """Bytes in memory now; the peak begins anew where the system can do that."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return _peak()
    return _status("VmRSS")


def _peak() -> int:
    """Most bytes in memory at any time so far.

    Where there is no ``/proc``, the system's count is taken, which begins with the size of the process this one was
    started from.
    """
    try:
        return _status("VmHWM")
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * KILOBYTE


def _status(name: str) -> int:
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    kilobytes = next(line.split()[1] for line in lines if line.startswith(f"{name}:"))
    return int(kilobytes) * 1024


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
