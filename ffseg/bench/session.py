"""A bench run: its suites one after the other, each group measured and, with a baseline, confirmed."""

from __future__ import annotations

import os
import platform
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import sleep

import numpy as np

from ffseg import __version__
from ffseg.bench.gate import Baseline, Slower, confirmed, slower
from ffseg.bench.measure import Compared, Effort, Fact, Figure, Group, Settings, Skipped, compared, measure
from ffseg.errors import UsageError
from ffseg.image.reference import opencv_version
from ffseg.plugins import SEGMENTERS
from ffseg.schema.kinds import nearest_word

SUITES = {
    "patches": "patches",
    **dict.fromkeys(("size", "method", "scenes", "peers"), "pictures"),
    **dict.fromkeys(("batch", "startup", "memory", "shards"), "processes"),
}
"""Name of each suite and the module beside this one that holds its function."""
PAUSE_S = 2.0
"""Before a figure that looks slow is measured again: what keeps the machine busy may have ended by then."""
PACKAGES = ("typer", "matplotlib", "scikit-image", "SimpleITK", "scikit-fmm")

Note = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Order:
    """What to run: suites out of `SUITES` (none stands for all), with how much effort, on what, against which baseline."""

    suites: Sequence[str] = ()
    effort: Effort = field(default_factory=Effort)
    images: Path | None = None
    quick: bool = False
    baseline: Baseline | None = None
    methods: Sequence[str] = tuple(SEGMENTERS)


@dataclass(slots=True)
class Outcome:
    """All that a run measured."""

    quick: bool
    started: str
    machine: Mapping[str, object]
    versions: Mapping[str, str]
    figures: list[Figure] = field(default_factory=list)
    facts: dict[str, Mapping[str, Fact]] = field(default_factory=dict)
    comparisons: list[Compared] = field(default_factory=list)
    skipped: list[Skipped] = field(default_factory=list)
    slower: list[Slower] = field(default_factory=list)


def run_bench(order: Order, note: Note, keep: Callable[[Outcome], object] | None = None) -> Outcome:
    """Measure everything ordered.

    Parameters
    ----------
    order : Order
    note : callable
        Hears what is being measured.
    keep : callable, optional
        Given all that is measured so far after every suite, so that a suite that fails loses nothing but itself.

    Raises
    ------
    UsageError
        If a suite does not exist, or the baseline and this run have no figure in common.
    """
    unknown = next((name for name in order.suites if name not in SUITES), None)
    if unknown is not None:
        near = nearest_word(unknown, tuple(SUITES)) or f"; choose from {', '.join(SUITES)}"
        raise UsageError(f"--suite: there is no suite '{unknown}'{near}")
    outcome = Outcome(order.quick, datetime.now(UTC).isoformat(timespec="seconds"), _machine(), _versions())
    with tempfile.TemporaryDirectory(prefix="ffseg-bench-") as folder:
        for name in dict.fromkeys(order.suites or SUITES):
            work = Path(folder) / name  # of its own: suites make folders and files of the same names
            work.mkdir()
            suite: Callable[[Settings], Iterator[Group | Skipped]]
            suite = getattr(import_module(f"ffseg.bench.{SUITES[name]}"), name)
            for part in suite(Settings(work, order.images, order.quick, order.methods)):
                _take(part, outcome, order, note)
            if keep is not None:
                keep(outcome)
    if order.baseline is not None:
        if not any(figure.key in order.baseline.steady for figure in outcome.figures):
            raise UsageError("--baseline: it has no figure of this run; make it with the same suites and images")
        outcome.slower = slower(outcome.figures, order.baseline)
    return outcome


def _take(part: Group | Skipped, outcome: Outcome, order: Order, note: Note) -> None:
    if isinstance(part, Skipped):
        outcome.skipped.append(part)
        note(f"{part.suite}: {part.name} skipped, {part.reason}")
        return
    note(f"{part.suite}: {part.name}")
    effort = replace(order.effort, rounds=1) if order.quick else order.effort
    figures = measure(part, effort)
    if order.baseline is not None:

        def again(keys: frozenset[str]) -> list[Figure]:
            note(f"{part.suite}: {part.name} again, {len(keys)} of its figures look slow")
            sleep(0.0 if outcome.quick else PAUSE_S)
            tasks = [task for task in part.tasks if f"{part.suite}/{task.case}/{task.quantity}" in keys]
            return measure(replace(part, tasks=tasks), effort)

        figures = confirmed(figures, order.baseline, again)
    outcome.figures += figures
    outcome.comparisons += compared(part, figures)
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
    found |= {"numpy": np.__version__, "opencv": opencv_version()}
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found
