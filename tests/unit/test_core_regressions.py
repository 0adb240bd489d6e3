"""Inputs that once crashed the native core, in a process of their own: a crash is a failed test, not a dead suite."""

from __future__ import annotations

import subprocess
import sys

import pytest

CODE = """
import hashlib
import numpy as np
import ffseg
image = {image}
params = ffseg.load_params(None, {settings})
found = [ffseg.segment(image, params) for _ in range(3)]
digests = {{hashlib.sha256(result.mask.tobytes() + b"".join(
    contour.control_points.tobytes() for contour in result.contours)).hexdigest() for result in found}}
assert all(np.isfinite(contour.control_points).all() for result in found for contour in result.contours)
print(len(digests), *found[0].mask.shape, int(found[0].mask.sum()))
"""


def segmented(image: str, settings: str) -> tuple[int, tuple[int, int], int]:
    """Different results of three calls, shape and area."""
    code = CODE.format(image=image, settings=settings)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr[-500:]
    count, height, width, area = map(int, done.stdout.split())
    return count, (height, width), area


@pytest.mark.parametrize("degree", [1, 3, 6])
def test_start_circle_that_leaves_the_image(degree: int) -> None:
    image = "np.full((48, 64), 90, np.uint8)"
    count, shape, area = segmented(image, f"{{'init.radius': 40, 'contour.degree': {degree}}}")
    assert (count, shape) == (1, (48, 64))
    assert area > 0.9 * 48 * 64  # nothing stops it inside


def test_white_noise_gives_the_same_result_every_time() -> None:
    image = "np.random.default_rng(3).integers(0, 256, (500, 700), dtype=np.uint8)"
    count, shape, _ = segmented(image, "{'init.radius': 8}")
    assert (count, shape) == (1, (500, 700))
