"""``bench.json``, ``bench.csv``, ``bench.md`` and the plots of a bench run."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict

import numpy as np

from ffseg.bench.gate import FORMAT
from ffseg.bench.measure import Figure, Growth, growths, series_of
from ffseg.bench.session import Outcome
from ffseg.io.tables import Cell, csv_table

COLUMNS = (
    "suite", "case", "quantity", "x", "unit", "median", "first_quartile", "third_quartile", "least", "robust_median", "samples",
    "k_ms", "ratio_to_k", "steady",
)  # fmt: skip
SIGNIFICANT = 4
"""Digits of a figure in tables; the samples are whole in ``bench.json``."""


def to_json(outcome: Outcome) -> bytes:
    """The whole run: raw samples, facts, machine and versions."""
    document = {
        "format": FORMAT,
        "quick": outcome.quick,
        "started": outcome.started,
        "machine": dict(outcome.machine),
        "versions": dict(outcome.versions),
        "figures": [_figure(figure) for figure in outcome.figures],
        "comparisons": [asdict(item) for item in outcome.comparisons],
        "growth": [asdict(growth) for growth in growths(outcome.figures)],
        "facts": {name: dict(facts) for name, facts in outcome.facts.items()},
        "skipped": [asdict(skipped) for skipped in outcome.skipped],
        "slower": [asdict(item) for item in outcome.slower],
    }
    return (json.dumps(document, indent=1, ensure_ascii=False) + "\n").encode("utf-8")


def _figure(figure: Figure) -> dict[str, object]:
    derived = {name: getattr(figure, name) for name in ("key", "median", "robust_median", "ratio", "steady")}
    derived["ratio_to_k"] = derived.pop("ratio")
    values = asdict(figure)
    samples = {name: [round(one, 6) for one in value] for name, value in values.items() if isinstance(value, tuple)}
    return {**derived, **values, **samples}


def to_csv(outcome: Outcome) -> bytes:
    """One row for each figure."""
    return csv_table(COLUMNS, (_row(figure) for figure in outcome.figures))


def _row(figure: Figure) -> list[Cell]:
    low, high = figure.quartiles
    named: list[Cell] = [figure.suite, figure.case, figure.quantity, figure.x or None, figure.unit]
    times = [_short(value) for value in (figure.median, low, high, min(figure.values), figure.robust_median)]
    ratio = None if figure.ratio is None else _short(figure.ratio)
    return [*named, *times, len(figure.values), _short(figure.kernel), ratio, _short(figure.steady)]


def _short(value: float) -> float:
    return float(f"{value:.{SIGNIFICANT}g}")


def to_markdown(outcome: Outcome) -> str:
    """The tables to read."""
    lines = ["# ffseg bench", "", _circumstances(outcome), ""]
    if outcome.quick:
        lines += ["Made with `--quick`: tiny inputs, figures without meaning.", ""]
    if outcome.slower:
        lines += ["## Slower than the baseline", "", *(f"- {item}" for item in outcome.slower), ""]
    for suite in dict.fromkeys(figure.suite for figure in outcome.figures):
        lines += _suite_section(outcome, suite)
    if outcome.skipped:
        lines += ["## Skipped", "", *(f"- {part.suite}: {part.name}, {part.reason}" for part in outcome.skipped), ""]
    return "\n".join(lines)


def _circumstances(outcome: Outcome) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in outcome.versions.items())
    machine = outcome.machine
    return (
        f"{outcome.started}; {machine['processor']}, {machine['cores']} cores, load {machine['load']}; {versions}. "
        "K is Gaussian blur, Canny and flood fill of the same grey image, measured in turns with each figure; "
        "median, quartiles and least are wall time; processor time, which waiting for a turn is not in, makes the ratios "
        "to K and the exponents. One OpenCV thread."
    )


def _suite_section(outcome: Outcome, suite: str) -> list[str]:
    figures = [figure for figure in outcome.figures if figure.suite == suite]
    head = ("case", "quantity", "median", "quartiles", "least", "processor", "K ms", "in K")
    lines = [f"## {suite}", "", *_table(head, (_cells(figure) for figure in figures)), ""]
    found = [growth for growth in growths(figures) if growth.suite == suite]
    if found:
        rows = ((growth.series, f"{growth.exponent:.3f}", f"{growth.upper:.3f}") for growth in found)
        lines += ["Fitted exponents:", "", *_table(("series", "all", "upper half"), rows), ""]
    ratios = [item for item in outcome.comparisons if item.suite == suite]
    if ratios:
        rows = ((item.title, f"{item.ratio:.3f}", f"{item.robust_ratio:.3f}") for item in ratios)
        lines += [*_table(("ratio of medians", "wall time or memory", "processor time or memory"), rows), ""]
    facts = {name: facts for name, facts in outcome.facts.items() if name.startswith(f"{suite}/") and facts}
    if facts:
        names = list(dict.fromkeys(name for values in facts.values() for name in values))
        cells = (
            [key.partition("/")[2], *(str(values.get(name, "")) for name in names)] for key, values in facts.items()
        )
        lines += [*_table(("case", *names), cells), ""]
    return lines


def _cells(figure: Figure) -> list[str]:
    low, high = figure.quartiles
    ratio = "" if figure.ratio is None else f"{figure.ratio:.3g}"
    numbers = [f"{figure.median:.4g} {figure.unit}", f"{low:.4g} - {high:.4g}", f"{min(figure.values):.4g}"]
    numbers += [f"{figure.robust_median:.4g}"]
    return [figure.case, figure.quantity, *numbers, f"{figure.kernel:.3g}", ratio]


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """A Markdown table padded so that it reads as plain text too."""
    cells = [[cell.replace("|", "\\|") for cell in row] for row in (head, *rows)]
    widths = [max(len(row[column]) for row in cells) for column in range(len(head))]
    lines = [
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |" for row in cells
    ]
    return [lines[0], "|" + "|".join("-" * (width + 2) for width in widths) + "|", *lines[1:]]


AXES = {"patches": "patches", "size": "pixels", "memory": "pixels"}
"""What x is in each suite that is plotted."""


def plots(figures: Sequence[Figure]) -> dict[str, bytes]:
    """One SVG file for each suite with a fitted series, by file name; needs matplotlib (extra ``plot``)."""
    fitted = growths(figures)
    found = {}
    for suite in AXES:
        shown = [growth for growth in fitted if growth.suite == suite]
        if shown:
            found[f"{suite}.svg"] = _plot(suite, shown, figures)
    return found


def _plot(suite: str, shown: Sequence[Growth], figures: Sequence[Figure]) -> bytes:
    import matplotlib as mpl
    from matplotlib.figure import Figure as Canvas

    series = series_of(figures)
    with mpl.rc_context({"svg.hashsalt": "ffseg", "svg.fonttype": "none"}):  # the same bytes for the same figures
        canvas = Canvas(figsize=(7.0, 4.6), layout="constrained")
        axes = canvas.add_subplot()
        for growth in shown:
            points = series[growth.suite, growth.series]
            x, y = [figure.x for figure in points], [figure.robust_median for figure in points]
            (line,) = axes.plot(x, y, "o", label=str(growth))
            offset = np.mean(np.log(y) - growth.exponent * np.log(x))
            axes.plot(x, np.exp(offset) * np.power(x, growth.exponent), color=line.get_color(), linewidth=1)
        axes.set(xscale="log", yscale="log", xlabel=AXES[suite], ylabel=points[0].unit, title=f"ffseg bench: {suite}")
        axes.grid(visible=True, which="major", alpha=0.3)
        axes.legend(fontsize="small")
        buffer = io.BytesIO()
        canvas.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()
