"""Timed tasks, measured in turns with the fixed kernel K."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from ffseg.bench.figures import Compared, Figure
from ffseg.image.reference import one_thread, reference_kernel

Fact = str | int | float


@dataclass(frozen=True, slots=True)
class Sample:
    """One measurement.

    Attributes
    ----------
    value : float
        What is reported: milliseconds of wall time, or memory.
    robust : float
        What the gate compares: processor time where the work is computing, because waiting for a turn on a busy
        machine is not in it; else the same as `value`.
    """

    value: float
    robust: float


Timer = Callable[[], Sample]


def timed(work: Callable[[], object], per: float = 1.0) -> Timer:
    """A timer of a call, in milliseconds divided by `per`."""
    return timed_fresh(lambda: work, per)


def timed_fresh(make: Callable[[], Callable[[], object]], per: float = 1.0) -> Timer:
    """A timer of a call that is made anew, untimed, for every sample."""

    def sample() -> Sample:
        work = make()
        processor, begin = process_time(), perf_counter()
        work()
        end, processor_end = perf_counter(), process_time()
        return Sample((end - begin) * 1e3 / per, (processor_end - processor) * 1e3 / per)

    return sample


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """One quantity to measure.

    Attributes
    ----------
    case : str
        What it is measured on.
    quantity : str
        What is measured, such as ``evolve``.
    sample : Timer
        Takes one measurement.
    x : float
        Place on the suite's axis (patches, pixels, jobs); 0 when there is none.
    unit : str
        ``ms``, ``MB`` or ``B/px``.
    """

    case: str
    quantity: str
    sample: Timer
    x: float = 0.0
    unit: str = "ms"


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two cases of a group whose medians are divided; that of `minus`, when there is one, is taken from the first."""

    title: str
    case: str
    over: str
    minus: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Tasks that are measured in turns.

    Attributes
    ----------
    suite : str
    name : str
    grey : ndarray of uint8, shape (H, W)
        The image K runs on.
    tasks : sequence of Task
    facts : mapping
        What else is known of the case: counts, scores.
    comparisons : sequence of Comparison
    rounds : int
        Rounds that are enough, 0 for as many as the run is told.
    """

    suite: str
    name: str
    grey: NDArray[np.uint8]
    tasks: Sequence[Task]
    facts: Mapping[str, Fact]
    comparisons: Sequence[Comparison] = ()
    rounds: int = 0


@dataclass(frozen=True, slots=True)
class Skipped:
    """A part of a suite that cannot run here, and why."""

    suite: str
    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class Effort:
    """How long to measure: rounds of all tasks of a group, fewer once `budget_s` is spent, but one at least."""

    rounds: int = 15
    budget_s: float = 20.0


def measure(group: Group, effort: Effort) -> list[Figure]:
    """Measure the tasks of a group in turns, K before each of them; the first round warms up and does not count."""
    kernel = timed(lambda: reference_kernel(group.grey))
    taken: list[list[tuple[Sample, Sample]]] = [[] for _ in group.tasks]
    with one_thread():
        begin = perf_counter()
        _round(group.tasks, kernel)
        while len(taken[0]) < (min(group.rounds, effort.rounds) or effort.rounds):
            for samples, pair in zip(taken, _round(group.tasks, kernel), strict=True):
                samples.append(pair)
            if perf_counter() - begin > effort.budget_s:
                break
    return [_figure(group.suite, task, pairs) for task, pairs in zip(group.tasks, taken, strict=True)]


def _round(tasks: Sequence[Task], kernel: Timer) -> list[tuple[Sample, Sample]]:
    """One sample of K and one of the task, for every task, without the garbage collector."""
    gc.collect()
    gc.disable()
    try:
        return [(kernel(), task.sample()) for task in tasks]
    finally:
        gc.enable()


def _figure(suite: str, task: Task, pairs: Sequence[tuple[Sample, Sample]]) -> Figure:
    return Figure(
        suite=suite,
        case=task.case,
        quantity=task.quantity,
        unit=task.unit,
        x=task.x,
        values=tuple(sample.value for _, sample in pairs),
        robust=tuple(sample.robust for _, sample in pairs),
        kernel_values=tuple(kernel.value for kernel, _ in pairs),
        kernel_robust=tuple(kernel.robust for kernel, _ in pairs),
    )


def compared(group: Group, figures: Sequence[Figure]) -> list[Compared]:
    """The comparisons of a group from its figures."""
    of = {figure.case: figure for figure in figures}
    found = []
    for part in group.comparisons:
        value, robust = of[part.case].median, of[part.case].robust_median
        if part.minus:
            value, robust = value - of[part.minus].median, robust - of[part.minus].robust_median
        over = of[part.over]
        found.append(Compared(group.suite, part.title, value / over.median, robust / over.robust_median))
    return found
