"""R13: the bindings of a sanitized core with arrays and numbers that fit and that do not; ``fuzz_native.py`` starts it.

Refused input (ValueError, TypeError) is a pass. The number of the case at work stands in ``DIR/border-case``. What lies
behind the bindings is fuzzed without Python; here every call is small.
"""

import faulthandler
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import numpy as np
import typer

from tests.campaigns import harness, other_core

CASE_SECONDS = 120
"""A case takes milliseconds; one that takes this long hangs, on a busy machine too."""
LEGAL = (ValueError, TypeError, OverflowError, MemoryError)
ODD = (np.nan, np.inf, -np.inf, 1e300, -1e300, 1e101, 1e9, -1e9, 1e-300, 0.0, -0.0, -0.5, 0.5, 65535.5, -1.0)
SIDES = (0, 1, 1, 2, 3, 7, 16, 17, 40)
ODD_COUNTS = (-(2**31), -1, 0, 1, 2, 7, 64, 65, 2**31 - 1)

Array = np.ndarray


class Draws:
    """Values of one case; about one array or number in `spoil` is what the binding has to refuse, or to survive."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.spoil = int(rng.choice([4, 12, 40]))
        self.shape = (int(rng.choice(SIDES)), int(rng.choice(SIDES)))
        if rng.integers(60) == 0:
            self.shape = (1, int(rng.integers(32000, 66000)))

    def once(self, count: int) -> bool:
        """Whether something happens that happens once in `count` times."""
        return bool(self.rng.integers(count) == 0)

    def number(self, usual: Sequence[float]) -> float:
        """A usual number or an odd one."""
        return float(self.rng.choice(ODD if self.once(self.spoil) else np.asarray(usual, float)))

    def count(self, usual: Sequence[int]) -> int:
        return int(self.rng.choice(ODD_COUNTS if self.once(self.spoil) else np.asarray(usual)))

    def _other(self, made: Array) -> Array:
        """An array of another shape, kind or layout."""
        kind = self.rng.integers(5)
        if kind == 0:
            return np.zeros((made.shape[0] + 1, *made.shape[1:]), made.dtype)
        if kind == 1:
            return made[:0]
        if kind == 2:
            return np.asfortranarray(made)
        with np.errstate(over="ignore"):
            return made[..., None] if kind == 3 else made.astype(np.float32)

    def plane(self, dtype: type, high: int, *more: int) -> Array:
        """A map of the case's shape."""
        shape = (*self.shape, *more)
        density = self.rng.choice([0.0, 0.1, 1.0])
        made: Array = np.where(self.rng.random(shape) < density, self.rng.integers(0, high, shape), 0).astype(dtype)
        return self._other(made) if self.once(self.spoil) else made

    def marks(self) -> Array:
        return np.where(self.plane(np.uint8, 256) > 0, 255, 0).astype(np.uint8)

    def domain(self) -> Array | None:
        return self.marks() if self.once(3) else None

    def rows(self, count: int, columns: int, reach: float = 50.0) -> Array:
        """Numbers round the map; now and then a few odd ones."""
        made = self.rng.uniform(-0.1 * reach, reach, (count, columns))
        if made.size and self.once(self.spoil):
            made.flat[self.rng.integers(made.size)] = self.rng.choice(ODD)
        return self._other(made) if self.once(4 * self.spoil) else made

    def contours(self, degree: int) -> tuple[Array, Array]:
        """Control points of contours and their offsets, which now and then do not fit."""
        sizes = [int(self.rng.integers(2, 6)) * degree for _ in range(self.rng.integers(1, 4))]
        offsets = np.cumsum([0, *sizes]).astype(np.int64)
        if self.once(self.spoil):
            offsets[self.rng.integers(len(offsets))] += self.rng.choice([-1000, -1, 1, 1 << 40])
        if self.once(4 * self.spoil):
            offsets = offsets[: self.rng.integers(len(offsets))]
        return self.rows(sum(sizes), 2), offsets

    def options(self, made: object, usual: dict[str, Sequence[float]]) -> Any:
        """Options with usual numbers, and odd ones."""
        for name, values in usual.items():
            kind = type(getattr(made, name))
            setattr(made, name, kind(self.count(values) if kind is int else self.number(values)))  # type: ignore[arg-type]
        return made


def evolve(core: ModuleType, draws: Draws) -> None:
    """An evolution, its settling, and the mask of what came out."""
    options = draws.options(
        core.EvolutionOptions(),
        {
            "degree": range(1, 7), "split_threshold": (8, 14), "balloon": (1, 2, 4), "refine": (0, 1),
            "topology": (0, 1), "max_iterations": (3, 2000), "clearance": (0, 0, 3), "settle": (0, 4, 16),
            "ridge_low": (0, 1), "weight": (0, 1), "window": (0, 16),
        },
    )  # fmt: skip
    contours = draws.contours(max(1, min(6, options.degree)))
    image = draws.plane(np.uint8, 256, int(draws.rng.integers(1, 5)))
    evolution = core.Evolution(*contours, draws.marks(), draws.domain(), options, image if draws.once(2) else None)
    evolution.advance(int(draws.rng.integers(-1, 6)))
    evolution.settle(draws.plane(np.uint16, 1 << 16))
    found, ends = evolution.contours()
    evolution.counts()
    assert np.isfinite(found).all()
    degrees = np.full(len(ends) - 1, options.degree, np.int64)
    core.rasterize(found, np.array(ends, np.int64), degrees, 0.01, np.zeros(draws.shape, np.uint8))


def rasterize(core: ModuleType, draws: Draws) -> None:
    degree = int(draws.rng.integers(1, 7))
    points, offsets = draws.contours(degree)
    degrees = np.full(len(offsets) - 1 if len(offsets) else 0, degree, np.int64)
    if len(degrees) and draws.once(draws.spoil):
        degrees[0] = draws.rng.integers(-1, 9)
    tolerance = draws.number([0.01, 0.5])
    core.crossings(draws.rows(20, 2), points, offsets, degrees, tolerance)
    core.rasterize(points, offsets, degrees, tolerance, draws.plane(np.uint8, 2))


def edge_maps(core: ModuleType, draws: Draws) -> None:
    image = draws.plane(np.uint8, 256, *([int(draws.rng.integers(1, 6))] if draws.once(2) else []))
    gradient, edges = draws.plane(np.uint16, 5773), draws.plane(np.uint8, 2)
    core.gradient_and_ridges(image, draws.number([0.5, 1.5, 32]), gradient, edges)
    core.canny(gradient, draws.count([64, 65535]), draws.count([800, 0]), edges)
    numbers = (draws.number([2.5]), draws.number([0, 32, 1e6]), draws.number([0.1, 0.5, 1]), draws.number([1, 3]))
    core.canny_auto(gradient, draws.domain(), *numbers, edges)


def boundaries(core: ModuleType, draws: Draws) -> None:
    """What is seen along a boundary, and how plain the region in it is."""
    gradient, margin = draws.plane(np.uint16, 1 << 16), draws.count([1, 3])
    core.gradients_at(draws.rows(20, 2), gradient, draws.domain(), margin)
    points, ends = draws.contours(1)
    core.share_within(points, ends, draws.shape, draws.domain(), margin)
    levels = draws.rows(int(draws.rng.choice([1, 2, 3, 51])), 1, 1e5)[:, 0].copy()
    share = core.lively_share(draws.marks(), gradient, levels, draws.count([1, 3]), draws.number([0, 0.01, 1]))
    assert 0 <= share <= 1


def level_sets(core: ModuleType, draws: Draws) -> None:
    inside, stop = draws.marks(), draws.count([1, 64, 65536])
    core.mask_outlines(inside)
    core.fast_march(np.abs(draws.rows(*draws.shape, 4.0)), draws.number([0, 1]), inside, draws.domain())
    options = draws.options(core.LevelSetOptions(), {"reach": (0, 4, 64), "closing_in": (0, 1), "min_area": (0, 4)})
    options.stop = stop
    slowness = np.where(np.arange(65536) < stop, 1.0, np.inf)
    if draws.once(draws.spoil):
        slowness[draws.rng.integers(65536)] = draws.rng.choice(ODD)
    core.level_set(draws.plane(np.uint16, 100), slowness, inside, draws.domain(), options)


def snakes(core: ModuleType, draws: Draws) -> None:
    options = draws.options(
        core.SnakeOptions(),
        {
            "tension": (0, 0.02, 1e3), "rigidity": (0, 0.02, 1e3), "balloon": (-2, 2), "attraction": (0, 2.5),
            "spacing": (2, 6), "tolerance": (0, 0.05), "refine": (0, 1), "max_iterations": (0, 2000),
        },
    )  # fmt: skip
    points, altitudes = draws.rows(int(draws.rng.integers(0, 30)), 2), draws.rows(int(draws.rng.integers(0, 3)), 4)
    maps = (draws.plane(np.uint16, 1 << 16), draws.marks(), draws.domain())
    made = core.Snake(points, *maps, altitudes, draws.number([0.1]), options)
    made.advance(int(draws.rng.integers(-1, 8)))
    assert np.isfinite(made.points()).all()


def pairs(core: ModuleType, draws: Draws) -> None:
    current, previous = draws.plane(np.uint8, 256), draws.plane(np.uint8, 256)
    n, k, radius = int(draws.rng.integers(5)), 2, draws.count([1, 2, 4, 32])
    warps = np.tile([1.0, 0.0, 0.0, 1.0], (n, k)) + 0.01 * draws.rows(n, 4 * k)
    centers = draws.rows(n, 2)
    places, scores = draws.rows(n, 2 * k), draws.rows(n, k)
    core.patch_scores(current, previous, centers, places, warps, radius, draws.number([-2, 0.5]), scores)
    own = np.ascontiguousarray(warps[:, :4])
    core.align_patches(current, previous, centers, draws.rows(n, 2), own, radius, draws.count([0, 5]), draws.rows(n, 7))


def interest(core: ModuleType, draws: Draws) -> None:
    image = draws.plane(np.uint8, 256)
    windows = np.array([[0, 0, 1, 1], [0, 0, *image.shape[::-1]]], np.int64)
    if draws.once(draws.spoil):
        windows[draws.rng.integers(2), draws.rng.integers(4)] += draws.rng.choice([-1, 1, 1 << 40])
    masks = draws.rng.integers(0, 2, 1 + image.size, dtype=np.uint8)
    points, counts = draws.rows(8, 2), np.zeros(2, np.int64)
    for find in (core.harris_points, core.outline_points):
        find(image, windows, masks, draws.count([0, 4, 32]), points, counts)


def lists(core: ModuleType, draws: Draws) -> None:
    """Distances between points and the text of paths."""
    core.nearest_distances(draws.rows(int(draws.rng.integers(9)), 2), draws.rows(int(draws.rng.integers(9)), 2))
    degree = draws.count([1, 2, 3])
    core.path_text(draws.rows(6 * int(draws.rng.integers(3)) + int(draws.once(draws.spoil)), 2), degree)


def packed(core: ModuleType, draws: Draws) -> None:
    """Lengths of packed bytes, whatever they are."""
    size, usual = int(draws.rng.integers(200)), [0, 0x80, 0xFF, int(draws.rng.integers(256))]  # long runs, clear codes
    data = bytes(draws.rng.choice(usual, size).tolist()) if draws.rng.integers(2) else draws.rng.bytes(size)
    core.lzw_size(data)
    core.packbits_size(data)


TARGETS = (evolve, rasterize, edge_maps, boundaries, level_sets, snakes, pairs, interest, lists, packed)


def fuzz(core: ModuleType, work: Path, cases: range, seed: int) -> Counter[str]:
    """Run cases; a finding of the sanitizers ends the process."""
    seen: Counter[str] = Counter()
    with (work / "border-case").open("w+b", buffering=0) as mark:
        for number in cases:
            os.pwrite(mark.fileno(), b"%12d\n" % number, 0)
            faulthandler.dump_traceback_later(CASE_SECONDS, exit=True)
            target = TARGETS[number % len(TARGETS)]
            try:
                target(core, Draws(np.random.default_rng([seed, number])))
                seen[f"{target.__name__} passed"] += 1
            except LEGAL:
                seen[f"{target.__name__} refused"] += 1
            faulthandler.cancel_dump_traceback_later()
    return seen


def main(
    work: harness.Work,
    core: Annotated[str, typer.Option()],
    cases: int = 20_000,
    seed: int = 0,
    only: int | None = None,
) -> int:
    """Run the cases with a core that is built already."""
    numbers = range(cases) if only is None else range(only, only + 1)
    seen = fuzz(other_core.loaded(core), work, numbers, seed)
    harness.say("\n".join(f"{name:20} {seen[name]:6} cases" for name in sorted(seen)))
    harness.say(f"{sum(seen.values())} cases")
    return 0


if __name__ == "__main__":
    harness.as_command(main)
