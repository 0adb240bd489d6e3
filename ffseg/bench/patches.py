"""Suite ``patches``: time of one iteration against the number of patches, in an empty map."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from ffseg.bench.drawing import draw
from ffseg.bench.measure import Group, Settings, Task, timed_fresh
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


def patches(settings: Settings) -> Iterator[Group]:
    """Groups of the suite, one for each number of patches."""
    grey = draw(1).image
    for count in QUICK_COUNTS if settings.quick else COUNTS:
        tasks = [_task(case, count) for case in CASES]
        yield Group("patches", f"N = {count}", grey, tasks, {"circles": count // PATCHES})


def _task(case: str, count: int) -> Task:
    space, topology = CASES[case]
    options = evolution_options(Parameters(), topology=topology)
    points, offsets, side = _lattice(count // PATCHES, space * options.balloon * (WARM_UP + ITERATIONS), options)
    edges = np.zeros((side, side), np.uint8)
    copies = max(1, LEAST_WORK // count)

    def make() -> Callable[[], None]:
        evolutions = [_core.Evolution(points, offsets, edges, None, options) for _ in range(copies)]
        for evolution in evolutions:
            evolution.advance(WARM_UP)
        return lambda: _advance(evolutions)

    return Task(f"{case}, {count}", "iteration", timed_fresh(make, ITERATIONS * copies), x=count)


def _advance(evolutions: list[_core.Evolution]) -> None:
    for evolution in evolutions:
        evolution.advance(ITERATIONS)


def evolution_options(params: Parameters, *, topology: bool) -> _core.EvolutionOptions:
    """The options of the native evolution as the parameters say, but for `topology`."""
    options = native_options(params, 0.0)
    options.topology = topology
    return options


def _lattice(
    circles: int, space: float, options: _core.EvolutionOptions
) -> tuple[NDArray[np.float64], NDArray[np.int64], int]:
    """Control points and offsets of circles with `space` px between them, and the side of the map that holds them.

    Their patches are half as long as those that are split.
    """
    columns = int(np.ceil(np.sqrt(circles)))
    radius = PATCHES * options.split_threshold / (4 * np.pi)
    spacing, margin = 2 * radius + space, 2 * (radius + options.balloon * (WARM_UP + ITERATIONS))
    circle = FreeForm.circle((0.0, 0.0), radius, PATCHES, options.degree).control_points
    places = np.stack(np.divmod(np.arange(circles), columns)[::-1], axis=1) * spacing + margin
    points = np.ascontiguousarray((places[:, None, :] + circle[None]).reshape(-1, 2))
    offsets = np.arange(circles + 1, dtype=np.int64) * len(circle)
    return points, offsets, int(np.ceil((columns - 1) * spacing + 2 * margin))
