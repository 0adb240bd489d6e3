"""Timed tasks, interleaved with the fixed kernel K, and statistics of their samples: medians, ratios, growth."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from ffseg.arrays import Image
from ffseg.image.reference import one_thread, reference_kernel
from ffseg.plugins import SEGMENTERS

Fact = str | int | float
Sample = tuple[float, float]
"""What is reported (ms of wall time, or memory), and what the gate compares: processor time, or memory."""
Timer = Callable[[], Sample]
BLOCK = 5
"""Rounds whose smallest samples are compared: a disturbance that spares one round of five costs nothing."""


@dataclass(frozen=True, slots=True)
class Schedule:
    """What to run, on what, and how long: all tasks of a group `rounds` times, fewer once `budget_s` is spent, but once.

    No suites stand for all of them.
    """

    suites: Sequence[str] = ()
    rounds: int = 15
    budget_s: float = 20.0
    images: Path | None = None
    quick: bool = False
    methods: Sequence[str] = tuple(SEGMENTERS)


def timed(work: Callable[[], object], per: float = 1.0, *, fresh: bool = False) -> Timer:
    """A timer of a call, or with `fresh` of the one it makes untimed for every sample, in milliseconds divided by `per`."""

    def sample() -> Sample:
        call: Any = work() if fresh else work
        processor, begin = process_time(), perf_counter()
        call()
        end, processor_end = perf_counter(), process_time()
        return (end - begin) * 1e3 / per, (processor_end - processor) * 1e3 / per

    return sample


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """One quantity to measure on a case; `x` is its place on the suite's axis (patches, pixels, jobs), 0 for none."""

    case: str
    quantity: str
    sample: Timer
    x: float = 0.0
    unit: str = "ms"


@dataclass(frozen=True, slots=True, eq=False)
class TaskGroup:
    """Tasks measured in turns with K on the image `grey`, `most` rounds of them where fewer than ordered are enough.

    Comparisons are a title and the two cases whose medians are divided.
    """

    suite: str
    name: str
    grey: Image
    tasks: Sequence[Task]
    facts: Mapping[str, Fact]
    comparisons: Sequence[tuple[str, str, str]] = ()
    most: int = 1 << 30


@dataclass(frozen=True, slots=True)
class Skipped:
    """A part of a suite that cannot run here, and why."""

    suite: str
    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class Figure:
    """Samples of one quantity, and processor time of K in turns; ``robust`` is what the gate compares (`Sample`)."""

    suite: str
    case: str
    quantity: str
    unit: str
    x: float
    values: tuple[float, ...]
    robust: tuple[float, ...]
    kernel_values: tuple[float, ...]

    @property
    def key(self) -> str:
        """Name of the figure in tables and baselines."""
        return f"{self.suite}/{self.case}/{self.quantity}"

    @property
    def quartiles(self) -> tuple[float, float, float]:
        """First quartile, median and third quartile of the samples."""
        low, middle, high = np.quantile(self.values, [0.25, 0.5, 0.75])
        return float(low), float(middle), float(high)

    @property
    def median(self) -> float:
        """Median of the samples."""
        return self.quartiles[1]

    @property
    def robust_median(self) -> float:
        """Median of the robust samples, which exponents and ratios are made of."""
        return float(np.median(self.robust))

    @property
    def kernel(self) -> float:
        """Median of K in milliseconds of processor time."""
        return float(np.median(self.kernel_values))

    @property
    def ratio(self) -> float | None:
        """Robust median in units of K; None for what is no time."""
        return self.robust_median / self.kernel if self.unit == "ms" else None

    @property
    def steady(self) -> float:
        """What the gate compares: the median over blocks of rounds of the least sample divided by the least K.

        The least of a block drops what disturbs single rounds; the same block for both drops drifts of the clock; the
        median drops a block that was disturbed as a whole. For what is no time: the median.
        """
        if self.unit != "ms":
            return self.robust_median
        blocks = np.array_split(np.arange(len(self.robust)), max(1, len(self.robust) // BLOCK))
        robust, kernel = np.array(self.robust), np.array(self.kernel_values)
        return float(np.median([robust[block].min() / kernel[block].min() for block in blocks]))

    def joined(self, other: Figure) -> Figure:
        """The figure with the samples of another measurement of it."""
        samples = ("values", "robust", "kernel_values")
        return replace(self, **{name: getattr(self, name) + getattr(other, name) for name in samples})


def measure(group: TaskGroup, rounds: int, budget_s: float) -> list[Figure]:
    """Measure the tasks of a group in turns, K before each of them; the first round warms up and does not count."""
    kernel = timed(lambda: reference_kernel(group.grey))
    taken: list[list[tuple[Sample, Sample]]] = []
    with one_thread():
        begin = perf_counter()
        _round(group.tasks, kernel)
        while not taken or (len(taken) < min(group.most, rounds) and perf_counter() - begin <= budget_s):
            taken.append(_round(group.tasks, kernel))
    figures = []
    for task, pairs in zip(group.tasks, zip(*taken, strict=True), strict=True):
        values, robust, kernels = zip(*((*own, kernel[1]) for kernel, own in pairs), strict=True)
        figures.append(Figure(group.suite, task.case, task.quantity, task.unit, task.x, values, robust, kernels))
    return figures


def _round(tasks: Sequence[Task], kernel: Timer) -> list[tuple[Sample, Sample]]:
    """One sample of K and one of the task, for every task, without the garbage collector."""
    gc.collect()
    gc.disable()
    try:
        return [(kernel(), task.sample()) for task in tasks]
    finally:
        gc.enable()


@dataclass(frozen=True, slots=True)
class Ratio:
    """One case in units of another: medians divided, of what is reported and of the robust samples."""

    suite: str
    title: str
    ratio: float
    robust_ratio: float


def ratios(group: TaskGroup, figures: Sequence[Figure]) -> list[Ratio]:
    """The comparisons of a group from its figures."""
    of = {figure.case: (figure.median, figure.robust_median) for figure in figures}
    pairs = ((title, of[case], of[over]) for title, case, over in group.comparisons)
    return [Ratio(group.suite, title, own[0] / other[0], own[1] / other[1]) for title, own, other in pairs]


@dataclass(frozen=True, slots=True)
class Growth:
    """How a quantity grows along its suite's axis: ``robust_median ~ x ** exponent``.

    `upper` is the same over the upper half of the x alone, where constant costs no longer hide the growth.
    """

    suite: str
    series: str
    exponent: float
    upper: float


def growths(figures: Iterable[Figure]) -> list[Growth]:
    """Exponents of every series of three positive figures or more: least squares on logarithms.

    The series is the case without what follows its last comma (its place on the axis), and the quantity.
    """
    series: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for figure in figures:
        if figure.x > 0:
            case = figure.case.rpartition(", ")[0]
            place = figure.suite, f"{case} {figure.quantity}".strip()
            series.setdefault(place, []).append((figure.x, figure.robust_median))
    found = []
    for (suite, name), points in series.items():
        x, y = zip(*sorted(points), strict=True)
        if len(points) >= 3 and min(y) > 0:
            half = min(len(x) // 2, len(x) - 2)
            found.append(Growth(suite, name, exponent(x, y), exponent(x[half:], y[half:])))
    return found


def exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """Slope of log y over log x."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
