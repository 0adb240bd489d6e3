"""``bench.json``, ``bench.csv`` and ``bench.md`` of a bench run."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict

from ffseg.bench.gate import FORMAT
from ffseg.bench.measure import Figure, growths
from ffseg.bench.session import Measurements
from ffseg.io.tables import Cell, csv_table

COLUMNS = (
    "suite", "case", "quantity", "x", "unit", "median", "first_quartile", "third_quartile", "least", "robust_median", "samples",
    "k_ms", "ratio_to_k", "steady",
)  # fmt: skip
SIGNIFICANT = 4
"""Digits of a figure in tables; the samples are whole in ``bench.json``."""


def to_json(outcome: Measurements) -> bytes:
    """The whole run: raw samples, facts, machine and versions."""
    document = {
        "format": FORMAT,
        **asdict(outcome),
        "figures": [_figure(figure) for figure in outcome.figures],
        "growth": [asdict(growth) for growth in growths(outcome.figures)],
    }
    return (json.dumps(document, indent=1, ensure_ascii=False) + "\n").encode("utf-8")


def _figure(figure: Figure) -> dict[str, object]:
    derived = {name: getattr(figure, name) for name in ("key", "median", "robust_median", "steady")}
    values = asdict(figure)
    samples = {name: [round(one, 6) for one in value] for name, value in values.items() if isinstance(value, tuple)}
    return {**derived, "ratio_to_k": figure.ratio, **values, **samples}


def to_csv(outcome: Measurements) -> bytes:
    """One row for each figure."""
    return csv_table(COLUMNS, (_row(figure) for figure in outcome.figures))


def _row(figure: Figure) -> list[Cell]:
    low, median, high = figure.quartiles
    named: list[Cell] = [figure.suite, figure.case, figure.quantity, figure.x or None, figure.unit]
    times = [_short(value) for value in (median, low, high, min(figure.values), figure.robust_median)]
    ratio = None if figure.ratio is None else _short(figure.ratio)
    return [*named, *times, len(figure.values), _short(figure.kernel), ratio, _short(figure.steady)]


def _short(value: float) -> float:
    return float(f"{value:.{SIGNIFICANT}g}")


def to_markdown(outcome: Measurements) -> str:
    """The tables to read."""
    versions = ", ".join(f"{name} {version}" for name, version in outcome.versions.items())
    machine = "{processor}, {cores} cores, load {load}".format_map(outcome.machine)
    lines = ["# ffseg bench", "", f"{outcome.started}; {machine}; {versions}. {HOW}", ""]
    if outcome.quick:
        lines += ["Made with `--quick`: tiny inputs, figures without meaning.", ""]
    if outcome.slower:
        lines += ["## Slower than the baseline", "", *(f"- {item}" for item in outcome.slower), ""]
    for suite in dict.fromkeys(figure.suite for figure in outcome.figures):
        lines += [f"## {suite}", "", *_suite_tables(outcome, suite)]
    if outcome.skipped:
        lines += ["## Skipped", "", *(f"- {part.suite}: {part.name}, {part.reason}" for part in outcome.skipped), ""]
    return "\n".join(lines)


HOW = (
    "K is Gaussian blur, Canny and flood fill of the same grey image, measured in turns with each figure; "
    "median, quartiles and least are wall time; processor time, which waiting for a turn is not in, makes the ratios "
    "to K and the exponents. One OpenCV thread."
)


def _suite_tables(outcome: Measurements, suite: str) -> list[str]:
    figures = [figure for figure in outcome.figures if figure.suite == suite]
    head = ("case", "quantity", "median", "quartiles", "least", "processor", "K ms", "in K")
    lines = _table(head, map(_cells, figures))
    found = [(one.series, f"{one.exponent:.3f}", f"{one.upper:.3f}") for one in growths(figures)]
    lines += _table(("fitted exponents", "all", "upper half"), found)
    ratios = [one for one in outcome.comparisons if one.suite == suite]
    rows = [(one.title, f"{one.ratio:.3f}", f"{one.robust_ratio:.3f}") for one in ratios]
    lines += _table(("ratio of medians", "wall time or memory", "processor time or memory"), rows)
    facts = {key: values for key, values in outcome.facts.items() if key.startswith(f"{suite}/") and values}
    names = list(dict.fromkeys(name for values in facts.values() for name in values))
    cells = [[key.partition("/")[2], *(str(one.get(name, "")) for name in names)] for key, one in facts.items()]
    return lines + _table(("case", *names), cells)


def _cells(figure: Figure) -> list[str]:
    low, median, high = figure.quartiles
    ratio = "" if figure.ratio is None else f"{figure.ratio:.3g}"
    numbers = [f"{median:.4g} {figure.unit}", f"{low:.4g} - {high:.4g}", f"{min(figure.values):.4g}"]
    return [figure.case, figure.quantity, *numbers, f"{figure.robust_median:.4g}", f"{figure.kernel:.3g}", ratio]


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """A Markdown table padded so that it reads as plain text too; nothing where there is no row."""
    cells = [[cell.replace("|", "\\|") for cell in row] for row in (head, *rows)]
    if len(cells) == 1:
        return []
    widths = [max(len(row[column]) for row in cells) for column in range(len(head))]
    cells.insert(1, ["-" * width for width in widths])
    texts = [[cell.ljust(width) for cell, width in zip(row, widths, strict=True)] for row in cells]
    return [*(f"| {' | '.join(row)} |" for row in texts), ""]
