"""A segmentation has the same bits whatever the processor lets a linear algebra library or NumPy do."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SAMPLES = str(Path(__file__).resolve().parents[2] / "samples")

CODE = """
import hashlib, sys
import numpy as np
import ffseg
from ffseg.io.svg import svg_document
from ffseg.geometry import bezier

digest = hashlib.blake2b()
for degree in range(1, 7):
    for number in range(40):
        circle = ffseg.FreeForm.circle((400.3 + number, 299.7), 11.7 * (number + 1), 13, degree)
        digest.update(circle.control_points.tobytes() + np.float64(circle.signed_area).tobytes())
        digest.update(bezier.sample(circle.patches).tobytes())
for name in ("toy", "simple", "complex"):
    result = ffseg.segment(ffseg.read_image(sys.argv[1] + f"/{name}.png"))
    digest.update(svg_document(result.contours, 800, 600).encode() + result.mask.tobytes())
print(digest.hexdigest())
"""


def digest(**environment: str) -> str:
    command = [sys.executable, "-W", "ignore", "-c", CODE, SAMPLES]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env={**os.environ, **environment})
    return done.stdout


@pytest.fixture(scope="module")
def here() -> str:
    return digest()


OTHERS = {
    "linear algebra without fused operations": {"OPENBLAS_CORETYPE": "Sandybridge"},
    "linear algebra of an old processor": {"OPENBLAS_CORETYPE": "Prescott"},
    "C library without fused operations": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-AVX2,-FMA4,-AVX512F"},
    "NumPy without wide registers": {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL"},
}


@pytest.mark.parametrize("environment", OTHERS.values(), ids=OTHERS)
def test_other_processors_give_the_same_bits(environment: dict[str, str], here: str) -> None:
    assert digest(**environment) == here
