"""Figures of a bench run: samples, medians, ratios to K and fitted exponents."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

BLOCK = 5
"""Rounds whose smallest samples are compared: a disturbance that spares one round of five costs nothing."""


@dataclass(frozen=True, slots=True)
class Figure:
    """Samples of one quantity and of K, taken in turns.

    Attributes
    ----------
    suite, case, quantity : str
    unit : str
        ``ms``, ``MB`` or ``B/px``.
    x : float
        Place on the suite's axis, 0 when there is none.
    values, robust : tuple of float
        What is reported, and what the gate compares (see ``measure.Sample``).
    kernel_values, kernel_robust : tuple of float
        The same of K, milliseconds.
    """

    suite: str
    case: str
    quantity: str
    unit: str
    x: float
    values: tuple[float, ...]
    robust: tuple[float, ...]
    kernel_values: tuple[float, ...]
    kernel_robust: tuple[float, ...]

    @property
    def key(self) -> str:
        """Name of the figure in tables and baselines."""
        return f"{self.suite}/{self.case}/{self.quantity}"

    @property
    def median(self) -> float:
        """Median of the samples."""
        return float(np.median(self.values))

    @property
    def quartiles(self) -> tuple[float, float]:
        """First and third quartile of the samples."""
        low, high = np.quantile(self.values, [0.25, 0.75])
        return float(low), float(high)

    @property
    def robust_median(self) -> float:
        """Median of the robust samples, which exponents and ratios are made of."""
        return float(np.median(self.robust))

    @property
    def kernel(self) -> float:
        """Median of K in milliseconds, robust."""
        return float(np.median(self.kernel_robust))

    @property
    def ratio(self) -> float | None:
        """Robust median in units of K; None for what is no time."""
        return self.robust_median / self.kernel if self.unit == "ms" else None

    def joined(self, other: Figure) -> Figure:
        """The figure with the samples of another measurement of it."""
        samples = ("values", "robust", "kernel_values", "kernel_robust")
        return replace(self, **{name: getattr(self, name) + getattr(other, name) for name in samples})

    @property
    def steady(self) -> float:
        """What the gate compares: the median over blocks of rounds of the least sample divided by the least K.

        The least of a block drops what disturbs single rounds; the same block for both drops drifts of the clock; the
        median drops a block that was disturbed as a whole. For what is no time: the median.
        """
        if self.unit != "ms":
            return self.robust_median
        blocks = np.array_split(np.arange(len(self.robust)), max(1, len(self.robust) // BLOCK))
        robust, kernel = np.array(self.robust), np.array(self.kernel_robust)
        return float(np.median([robust[block].min() / kernel[block].min() for block in blocks]))


@dataclass(frozen=True, slots=True)
class Compared:
    """One case in units of another: medians divided.

    Attributes
    ----------
    suite, title : str
    ratio : float
        Of what is reported.
    robust_ratio : float
        Of the robust samples.
    """

    suite: str
    title: str
    ratio: float
    robust_ratio: float


@dataclass(frozen=True, slots=True)
class Growth:
    """How a quantity grows along its suite's axis: ``robust_median ~ x ** exponent``.

    Attributes
    ----------
    suite, series : str
    exponent : float
        Least squares on logarithms over all x.
    upper : float
        The same over the upper half of the x alone, where constant costs no longer hide the growth.
    """

    suite: str
    series: str
    exponent: float
    upper: float

    def __str__(self) -> str:
        return f"{self.series}: exponent {self.exponent:.2f}, upper half {self.upper:.2f}"


def series_of(figures: Iterable[Figure]) -> dict[tuple[str, str], list[Figure]]:
    """Figures with a place on an axis by suite and series, in the order of x.

    The series is the case without what follows its last comma (the place itself), and the quantity.
    """
    found: dict[tuple[str, str], list[Figure]] = {}
    for figure in figures:
        if figure.x > 0:
            case = figure.case.rpartition(", ")[0]
            found.setdefault((figure.suite, f"{case} {figure.quantity}".strip()), []).append(figure)
    return {name: sorted(series, key=lambda figure: figure.x) for name, series in found.items()}


def growths(figures: Iterable[Figure]) -> list[Growth]:
    """Exponents of every series of three positive figures or more."""
    found = []
    for (suite, name), series in series_of(figures).items():
        x, y = [figure.x for figure in series], [figure.robust_median for figure in series]
        if len(series) < 3 or min(y) <= 0:
            continue
        half = min(len(x) // 2, len(x) - 2)
        found.append(Growth(suite, name, exponent(x, y), exponent(x[half:], y[half:])))
    return found


def exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """Slope of log y over log x."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
