"""A bench run: its suites one after the other, each group measured and, with a baseline, confirmed."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from time import sleep

from ffseg.bench.figures import Compared, Figure
from ffseg.bench.gate import Baseline, Slower, confirmed, slower
from ffseg.bench.machine import machine, versions
from ffseg.bench.measure import Effort, Fact, Group, Skipped, compared, measure
from ffseg.bench.suites.settings import Settings
from ffseg.errors import UsageError
from ffseg.plugins import SEGMENTERS
from ffseg.schema.kinds import nearest_word

SUITES = {
    "patches": "patches",
    "size": "pictures",
    "method": "pictures",
    "scenes": "pictures",
    "peers": "pictures",
    "batch": "processes",
    "startup": "processes",
    "memory": "processes",
    "shards": "shards",
}
"""Name of each suite and the module under ``suites`` that holds its function."""
QUICK_ROUNDS = 1
PAUSE_S = 2.0
"""Before a figure that looks slow is measured again: what keeps the machine busy may have ended by then."""

Suite = Callable[[Settings], Iterator[Group | Skipped]]
Note = Callable[[str], None]
Keep = Callable[["Outcome"], object]


@dataclass(frozen=True, slots=True)
class Order:
    """What to run.

    Attributes
    ----------
    suites : sequence of str
        Names out of ``SUITES``; empty for all.
    effort : Effort
    images : Path, optional
        For the suite ``scenes``.
    quick : bool
        Tiny inputs and one round.
    baseline : Baseline, optional
    methods : sequence of str
        Of the suite ``method``.
    """

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
    machine: Mapping[str, object] = field(default_factory=machine)
    versions: Mapping[str, str] = field(default_factory=versions)
    figures: list[Figure] = field(default_factory=list)
    facts: dict[str, Mapping[str, Fact]] = field(default_factory=dict)
    comparisons: list[Compared] = field(default_factory=list)
    skipped: list[Skipped] = field(default_factory=list)
    slower: list[Slower] = field(default_factory=list)


def run_bench(order: Order, note: Note, keep: Keep | None = None) -> Outcome:
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
    names = _checked(order.suites)
    effort = replace(order.effort, rounds=QUICK_ROUNDS) if order.quick else order.effort
    outcome = Outcome(order.quick, datetime.now(UTC).isoformat(timespec="seconds"))
    with tempfile.TemporaryDirectory(prefix="ffseg-bench-") as folder:
        for name in names:
            work = Path(folder) / name  # of its own: suites make folders and files of the same names
            work.mkdir()
            settings = Settings(work, order.images, order.quick, order.methods)
            suite: Suite = getattr(import_module(f"ffseg.bench.suites.{SUITES[name]}"), name)
            for part in suite(settings):
                _take(part, outcome, effort, order.baseline, note)
            if keep is not None:
                keep(outcome)
    if order.baseline is not None:
        _judge(outcome, order.baseline)
    return outcome


def _checked(names: Sequence[str]) -> tuple[str, ...]:
    unknown = [name for name in names if name not in SUITES]
    if unknown:
        near = nearest_word(unknown[0], tuple(SUITES)) or f"; choose from {', '.join(SUITES)}"
        raise UsageError(f"--suite: there is no suite '{unknown[0]}'{near}")
    return tuple(dict.fromkeys(names)) or tuple(SUITES)


def _take(part: Group | Skipped, outcome: Outcome, effort: Effort, baseline: Baseline | None, note: Note) -> None:
    if isinstance(part, Skipped):
        outcome.skipped.append(part)
        note(f"{part.suite}: {part.name} skipped, {part.reason}")
        return
    note(f"{part.suite}: {part.name}")
    figures = measure(part, effort)
    if baseline is not None:

        def again(keys: frozenset[str]) -> list[Figure]:
            note(f"{part.suite}: {part.name} again, {len(keys)} of its figures look slow")
            sleep(0.0 if outcome.quick else PAUSE_S)
            tasks = [task for task in part.tasks if f"{part.suite}/{task.case}/{task.quantity}" in keys]
            return measure(replace(part, tasks=tasks), effort)

        figures = confirmed(figures, baseline, again)
    outcome.figures += figures
    outcome.comparisons += compared(part, figures)
    outcome.facts[f"{part.suite}/{part.name}"] = part.facts


def _judge(outcome: Outcome, baseline: Baseline) -> None:
    if not any(figure.key in baseline.steady for figure in outcome.figures):
        raise UsageError("--baseline: it has no figure of this run; make it with the same suites and images")
    outcome.slower = slower(outcome.figures, baseline)
