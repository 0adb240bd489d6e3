"""A bench run: its suites one after the other, each group measured and, with a baseline, confirmed."""

from __future__ import annotations

import os
import platform
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import sleep

import numpy as np

from ffseg import __version__
from ffseg.bench import images, processes
from ffseg.bench.gate import Baseline, Slower, confirmed, slower
from ffseg.bench.measure import Fact, Figure, Ratio, Schedule, Skipped, TaskGroup, measure, ratios
from ffseg.errors import FfsegError, UsageError
from ffseg.io.images import OPENCV_VERSION
from ffseg.schema.kinds import nearest_word

SUITES: dict[str, Callable[[Schedule, Path], Iterator[TaskGroup | Skipped]]] = {
    **{suite.__name__: suite for suite in (images.patches, images.size, images.method, images.scenes, images.peers)},
    **{suite.__name__: suite for suite in (processes.batch, processes.startup, processes.memory, processes.shards)},
}
"""What gives the groups of each suite; its files go to the folder named."""
PAUSE_S = 2.0
"""Before a figure that looks slow is measured again: what keeps the machine busy may have ended by then."""
PACKAGES = ("typer", "SimpleITK")

Note = Callable[[str], None]


@dataclass(slots=True)
class Measurements:
    """All that a run measured."""

    quick: bool
    started: str
    machine: Mapping[str, object]
    versions: Mapping[str, str]
    figures: list[Figure] = field(default_factory=list)
    facts: dict[str, Mapping[str, Fact]] = field(default_factory=dict)
    comparisons: list[Ratio] = field(default_factory=list)
    skipped: list[Skipped] = field(default_factory=list)
    slower: list[Slower] = field(default_factory=list)


def check(order: Schedule) -> None:
    """Look at what is ordered, before anything is made or measured.

    Raises
    ------
    UsageError
        If a suite does not exist, or the images cannot be used.
    """
    unknown = next((name for name in order.suites if name not in SUITES), None)
    if unknown is not None:
        near = nearest_word(unknown, tuple(SUITES)) or f"; choose from {', '.join(SUITES)}"
        raise UsageError(f"--suite: there is no suite '{unknown}'{near}")
    if order.images is not None:
        images.check(order)


def run_bench(
    order: Schedule, note: Note, baseline: Baseline | None = None, keep: Callable[[Measurements], object] | None = None
) -> Measurements:
    """Measure everything ordered.

    Parameters
    ----------
    order : Schedule
        One that passed `check`.
    note : callable
        Hears what is being measured.
    keep : callable, optional
        Given all that is measured so far after every suite, so that a suite that fails loses nothing but itself.

    Raises
    ------
    UsageError
        If the baseline and this run have no figure in common.
    FfsegError
        If a suite fails or `keep` does; with exit code 3 once something was measured.
    """
    outcome = Measurements(order.quick, datetime.now(UTC).isoformat(timespec="seconds"), _machine(), _versions())
    try:
        with tempfile.TemporaryDirectory(prefix="ffseg-bench-") as folder:
            for name in dict.fromkeys(order.suites or SUITES):
                work = Path(folder) / name  # of its own: suites make folders and files of the same names
                work.mkdir()
                for part in SUITES[name](order, work):
                    _take(part, outcome, order, note, baseline)
                if keep is not None:
                    keep(outcome)
    except FfsegError as error:
        error.exit_code = 3 if outcome.figures else error.exit_code  # 2 says that nothing was run
        raise
    if baseline is not None:
        if not any(figure.key in baseline.steady for figure in outcome.figures):
            raise UsageError("--baseline: it has no figure of this run; make it with the same suites and images")
        outcome.slower = slower(outcome.figures, baseline)
    return outcome


def _take(
    part: TaskGroup | Skipped, outcome: Measurements, order: Schedule, note: Note, baseline: Baseline | None
) -> None:
    if isinstance(part, Skipped):
        outcome.skipped.append(part)
        note(f"{part.suite}: {part.name} skipped, {part.reason}")
        return
    note(f"{part.suite}: {part.name}")
    effort = (1 if order.quick else order.rounds, order.budget_s)
    figures = measure(part, *effort)
    if baseline is not None:

        def again(keys: frozenset[str]) -> list[Figure]:
            note(f"{part.suite}: {part.name} again, {len(keys)} of its figures look slow")
            sleep(0.0 if outcome.quick else PAUSE_S)
            tasks = [task for task in part.tasks if f"{part.suite}/{task.case}/{task.quantity}" in keys]
            return measure(replace(part, tasks=tasks), *effort)

        figures = confirmed(figures, baseline, again)
    outcome.figures += figures
    outcome.comparisons += ratios(part, figures)
    outcome.facts[f"{part.suite}/{part.name}"] = part.facts


def _machine() -> dict[str, object]:
    """Processor, cores, system and load, nothing that names the machine or its user."""
    lines: list[str] = []
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return {
        "processor": next(names, platform.processor()),
        "architecture": platform.machine(),
        "cores": os.cpu_count(),
        "system": platform.system(),
        "load": [round(value, 2) for value in os.getloadavg()] if hasattr(os, "getloadavg") else [],
    }


def _versions() -> dict[str, str]:
    """Versions of ffseg, Python and what takes part in the measuring; packages that are absent are left out."""
    found = {"ffseg": __version__, "python": platform.python_version()}
    found |= {"numpy": np.__version__, "opencv": OPENCV_VERSION}
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found
