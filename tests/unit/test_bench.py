"""``ffseg bench``: figures, exponents and the gate on samples whose truth is known, and the suites in their tiny form."""

import json
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from ffseg.bench import drawing, images, processes, programs
from ffseg.bench.gate import FORMAT, RETRIES, Baseline, confirmed, read_baseline, slower
from ffseg.bench.measure import Figure, Schedule, exponent, growths
from ffseg.bench.session import SUITES, Measurements, check, run_bench
from ffseg.errors import FfsegError, UsageError
from ffseg.image.reference import one_thread, reference_kernel
from ffseg.io.masks import encode_mask
from ffseg.plugins import PEERS
from tests.masks import read_mask

MAX_RATIO = 1.15
"""The default of the command: half way between an unchanged figure and one slowed down by 30 % and more."""
ROUNDS = 15


def figure(values: Sequence[float], kernel: Sequence[float], case: str = "a", x: float = 0, unit: str = "ms") -> Figure:
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
    assert (len(asked), str(item)) == (RETRIES, "suite/a/work: 1.50 times the baseline (2.000 -> 3.000 K)")


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


OTHERS = {"peers", "batch", "startup", "memory", "shards"}
"""Suites whose quantities depend on what is installed, or are those of processes."""


def quick(*suites: str, folder: Path | None = None) -> Measurements:
    order = Schedule(suites, quick=True, images=folder)
    check(order)
    return run_bench(order, lambda text: None)


def test_kernel_fills_what_the_edges_enclose() -> None:
    grey = np.full((100, 120), 50, np.uint8)
    cv2.circle(grey, (60, 50), 30, 200, -1)
    # Canny lies on the circle or a pixel beside it: the fill is its inside but for a ring of two pixels at most.
    assert np.pi * 27.5**2 < reference_kernel(grey) < np.pi * 30.5**2


def test_one_thread_is_given_back() -> None:
    before = cv2.getNumThreads()
    with one_thread():
        assert cv2.getNumThreads() == 1
    assert cv2.getNumThreads() == before


@pytest.mark.parametrize("seed", range(4))
def test_drawn_scene_is_the_same_at_every_size(seed: int) -> None:
    small, large = drawing.draw(seed, 200, 150), drawing.draw(seed, 800, 600)
    assert large.start_radius == 4 * small.start_radius
    shrunk = large.ground.reshape(150, 4, 200, 4).mean(axis=(1, 3))
    # Where a small pixel lies whole inside or outside in the large scene, the small scene says the same.
    whole = (shrunk == 0) | (shrunk == 1)
    assert whole.mean() > 0.9
    assert (small.ground[whole] == (shrunk[whole] == 1)).all()


def test_drawn_scene_leaves_the_start_free_and_the_rest_mixed() -> None:
    for seed in range(20):
        scene = drawing.draw(seed)
        y, x = np.mgrid[:600, :800]
        assert scene.ground[np.hypot(x - 399.5, y - 299.5) < scene.start_radius + 20].all()
        assert 0.1 < scene.ground.mean() < 0.9


def test_patch_contours_have_as_many_patches_as_the_figure_says() -> None:
    (*_, group) = images.patches(Schedule(quick=True), Path())
    assert group.facts == {"circles": 10}
    assert [(t.x, t.case) for t in group.tasks] == [(100, f"{how}, 100") for how in ("still", "filtered", "merging")]


@pytest.fixture(scope="module")
def whole() -> Measurements:
    """Every suite after the other, as the plain command runs them: what one leaves may not be in the way of the next."""
    return quick()


def test_every_suite_measures_what_it_says(whole: Measurements) -> None:
    assert list(dict.fromkeys(figure.suite for figure in whole.figures)) == list(SUITES)
    quantities = {(figure.suite, figure.quantity) for figure in whole.figures if figure.suite not in OTHERS}
    stages = {(suite, stage) for suite in ("size", "method", "scenes") for stage in ("edges", "evolve", "segment")}
    assert quantities == {("patches", "iteration"), *stages}
    assert all(figure.median > 0 for figure in whole.figures)
    assert all(figure.ratio > 0 for figure in whole.figures if figure.unit == "ms")
    assert all(item.ratio > 0 for item in whole.comparisons)
    assert {values["stopped"] for name, values in whole.facts.items() if "scenes" in name} == {"converged"}
    assert whole.slower == []


def test_peers_are_measured_beside_the_free_form(whole: Measurements) -> None:
    names = [name for name in images.BESIDE if PEERS[name].installed]
    assert "cv_edges_opened" in names
    cases = [case for name in names for case in (f"small, freeform beside {name}", f"small, {name}")]
    assert [figure.case for figure in whole.figures if figure.suite == "peers"] == cases
    assert len([item for item in whole.comparisons if item.suite == "peers"]) == len(names)
    assert len([part for part in whole.skipped if part.suite == "peers"]) == len(images.BESIDE) - len(names)


def test_the_truth_of_an_image_must_say_what_is_inside(tmp_path: Path) -> None:
    """As it does for every other command: levels of no known meaning and other sizes are refused."""
    scene = drawing.draw(5, 160, 120)
    (tmp_path / "one.png").write_bytes(cv2.imencode(".png", scene.image)[1].tobytes())
    levels = np.where(scene.ground, np.uint8(200), np.uint8(0))
    small = np.zeros((60, 80), np.uint8)
    for truth, said in ((levels, "holds the levels 0, 200"), (small, "has 80x60, the image 160x120")):
        cv2.imwrite(str(tmp_path / "one_truth.png"), truth)
        with pytest.raises(FfsegError, match=said):
            quick("scenes", folder=tmp_path)


def test_scenes_of_a_folder_are_scored_by_their_truth(tmp_path: Path) -> None:
    scene = drawing.draw(2, 240, 180)
    cv2.imwrite(str(tmp_path / "one.png"), scene.image)
    (tmp_path / "one_truth.png").write_bytes(encode_mask(scene.ground))
    outcome = quick("scenes", folder=tmp_path)
    assert [figure.case for figure in outcome.figures] == ["one"] * 3
    assert 0 < outcome.facts["scenes/one"]["iou"] <= 1


def test_a_folder_without_images_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="holds no image"):
        quick("scenes", folder=tmp_path)
    with pytest.raises(UsageError, match="there is no folder"):
        quick("scenes", folder=tmp_path / "absent")


def test_images_whose_figures_would_have_one_key_are_refused(tmp_path: Path) -> None:
    """The gate compared the figures of one with those of the other."""
    for name in ("a.png", "a.jpg", "b.png"):
        cv2.imwrite(str(tmp_path / name), drawing.draw(2, 80, 60).image)
    with pytest.raises(UsageError, match=r"figures of a\.\w+ and a\.\w+ would have the same keys"):
        quick("scenes", folder=tmp_path)


def test_a_bad_image_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), drawing.draw(2, 80, 60).image)
    (tmp_path / "b.png").write_text("no image")
    with pytest.raises(UsageError, match=r"--images: .*b\.png"):
        check(Schedule(("method", "scenes"), quick=True, images=tmp_path))


def test_holes_are_those_of_the_mask() -> None:
    """The snake's contour closes round islands to slits: none is an inner contour."""
    _, group = images.method(Schedule(methods=("snake",)), Path())
    assert (group.name, group.facts["holes"]) == ("complex by snake", 10)


def test_bare_pipeline_writes_a_mask_for_each_image(tmp_path: Path) -> None:
    scene, folder, out = drawing.draw(2, 160, 120), tmp_path / "images", tmp_path / "out"
    folder.mkdir()
    for name in ("a", "b"):
        cv2.imwrite(str(folder / f"{name}.png"), scene.image)
    np.save(tmp_path / "masks.npy", scene.ground[None])
    programs.bare(str(folder), str(tmp_path / "masks.npy"), str(out))
    assert sorted(path.name for path in out.iterdir()) == ["a.png", "b.png"]
    assert (read_mask(out / "b.png") == scene.ground).all()


def test_a_child_that_fails_is_named_with_its_last_words() -> None:
    with pytest.raises(FfsegError, match=r"ended with exit code 3: no such luck"):
        processes.run_child(("-c", "import sys; print('no such luck', file=sys.stderr); sys.exit(3)"))


def test_memory_of_a_child_is_its_own() -> None:
    ballast = np.ones(60_000_000, np.uint8)  # of this process: it must not be counted
    empty = processes.peak_memory(lambda: ("-c", "pass"))()[0]
    filled = processes.peak_memory(lambda: ("-c", "x = b'x' * 50_000_000"))()[0]
    assert ballast[0] == 1
    assert empty < 40
    assert 45 < filled - empty < 60
