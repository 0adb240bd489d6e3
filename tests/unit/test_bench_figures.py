"""Figures, exponents and the gate of ``ffseg bench`` on samples whose truth is known."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from ffseg.bench.gate import FORMAT, RETRIES, Baseline, confirmed, read_baseline, slower
from ffseg.bench.measure import Figure, exponent, growths
from ffseg.errors import UsageError

MAX_RATIO = 1.15
"""The default of the command: half way between an unchanged figure and one slowed down by 30 % and more."""
ROUNDS = 15


def figure(
    values: Sequence[float], kernel: Sequence[float], case: str = "a", x: float = 0.0, unit: str = "ms"
) -> Figure:
    numbers, reference = tuple(map(float, values)), tuple(map(float, kernel))
    return Figure("suite", case, "work", unit, x, numbers, numbers, reference)


def busy(rng: np.random.Generator, duration: float, kernel: float = 2.0) -> Figure:
    """A figure measured on a busy machine: jitter, a clock that drifts, and one round in three delayed up to threefold."""
    drift = np.linspace(1.0, rng.uniform(0.8, 1.25), ROUNDS)

    def disturbed(length: float) -> list[float]:
        late = np.where(rng.random(ROUNDS) < 1 / 3, rng.uniform(1, 3, ROUNDS), 1.0)
        return list(length * drift * (1 + rng.exponential(0.03, ROUNDS)) * late)

    return figure(disturbed(duration), disturbed(kernel))


def test_median_ratio_and_quartiles() -> None:
    found = figure([4.0, 2.0, 3.0, 1.0, 5.0], [2.0, 1.0, 3.0])
    assert (found.median, found.quartiles, found.kernel, found.ratio) == (3.0, (2.0, 3.0, 4.0), 2.0, 1.5)
    assert found.key == "suite/a/work"


def test_memory_is_not_divided_by_the_kernel() -> None:
    found = figure([7.0, 8.0, 9.0], [2.0, 2.0, 2.0], unit="MB")
    assert found.ratio is None
    assert found.steady == 8.0


def test_steady_ignores_single_disturbed_rounds_and_a_drifting_clock() -> None:
    drift = np.repeat([1.0, 1.5, 0.7], 5)
    values, kernel = 6.0 * drift, 2.0 * drift
    values[[0, 6, 13]] *= 10
    kernel[[1, 2, 8]] *= 10
    assert figure(values, kernel).steady == pytest.approx(3.0, rel=1e-12)


def test_steady_ignores_one_block_disturbed_as_a_whole() -> None:
    values = np.full(15, 6.0)
    values[5:10] *= 3
    assert figure(values, np.full(15, 2.0)).steady == 3.0


@pytest.mark.parametrize("power", [0.0, 1.0, 1.5])
def test_exponent_of_a_power_law(power: float) -> None:
    x = np.array([10.0, 30.0, 100.0, 1000.0])
    assert exponent(x, 0.2 * x**power) == pytest.approx(power, abs=1e-12)


def test_growth_tells_a_constant_cost_from_a_growing_one() -> None:
    x = [10.0, 100.0, 1000.0, 10_000.0]
    series = [figure([500 + value**2], [1.0], f"circles, {value:g}", value) for value in x]
    (growth,) = growths(series)
    assert growth.series == "circles work"
    assert growth.exponent < 1.8 < 1.999 < growth.upper <= 2.0


def gate(rng: np.random.Generator, baseline: Baseline, duration: float) -> bool:
    """Does a run on a busy machine pass?"""
    figures = confirmed([busy(rng, duration)], baseline, lambda keys: [busy(rng, duration)])
    return not slower(figures, baseline)


@pytest.mark.parametrize("seed", range(20))
def test_gate_passes_ten_unchanged_noisy_runs_and_catches_each_of_ten_slowed_by_30_percent(seed: int) -> None:
    rng = np.random.default_rng(seed)
    baseline = Baseline({"suite/a/work": busy(rng, 5.0).steady}, MAX_RATIO)
    assert all(gate(rng, baseline, 5.0) for _ in range(10))
    assert not any(gate(rng, baseline, 5.0 * 1.3) for _ in range(10))


def test_only_what_looks_slow_is_measured_again_and_all_samples_count() -> None:
    baseline = Baseline({"suite/a/work": 1.0, "suite/b/work": 1.0}, MAX_RATIO)
    asked = []

    def again(keys: frozenset[str]) -> list[Figure]:
        asked.append(keys)
        return [figure([1.1] * 5, [1.0] * 5)]

    slow, quick = figure([2.0] * 5, [1.0] * 5), figure([1.0] * 5, [1.0] * 5, "b")
    first, second = confirmed([slow, quick], baseline, again)
    assert asked == [{"suite/a/work"}] * 2
    assert (first.steady, len(first.values)) == (1.1, 15)  # blocks of 2.0, 1.1 and 1.1
    assert second is quick


def test_what_stays_slow_is_measured_a_few_times_and_named_with_its_ratio() -> None:
    baseline, asked = Baseline({"suite/a/work": 2.0}, MAX_RATIO), []

    def again(keys: frozenset[str]) -> list[Figure]:
        asked.append(keys)
        return [figure([6.0], [2.0])]

    (item,) = slower(confirmed([figure([8.0], [2.0])], baseline, again), baseline)
    assert len(asked) == RETRIES
    assert str(item) == "suite/a/work: 1.50 times the baseline (2.000 -> 3.000 K)"


def test_figures_the_baseline_lacks_pass() -> None:
    assert slower([figure([9.0], [1.0])], Baseline({"suite/b/work": 1.0}, MAX_RATIO)) == []


def document(**changes: object) -> str:
    return json.dumps({"format": FORMAT, "quick": False, "figures": [{"key": "s/a/w", "steady": 2.0}], **changes})


def test_baseline_is_read(tmp_path: Path) -> None:
    (tmp_path / "bench.json").write_text(document())
    assert read_baseline(tmp_path / "bench.json", 1.5, quick=False) == Baseline({"s/a/w": 2.0}, 1.5)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, r"bench\.json cannot be read \(No such file or directory\); give the bench\.json of an earlier run"),
        ("{", r"bench\.json is no bench\.json"),
        ("[]", r"bench\.json is no bench\.json"),
        (document(figures=[{"key": "s/a/w"}]), r"bench\.json is no bench\.json"),
        (document(format=99), r"bench\.json has format 99, not 1; make it anew"),
        (document(quick=True), r"must both be --quick or neither"),
    ],
)
def test_a_baseline_that_cannot_be_used_is_refused(tmp_path: Path, content: str | None, sentence: str) -> None:
    if content is not None:
        (tmp_path / "bench.json").write_text(content)
    with pytest.raises(UsageError, match=sentence):
        read_baseline(tmp_path / "bench.json", 1.5, quick=False)
