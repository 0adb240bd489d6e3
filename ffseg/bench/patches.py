"""Suite ``patches``: time of one iteration against the number of patches, in an empty map."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ffseg.bench.drawing import draw
from ffseg.bench.measure import Group, Order, Task, timed_fresh
from ffseg.geometry.freeform import FreeForm
from ffseg.methods.freeform import native_options
from ffseg.native import _core
from ffseg.parameters import Parameters

COUNTS = (10, 30, 100, 300, 1000, 3000, 10_000, 20_000)
QUICK_COUNTS = (10, 30, 100)
PATCHES = 10
"""Patches of one circle; contours of N patches are N / 10 circles on a square lattice."""
WARM_UP = 1
"""Iterations before the clock starts: the first sorts the patches and fills the lists."""
ITERATIONS = 3
"""Iterations timed. Circles that touch in them meet in the first, and have merged on all sides after the last."""
LEAST_WORK = 1000
"""Patches moved in one sample at least, by as many evolutions as that takes: the clock must not show."""
CASES = {"still": (2.5, False), "filtered": (2.5, True), "merging": (0.75, True)}
"""Space between the circles, in the way the front goes meanwhile (twice that closes it), and whether topology changes
are looked for: never looked for; looked for, none happening; every circle merging with its neighbours."""


def patches(order: Order, _: Path) -> Iterator[Group]:
    """Groups of the suite, one for each number of patches."""
    grey = draw(1).image
    for count in QUICK_COUNTS if order.quick else COUNTS:
        yield Group(
            "patches", f"N = {count}", grey, [_task(case, count) for case in CASES], {"circles": count // PATCHES}
        )


def _task(case: str, count: int) -> Task:
    space, topology = CASES[case]
    options = native_options(Parameters(), 0.0)
    options.topology = topology
    copies = max(1, LEAST_WORK // count)
    arguments = _lattice(count // PATCHES, space, options)

    def make() -> Callable[[], None]:
        evolutions = [_core.Evolution(*arguments) for _ in range(copies)]
        _advance(evolutions, WARM_UP)
        return lambda: _advance(evolutions, ITERATIONS)

    return Task(f"{case}, {count}", "iteration", timed_fresh(make, ITERATIONS * copies), x=count)


def _advance(evolutions: list[_core.Evolution], iterations: int) -> None:
    for evolution in evolutions:
        evolution.advance(iterations)


def _lattice(circles: int, space: float, options: _core.EvolutionOptions) -> tuple[Any, ...]:
    """What an evolution of that many circles, `space` ways of the front apart, begins with, in the map that holds them.

    Their patches are half as long as those that are split.
    """
    columns = int(np.ceil(np.sqrt(circles)))
    way = options.balloon * (WARM_UP + ITERATIONS)
    radius = PATCHES * options.split_threshold / (4 * np.pi)
    spacing, margin = 2 * radius + space * way, 2 * (radius + way)
    circle = FreeForm.circle((0.0, 0.0), radius, PATCHES, options.degree).control_points
    places = np.stack(np.divmod(np.arange(circles), columns)[::-1], axis=1) * spacing + margin
    points = np.ascontiguousarray((places[:, None, :] + circle[None]).reshape(-1, 2))
    side = int(np.ceil((columns - 1) * spacing + 2 * margin))
    return points, np.arange(circles + 1) * len(circle), np.zeros((side, side), np.uint8), None, options
