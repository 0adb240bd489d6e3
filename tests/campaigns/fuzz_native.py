"""R13: the native core under ASan and UBSan with hostile contours, maps and parameters: no finding, no hang.

``python tests/campaigns/fuzz_native.py --work DIR --cases 1000000 [--seed 0]``

Builds the core with ``-DFFSEG_SANITIZE=ON`` into DIR and starts itself again with the sanitizers loaded. The number of the
case at work stands in ``DIR/case``: ``--seed`` and ``--only NUMBER`` repeat it. Refused input (ValueError) is a pass.
"""

from __future__ import annotations

import faulthandler
import importlib.util
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType

import harness
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
CASE_SECONDS = 60
"""A case takes milliseconds; one that takes this long under the sanitizers hangs."""
LEGAL = (ValueError, TypeError, OverflowError, MemoryError)
ODD = np.array([np.nan, np.inf, -np.inf, 1e300, -1e300, 1e101, 1e9, -1e9, 1e-300, 0.0, -0.0, -0.5, 0.5, 65535.5])


def build(work: Path) -> Path:
    """Compile the sanitized core and return the module's file."""
    folder = work / "build"
    configure = [
        "cmake",
        "-S",
        str(ROOT),
        "-B",
        str(folder),
        "-DFFSEG_SANITIZE=ON",
        f"-DPython_EXECUTABLE={sys.executable}",
    ]
    subprocess.run([*configure, "-DCMAKE_BUILD_TYPE=RelWithDebInfo"], check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", str(folder), "-j", "2"], check=True, capture_output=True)
    return next(folder.glob("_core*.so"))


def load(path: str) -> ModuleType:
    """Load the core from a file."""
    spec = importlib.util.spec_from_file_location("ffseg.native._core", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def sizes(rng: np.random.Generator) -> tuple[int, int]:
    """Shape of a map: mostly small, now and then empty, one pixel, or a long strip."""
    kind = rng.integers(12)
    if kind == 0:
        return int(rng.integers(0, 2)), int(rng.integers(0, 3))
    if kind == 1:
        return (1, int(rng.integers(1, 3000))) if rng.integers(2) else (int(rng.integers(1, 3000)), 1)
    return int(rng.integers(1, 48)), int(rng.integers(1, 48))


def marks(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """Edge or domain map: empty, full, scattered, or a frame of lines."""
    density = rng.choice([0.0, 0.01, 0.1, 0.5, 0.95, 1.0])
    made = (rng.random(shape) < density).astype(np.uint8) * 255
    if made.size and rng.integers(3) == 0:
        made[rng.integers(shape[0])] = 255
        made[:, rng.integers(shape[1])] = 255
    return made


def contours(rng: np.random.Generator, shape: tuple[int, int], degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Control points and offsets: circles, loops, repeated, far-away and impossible points; now and then bad offsets."""
    pieces = []
    for _ in range(rng.integers(1, 4)):
        count = int(rng.integers(3, 14)) * degree
        angle = np.linspace(0, 2 * np.pi, count, endpoint=False) * rng.choice([1, -1, 2])
        radius = rng.choice([1e-9, 0.3, 2.0, 8.0, 40.0, 500.0]) * (
            1 + 0.4 * rng.standard_normal(count) * rng.integers(2)
        )
        center = rng.random(2) * np.array([shape[1] + 1, shape[0] + 1])
        points = center + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        if rng.integers(3) == 0:
            points[rng.integers(count)] = points[rng.integers(count)]
        if rng.integers(4) == 0:
            points = np.round(points)
        if rng.integers(25) == 0:
            points[rng.integers(count), rng.integers(2)] = rng.choice(ODD)
        pieces.append(points)
    offsets = np.cumsum([0, *map(len, pieces)]).astype(np.int64)
    if rng.integers(40) == 0:
        offsets[rng.integers(len(offsets))] += rng.choice([-1000, -1, 1, 1 << 40])
    return np.ascontiguousarray(np.vstack(pieces)), offsets


def options(core: ModuleType, rng: np.random.Generator) -> tuple[object, int]:
    """Evolution options at and beyond their limits, and the degree."""
    made = core.EvolutionOptions()
    degree = int(rng.integers(1, 7))
    choices: dict[str, list[object]] = {
        "split_threshold": [2.0, 8.0, 14.0, 24.0, 1000.0], "balloon": [-16.0, -2.0, 0.0, 1e-9, 2.0, 4.0, 16.0],
        "refine": [True, False], "topology": [True, False], "clearance": [0.0, 0.0, 3.0, 1000.0],
        "settle": [0.0, 4.0, 16.0],
    }  # fmt: skip
    made.degree = degree
    for name, values in choices.items():
        if hasattr(made, name):
            value = values[rng.integers(len(values))]
            if isinstance(value, float) and rng.integers(200) == 0:
                value = float(rng.choice(ODD))
            setattr(made, name, value)
    return made, degree


def evolve(core: ModuleType, rng: np.random.Generator) -> None:
    """An evolution, its settling, and the mask of what came out."""
    shape = sizes(rng)
    chosen, degree = options(core, rng)
    points, offsets = contours(rng, shape, degree)
    domain = marks(rng, shape) if rng.integers(3) == 0 else None
    evolution = core.Evolution(points, offsets, marks(rng, shape), domain, chosen)
    for _ in range(rng.integers(1, 5)):
        if not evolution.advance(int(rng.integers(1, 12))):
            break
    if rng.integers(2):
        evolution.settle(rng.integers(0, 1 << 16, shape, dtype=np.uint16))
    found, ends = evolution.contours()
    evolution.counts()
    degrees = np.full(len(ends) - 1, degree, np.int64)
    core.rasterize(
        np.ascontiguousarray(found), np.ascontiguousarray(ends, np.int64), degrees, 0.01, np.zeros(shape, np.uint8)
    )


def rasterize(core: ModuleType, rng: np.random.Generator) -> None:
    """A mask of any contours."""
    degree = int(rng.integers(1, 7))
    shape = sizes(rng)
    points, offsets = contours(rng, shape, degree)
    degrees = np.full(len(offsets) - 1, degree if rng.integers(9) else rng.integers(-1, 9), np.int64)
    tolerance = float(rng.choice([0.01, 0.5, 1e-6, 0.0, np.nan]))
    core.rasterize(points, offsets, degrees, tolerance, np.zeros(shape, np.uint8))


def edge_maps(core: ModuleType, rng: np.random.Generator) -> None:
    """Gradient and Canny edges of noise."""
    shape = sizes(rng)
    planes = (*shape, int(rng.integers(1, 5))) if rng.integers(2) else shape
    image = rng.integers(0, 256, planes, dtype=np.uint8)
    gradient, edges = np.zeros(shape, np.uint16), np.zeros(shape, np.uint8)
    sigma = float(rng.choice([0.01, 0.5, 1.5, 1.5, 4.0, 20.0, 32.0])) if rng.integers(20) else float(rng.choice(ODD))
    core.gradient_and_ridges(image, sigma, gradient, edges)
    if rng.integers(4) == 0:  # no gradient of any image
        gradient, edges = rng.integers(0, 1 << 16, shape, dtype=np.uint16), rng.integers(0, 256, shape, dtype=np.uint8)
    low, high = sorted(int(value) for value in rng.integers(0, 1 << 16, 2))
    core.canny(gradient, low, high, edges.copy())
    domain = marks(rng, shape) if rng.integers(2) else None
    numbers = [2.5, float(rng.choice([0.0, 32.0, 1e6])), float(rng.choice([0.1, 0.5, 1.0])), 3.0]
    if rng.integers(10) == 0:
        numbers[rng.integers(4)] = float(rng.choice(ODD))
    core.canny_auto(gradient, domain, *numbers, edges)


TARGETS = (evolve, rasterize, edge_maps)


def fuzz(core: ModuleType, work: Path, first: int, cases: int, seed: int) -> Counter[str]:
    """Run cases; a finding of the sanitizers ends the process."""
    seen: Counter[str] = Counter()
    with (work / "case").open("w+b", buffering=0) as mark:
        for number in range(first, first + cases):
            os.pwrite(mark.fileno(), b"%12d\n" % number, 0)
            faulthandler.dump_traceback_later(CASE_SECONDS, exit=True)
            rng = np.random.default_rng([seed, number])
            target = TARGETS[number % len(TARGETS)]
            try:
                target(core, rng)
                seen[target.__name__] += 1
            except LEGAL:
                seen[f"{target.__name__} refused"] += 1
            faulthandler.cancel_dump_traceback_later()
    return seen


def sanitizers() -> str:
    """Libraries to load before everything else."""
    names = ("libasan.so", "libubsan.so")
    found = [
        subprocess.run(["cc", f"-print-file-name={name}"], capture_output=True, text=True, check=True) for name in names
    ]
    return " ".join(done.stdout.strip() for done in found)


def main() -> int:
    """Build, then run under the sanitizers."""
    arguments = harness.parser(__doc__)
    arguments.add_argument("--cases", type=int, default=1_000_000)
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--only", type=int, help="one case, by its number")
    arguments.add_argument("--core", help="a core that is built already")
    given = arguments.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    if "LD_PRELOAD" not in os.environ:
        core = given.core or str(build(given.work))
        env = {
            **os.environ, "LD_PRELOAD": sanitizers(), "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1",
            "UBSAN_OPTIONS": "halt_on_error=1:print_stacktrace=1",
        }  # fmt: skip
        code = subprocess.run(
            [sys.executable, __file__, *sys.argv[1:], "--core", core], env=env, check=False
        ).returncode
        harness.say("clean" if code == 0 else f"exit code {code} in case {(given.work / 'case').read_text().strip()}")
        return code
    first, cases = (given.only, 1) if given.only is not None else (0, given.cases)
    harness.say(str(fuzz(load(given.core), given.work, first, cases, given.seed)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
