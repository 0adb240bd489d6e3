"""Plots of what grows along an axis, with the fitted exponents; needs matplotlib (extra ``plot``)."""

from __future__ import annotations

import io
from collections.abc import Sequence
from importlib.util import find_spec

import numpy as np

from ffseg.bench.figures import Figure, Growth, growths, series_of

AXES = {"patches": "patches", "size": "pixels", "memory": "pixels"}
"""What x is in each suite that is plotted."""
SIZE = (7.0, 4.6)
"""Inches."""


def available() -> bool:
    """Whether matplotlib is installed."""
    return find_spec("matplotlib") is not None


def plots(figures: Sequence[Figure]) -> dict[str, bytes]:
    """One SVG file for each suite with a fitted series, by file name."""
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
        canvas = Canvas(figsize=SIZE, layout="constrained")
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
