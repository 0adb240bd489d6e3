"""A segmentation has the same bits whatever the processor lets a linear algebra library, NumPy or OpenCV do."""

import os
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

from ffseg.learning.drawn.sights import KINDS, sights
from ffseg.learning.grow import SAME_ARITHMETIC

SAMPLES = str(Path(__file__).resolve().parents[2] / "samples")

CODE = """
import hashlib, sys
import numpy as np
import ffseg
from ffseg.io.svg import svg_document
from ffseg.geometry import bezier
from ffseg.evidence.base import BASE

digest = hashlib.blake2b()
for degree in range(1, 7):
    for number in range(40):
        circle = ffseg.FreeForm.circle((400.3 + number, 299.7), 11.7 * (number + 1), 13, degree)
        digest.update(circle.control_points.tobytes() + np.float64(circle.signed_area).tobytes())
        digest.update(bezier.sample(circle.patches).tobytes())
for name in ("toy", "simple", "complex"):
    result = ffseg.segment(ffseg.read_image(sys.argv[1] + f"/{name}.png"))
    digest.update(svg_document(result.contours, 800, 600).encode() + result.mask.tobytes())
for path in sys.argv[2:]:
    image = ffseg.read_image(path)
    x, y = (float(at) for at in path.rsplit(".", 1)[0].split("_")[-2:])
    start, clicks = {"init.center": [x, y], "init.radius": 5}, {"init.circles": [[x, y, 5]], "init.background": [[2, 2]]}
    for places in (start, clicks, start | {"edges.model": str(BASE)}):
        result = ffseg.segment(image, places)
        digest.update(svg_document(result.contours, *image.shape[1::-1]).encode() + result.mask.tobytes())
        digest.update(np.float64(result.score).tobytes())
        print(result.source)
print(digest.hexdigest())
"""


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Drawn pictures, most of which the prior decides, one of each kind; where they start is in their names."""
    folder, paths = tmp_path_factory.mktemp("pictures"), []
    for kind in KINDS:
        seen = next(sights(kind, 1, 600_000))
        (row, column) = (int(at.mean()) for at in seen.disc().nonzero())
        paths.append(str(folder / f"{kind}_{column}_{row}.png"))
        cv2.imwrite(paths[-1], seen.image)
    return paths


def digest(pictures: list[str], **environment: str) -> str:
    command = [sys.executable, "-W", "ignore", "-c", CODE, SAMPLES, *pictures]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env={**os.environ, **environment})
    return done.stdout


@pytest.fixture(scope="module")
def here(pictures: list[str]) -> str:
    found = digest(pictures)
    assert {"prior", "hints"} <= set(found.split())
    return found


OTHERS = {
    "linear algebra without fused operations": {"OPENBLAS_CORETYPE": "Sandybridge"},
    "linear algebra of an old processor": {"OPENBLAS_CORETYPE": "Prescott"},
    "C library without fused operations": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-AVX2,-FMA4,-AVX512F"},
    "OpenCV without Intel's primitives and wide registers": {
        name: value for name, value in SAME_ARITHMETIC.items() if name.startswith("OPENCV")
    },
    "NumPy without wide registers": {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL"},
}  # fmt: skip


@pytest.mark.parametrize("environment", OTHERS.values(), ids=OTHERS)
def test_other_processors_give_the_same_bits(environment: dict[str, str], here: str, pictures: list[str]) -> None:
    assert digest(pictures, **environment) == here
