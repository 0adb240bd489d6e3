"""The gate: which figures of a run are slower than those of a baseline, measured in K of their own runs."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ffseg.bench.measure import Figure
from ffseg.errors import UsageError
from ffseg.io.files import printable

FORMAT = 1
"""Of ``bench.json``; a baseline of another format cannot be compared."""
RETRIES = 4
"""A figure that looks slow is measured again so often, and judged by all its samples: what disturbs the machine passes,
a slowdown stays. The least of the measurements would be kinder, also to a slowdown."""


@dataclass(frozen=True, slots=True)
class Baseline:
    """``Figure.steady`` of an earlier run by key, and how many times that a figure may be."""

    steady: Mapping[str, float]
    max_ratio: float


@dataclass(frozen=True, slots=True)
class Slower:
    """A figure that missed the gate, and how many times its baseline it is."""

    key: str
    before: float
    now: float
    unit: str
    ratio: float

    def __str__(self) -> str:
        unit = "K" if self.unit == "ms" else self.unit
        return f"{self.key}: {self.ratio:.2f} times the baseline ({self.before:.3f} -> {self.now:.3f} {unit})"


def read_baseline(path: Path, max_ratio: float, *, quick: bool) -> Baseline:
    """Figures of a ``bench.json``."""
    name = f"--baseline: {printable(path)}"
    if os.path.exists(path) and not os.path.isfile(path):  # a pipe would be waited for
        raise UsageError(f"{name} is not a regular file; give the bench.json of an earlier run")
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["format"] != FORMAT:
            raise UsageError(f"{name} has format {document['format']}, not {FORMAT}; make it anew with ffseg bench")
        if bool(document["quick"]) != quick:
            raise UsageError(f"{name} and this run must both be --quick or neither; make it anew")
        steady = {figure["key"]: float(figure["steady"]) for figure in document["figures"]}
    except OSError as error:
        raise UsageError(f"{name} cannot be read ({error.strerror}); give the bench.json of an earlier run") from error
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise UsageError(f"{name} is no bench.json; give that of an earlier run") from error
    return Baseline({key: value for key, value in steady.items() if value > 0}, max_ratio)


def slower(figures: Iterable[Figure], baseline: Baseline) -> list[Slower]:
    """Figures above the limit, the worst first; those the baseline lacks are passed over."""
    known = ((figure, baseline.steady[figure.key]) for figure in figures if figure.key in baseline.steady)
    found = [Slower(one.key, before, one.steady, one.unit, one.steady / before) for one, before in known]
    return sorted((item for item in found if item.ratio > baseline.max_ratio), key=lambda item: -item.ratio)


def confirmed(
    figures: Sequence[Figure], baseline: Baseline, again: Callable[[frozenset[str]], Sequence[Figure]]
) -> list[Figure]:
    """The figures in their order, those above the limit measured again with `again` and given all their samples."""
    known = {figure.key: figure for figure in figures}
    for _ in range(RETRIES):
        suspects = frozenset(item.key for item in slower(known.values(), baseline))
        if not suspects:
            break
        for figure in again(suspects):
            known[figure.key] = known[figure.key].joined(figure)
    return list(known.values())
