"""What each constant of the default path changes: ``python -m tests.campaigns.perturbed [--looks 2] [--only NAME]``.

Segments drawings with each Python constant of `tests.constants` halved and doubled: looks of every kind that
``ffseg.learning.drawn`` draws, of numbers far beyond those that were learned from, drawn regions in noise, starts across edges,
labyrinths and dark frames. Says how many results differ in a byte, and the mean IoU before and after. A constant that changes
none of them has no scene among them.
"""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from statistics import mean
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.api import segment
from ffseg.image.boundary import CLEAR_SHARE, Boundary
from ffseg.image.edges import edge_map
from ffseg.io.images import single_thread
from ffseg.learning.drawn.sights import KINDS, sights
from ffseg.metrics import iou
from ffseg.parameters import load_params
from tests.campaigns import harness
from tests.campaigns.scoring import UNSEEN
from tests.constants import constants
from tests.labyrinths import plan
from tests.scenes import START, START_RADIUS, scene

FACTORS = (0.5, 2.0)
RIGHT = 0.9
"""IoU from which on a contour is taken to be right."""
LEARNED = ("evidence/features.py", "evidence/openings.py")
"""Their constants say what the forest has seen: another value needs another forest."""


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """An image, its truth (255 inside) and its start."""

    image: NDArray[np.uint8]
    truth: NDArray[np.uint8]
    start: tuple[float, float, float]


def drawings(looks: int) -> Iterator[Drawing]:
    """Kinds, regions, noisy and dark ones, starts across an edge, labyrinths."""
    for name in KINDS:
        for seen in sights(name, looks, UNSEEN):
            yield Drawing(seen.image, seen.truth, seen.start)
    for seed in range(3 * looks):
        drawn = scene(seed)
        truth, rng = drawn.truth * np.uint8(255), np.random.default_rng(seed)
        start = (*START, START_RADIUS)
        yield Drawing(drawn.image, truth, start)
        noisy = drawn.image + rng.normal(0, 10 * (1 + seed), drawn.image.shape)
        yield Drawing(np.clip(noisy, 0, 255).astype(np.uint8), truth, start)
        yield Drawing(drawn.image // 8, truth, start)
        y, x = np.argwhere(np.diff(drawn.truth, axis=1))[seed::97][0]
        yield Drawing(drawn.image, truth, (float(x), float(y), 12.0))
        narrow = plan(seed, 8.0).drawn(8.0)
        yield Drawing(narrow.image, narrow.truth * np.uint8(255), (*narrow.start, 3.0))


def results(scenes: list[Drawing]) -> list[tuple[bytes, float]]:
    """What can differ in a result, and its IoU."""
    params, found = load_params(), []
    for one in scenes:
        x, y, radius = one.start
        result = segment(one.image, replace(params, init=replace(params.init, center=(x, y), radius=radius)))
        points = b"".join(contour.control_points.tobytes() for contour in result.contours)
        said = repr((result.source, result.score, result.messages, result.doubts)).encode()
        found.append((points + said, iou(result.mask, one.truth)))
    return found


def faint_tenths(looks: int) -> Iterator[str]:
    """Strength that a tenth of the boundary falls short of, for contours on the image's own edges that are right and wrong."""
    right, wrong = [], []
    shown = [Drawing(one.image, one.truth, one.start) for name in KINDS for one in sights(name, looks, UNSEEN)]
    regions = ((one.image, one.truth * np.uint8(255)) for one in map(scene, range(40)))
    for one in [*shown, *(Drawing(image, truth, (*START, START_RADIUS)) for image, truth in regions)]:
        x, y, radius = one.start
        params = load_params(None, {"init.center": [x, y], "init.radius": radius, "edges.source": "gradient"})
        found = segment(one.image, params)
        strength = np.sort(Boundary(found.contours, edge_map(one.image, params.edges)).strength)
        kind = right if iou(found.mask, one.truth) >= RIGHT else wrong
        kind.append(float(strength[int(CLEAR_SHARE * len(strength))]) if len(strength) else np.inf)
    for name, values in (("right", right), ("wrong", wrong)):
        yield f"{len(values)} {name}: " + " ".join(f"{one:.2f}" for one in sorted(values))


@contextmanager
def changed(place: str, values: Mapping[str, object]) -> Iterator[None]:
    """The constants of a file with other values, wherever they have been imported."""
    home = "ffseg." + place.removesuffix(".py").replace("/", ".")
    import_module(home)
    before = [
        (module, name, vars(module)[name])
        for key, module in list(sys.modules.items())
        for name in values
        if key.startswith("ffseg") and name in vars(module) and (key == home or _imports(module, home, name))
    ]
    for module, name, _ in before:
        setattr(module, name, values[name])
    try:
        yield
    finally:
        for module, name, value in before:
            setattr(module, name, value)


def _imports(module: ModuleType, home: str, name: str) -> bool:
    """Whether a module has the constant from its home and none of its own."""
    file = module.__file__ or ""
    text = Path(file).read_text("utf-8") if file.endswith(".py") else ""
    return f"from {home} import" in text and f"\n{name} = " not in text


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, tuple):
        return tuple(_scaled(one, factor) for one in value)
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


def main(looks: int = 2, only: str = "", file: str = "", faint: bool = False) -> int:
    """Print a row for each constant."""
    single_thread()
    if faint:
        print("\n".join(faint_tenths(looks)))
        return 0
    scenes = list(drawings(looks))
    before = results(scenes)
    print(f"{len(scenes)} drawings, mean IoU {mean(one[1] for one in before):.4f}")
    for _, place, names, _, _ in constants():
        if not place.endswith(".py") or place in LEARNED or file not in place:
            continue
        for name in names.split(", "):
            if only in ("", name):
                print(_row(place, name, scenes, before), flush=True)
    return 0


def _row(place: str, name: str, scenes: list[Drawing], before: list[tuple[bytes, float]]) -> str:
    value, cells = getattr(import_module("ffseg." + place.removesuffix(".py").replace("/", ".")), name), []
    for factor in FACTORS:
        try:
            with changed(place, {name: _scaled(value, factor)}):
                after = results(scenes)
        except Exception as error:  # noqa: BLE001 - a value that cannot be is a result
            cells.append(f"{type(error).__name__:>16}")
            continue
        other = sum(one[0] != two[0] for one, two in zip(before, after, strict=True))
        cells.append(f"{other:3d} {mean(one[1] for one in after) - mean(one[1] for one in before):+.4f}")
    return f"{place:28} {name:18} halved {cells[0]:16} doubled {cells[1]}"


if __name__ == "__main__":
    harness.as_command(main)
