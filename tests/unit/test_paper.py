"""The printed method: what it finds and says of itself, and each step against its naive twin."""

from itertools import pairwise
from math import cos, pi, sin

import naive_freeform as naive
import numpy as np
import pytest
from numpy.typing import NDArray
from runs import ROOT

import ffseg
from ffseg.native import _core
from tests.discs import overlap
from tests.masks import read_mask


@pytest.mark.parametrize(("name", "least"), [("simple", 0.995), ("complex", 0.97), ("toy", 0.95)])
def test_overlap_on_the_samples(name: str, least: float) -> None:
    """It stops at edges and passes obstacles; measured 0.9982, 0.9777 and 0.9588."""
    image = ffseg.read_image(ROOT / "samples" / f"{name}.png")
    result = ffseg.segment(image, ffseg.load_params("paper"))
    assert overlap(result.mask, read_mask(ROOT / "samples" / "truth" / f"{name}.png")) > least
    assert (result.stats.stop_reason, result.stats.initial_points) == ("converged", 39)
    assert result.stats.final_points == sum(len(c.control_points) for c in result.contours)
    assert result.stats.flips >= result.num_holes


def test_balloon_is_cut_and_its_sign_kept() -> None:
    """It grows by two pixels an iteration in open ground, or closes in by two."""
    image = np.full((200, 200), 128, np.uint8)
    for balloon, radius in ((8.0, 40 + 2 * 10), (-8.0, 40 - 2 * 10)):
        fixed = {"contour.max_iterations": 10, "contour.refine": False, "init.radius": 40}
        result = ffseg.segment(image, ffseg.load_params("paper", {**fixed, "contour.balloon": balloon}))
        assert result.mask.sum() == pytest.approx(np.pi * radius**2, rel=0.01)
        assert result.stats.stop_reason == "max_iterations"


def test_diffusion_slows_it_down() -> None:
    """On a slope of one grey level per pixel F_diff is 1/2, whatever p (Eq. 8)."""
    image = np.tile(np.arange(200, dtype=np.uint8), (200, 1))
    overrides = {"contour.max_iterations": 10, "contour.patches": 20, "edges.canny": [50, 100], "init.radius": 40}
    for exponent in (1, 2, 8):
        result = ffseg.segment(image, ffseg.load_params("paper", {**overrides, "edges.exponent": exponent}))
        assert result.mask.sum() == pytest.approx(np.pi * 50**2, rel=0.01)


def test_more_patches_than_there_may_be_end_it() -> None:
    """What crosses itself everywhere grows without end: here it starts with as many."""
    over = {"init.radius": 150, "contour.patches": 60_000, "contour.balloon": 2.0}
    result = ffseg.segment(np.full((400, 400), 128, np.uint8), ffseg.load_params("paper", over))
    assert (result.stats.iterations, result.stats.stop_reason) == (1, "max_patches")
    assert result.score <= 0.5


@pytest.mark.parametrize("noise", [20.0, 40.0])
def test_noise_ends_with_a_stated_reason(noise: float) -> None:
    """A front that crosses itself everywhere flips within its budget, and is not swept for ever within one iteration."""
    grey = 128 + np.random.default_rng(1).normal(0, noise, (120, 160))
    over = {"edges.canny": [30, 60], "init.radius": 20, "contour.split_threshold": 4}
    result = ffseg.segment(np.clip(grey, 0, 255).astype(np.uint8), ffseg.load_params("paper", over))
    assert result.stats.stop_reason in {"converged", "max_patches", "budget"}


def test_the_budget_ends_flips_within_an_iteration() -> None:
    """Each flip sorts anew: thousands of them in one iteration would not end in time."""
    loops = [circle((60 + 3 * i, 60), 30, 40, 3) for i in range(8)]
    blank, flips = np.zeros((120, 160), np.uint16), []
    for budget in (0, 325):  # 320 patches are moved
        made = core(loops, 40.0, blank, refine=False, budget=budget)
        made.advance(1)
        flips.append(made.counts()["flips"])
    assert 0 < flips[1] < flips[0]


CLOSE = 1e-9
"""px: V^-1 of degree 6 loses two digits of sixteen, coordinates have three before the point, evaluation sums a dozen."""
SIZE = (90, 120)
BLANK = np.zeros(SIZE, np.uint16)


def chain(points: list[tuple[float, float]], degree: int) -> naive.Component:
    """A closed component of control points, as many as fill whole patches."""
    count = len(points)
    return [[points[(i + k) % count] for k in range(degree + 1)] for i in range(0, count, degree)]


def circle(
    center: tuple[float, float], radius: float, patches: int, degree: int, turn: int = 1, first: float = 0.0
) -> naive.Component:
    """Control points on a circle, from the angle `first` on."""
    angles = [first + turn * 2 * pi * i / (patches * degree) for i in range(patches * degree)]
    return chain([(center[0] + radius * cos(a), center[1] + radius * sin(a)) for a in angles], degree)


def random_chain(rng: np.random.Generator, degree: int) -> naive.Component:
    """A ring with noise: from nearly a circle to what crosses itself everywhere."""
    patches, noise = int(rng.integers(3, 14)), float(rng.choice([0.5, 4.0, 15.0]))
    ring = circle((60.0, 45.0), float(rng.uniform(8, 35)), patches, degree, int(rng.choice([-1, 1])))
    moved = [(x + rng.normal(0, noise), y + rng.normal(0, noise)) for patch in ring for x, y in patch[:-1]]
    return chain([(float(x), float(y)) for x, y in moved], degree)


def core(
    components: list[naive.Component], threshold: float = 12.0, gradient: NDArray[np.uint16] = BLANK, **more: object
) -> _core.PaperEvolution:
    options = _core.PaperOptions()
    options.degree, options.split_threshold = len(components[0][0]) - 1, threshold
    options.balloon, options.exponent, options.sigma = 2.0, 2.0, 1.5
    options.refine = options.topology = True
    options.max_iterations = 1000
    points = [point for component in components for patch in component for point in patch[:-1]]
    sizes = [len(component) * options.degree for component in components]
    edges = more.pop("edges", np.zeros(gradient.shape, np.uint8))
    domain = more.pop("domain", None)
    for name, value in more.items():
        setattr(options, name, value)
    offsets = np.cumsum([0, *sizes], dtype=np.int64)
    return _core.PaperEvolution(np.array(points), offsets, gradient, edges, domain, options)


def found(evolution: _core.PaperEvolution, degree: int) -> list[naive.Component]:
    points, offsets = evolution.contours()
    return [chain([tuple(point) for point in points[a:b].tolist()], degree) for a, b in pairwise(offsets)]


def same(ours: list[naive.Component], twins: list[naive.Component], tolerance: float = CLOSE) -> None:
    assert [len(component) for component in ours] == [len(component) for component in twins]
    for one, other in zip(ours, twins, strict=True):
        np.testing.assert_allclose(np.array(one), np.array(other), rtol=0, atol=tolerance)


CASES = [(seed, degree) for degree in range(1, 7) for seed in range(8)]


@pytest.mark.parametrize(("seed", "degree"), CASES)
def test_split(seed: int, degree: int) -> None:
    components = [random_chain(np.random.default_rng([seed, degree]), degree) for _ in range(2)]
    evolution = core(components, 20.0)
    evolution.split()
    same(found(evolution, degree), naive.split(components, 20.0))
    assert evolution.counts()["splits"] == sum(map(len, found(evolution, degree))) - sum(map(len, components))


@pytest.mark.parametrize(("seed", "degree"), CASES)
def test_prune(seed: int, degree: int) -> None:
    components = [random_chain(np.random.default_rng([seed, degree, 1]), degree) for _ in range(2)]
    evolution = core(components, 80.0)
    evolution.prune()
    same(found(evolution, degree), naive.prune(components, 80.0))


def test_random_chains_are_pruned() -> None:
    """The property above is about something: most of its chains lose patches, and keep two."""
    chains = [random_chain(np.random.default_rng([seed, degree, 1]), degree) for seed, degree in CASES]
    assert sum(len(naive.prune([c], 80.0)[0]) < len(c) for c in chains) > len(chains) / 2
    assert min(len(naive.prune([c], 1e6)[0]) for c in chains) == 2


@pytest.mark.parametrize(("seed", "degree"), CASES)
def test_filter_finds_every_pair_that_crosses(seed: int, degree: int) -> None:
    rng = np.random.default_rng([seed, degree, 2])
    components = [random_chain(rng, degree), random_chain(rng, degree)]
    ours = [((a, b), (c, d)) for a, b, c, d in core(components).meeting()]
    twins = naive.pairs(components)
    assert [pair for pair in twins if pair in ours] == ours  # the same order, and none that the printed test refuses

    def crossing(pairs: list[tuple[naive.Place, naive.Place]]) -> list[tuple[naive.Place, naive.Place]]:
        return [(a, b) for a, b in pairs if naive.crossings(components[a[0]][a[1]], components[b[0]][b[1]])]

    assert crossing(ours) == crossing(twins)
    places = [(c, i) for c, component in enumerate(components) for i in range(len(component))]
    everyone = [(a, b) for a in places for b in places if a < b and not adjacent(components, a, b)]
    assert sorted(crossing(ours)) == crossing(everyone)


def adjacent(components: list[naive.Component], a: naive.Place, b: naive.Place) -> bool:
    return a[0] == b[0] and (a[1] - b[1]) % len(components[a[0]]) in (1, len(components[a[0]]) - 1)


@pytest.mark.parametrize(("seed", "degree"), CASES)
def test_flip(seed: int, degree: int) -> None:
    rng = np.random.default_rng([seed, degree, 3])
    components = [random_chain(rng, degree) for _ in range(int(rng.integers(1, 3)))]
    evolution = core(components)
    evolution.flip()
    inner: list[naive.Component] = []
    flips = naive.flip(components, inner)
    same(found(evolution, degree), components + inner)
    assert (evolution.counts()["flips"], evolution.counts()["evolving"]) == (flips, len(components))


def pinched(degree: int) -> naive.Component:
    """Two fronts that have met: the upper run bulges through the lower one in the middle."""
    points = [(110.0 - 10 * i, 30.0 if 3 < i < 7 else 20.0) for i in range(11)]
    points += [(10.0 + 10 * i, 25.0 if 3 < i < 7 else 40.0) for i in range(11)]
    return chain(points[: len(points) // degree * degree], degree)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_flip_separates(degree: int) -> None:
    ring = pinched(degree)
    evolution = core([ring])
    evolution.flip()
    parts = found(evolution, degree)
    assert evolution.counts()["flips"] >= 1
    assert len(parts) == evolution.counts()["flips"] + 1
    area = abs(naive.area(parts[0]))
    assert all(abs(naive.area(part)) <= area for part in parts[1:])
    assert all(part[i][-1] == part[(i + 1) % len(part)][0] for part in parts for i in range(len(part)))


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_a_flip_merges(degree: int) -> None:
    patches = 18 // degree  # as many control points: half a patch is exchanged at each side
    one, two = circle((40, 45), 21, patches, degree), circle((80, 45), 21, patches, degree)
    evolution = core([one, two])
    evolution.flip()
    counts = evolution.counts()
    assert (counts["merges"], counts["evolving"], counts["reversals"]) == (1, 1, 0)
    together = abs(naive.area(one)) + abs(naive.area(two))
    assert 0.95 * together < naive.area(found(evolution, degree)[0]) < 1.05 * together


@pytest.mark.parametrize("turn", [1, -1])
def test_a_component_the_other_way_round_is_turned(turn: int) -> None:
    """Remark on orientation: overlapping patches that run the same way cannot be joined before one is turned round."""
    one = circle((40, 45), 21, 5, 3, first=-pi / 5)  # the middle of a patch on the right, of the other on the left
    two = circle((78, 45), 21, 5, 3)
    evolution = core([one, two if turn == 1 else naive.turned(two)])
    evolution.flip()
    counts = evolution.counts()
    assert (counts["flips"], counts["merges"], counts["reversals"]) == (1, 1, 0 if turn == 1 else 1)
    expected, inner = [one, two if turn == 1 else naive.turned(two)], list[naive.Component]()
    naive.flip(expected, inner)
    same(found(evolution, 3), expected + inner)
    assert naive.area(expected[0]) > 0.9 * (naive.area(one) + naive.area(two))


def twin_scene(seed: int) -> tuple[NDArray[np.uint16], NDArray[np.uint8], NDArray[np.uint8]]:
    """A ring of edges round the start, an obstacle within it, and noise on the gradient."""
    rng = np.random.default_rng([seed, 9])
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(float)
    outside = np.abs(np.hypot(x - 60, y - 45) - rng.uniform(28, 38))
    inside = np.abs(np.hypot(x - rng.uniform(70, 80), y - 45) - 4)
    ridge = 20 * np.exp(-0.5 * (np.minimum(outside, inside) / 1.5) ** 2) + rng.uniform(0, 0.6, SIZE)
    domain = (y > rng.uniform(0, 20)).astype(np.uint8)
    return np.rint(32 * ridge).astype(np.uint16), (np.minimum(outside, inside) < 0.6).astype(np.uint8) * 255, domain


@pytest.mark.parametrize("balloon", [2.0, -1.0])
@pytest.mark.parametrize("seed", range(6))
def test_whole_evolution(seed: int, balloon: float) -> None:
    gradient, edges, domain = twin_scene(seed)
    degree = 1 + seed % 6
    components = [circle((60, 45), 10 if balloon > 0 else 42, 6, degree)]
    evolution = core(components, gradient=gradient, edges=edges, domain=domain, balloon=balloon)
    field = naive.Field((gradient / 32).tolist(), (edges > 0).tolist(), (domain > 0).tolist())
    inner: list[naive.Component] = []
    for _ in range(24):
        components = naive.prune(naive.split(components, 12.0), 12.0)
        naive.flip(components, inner)
        moved = naive.move(components, field, balloon, 2.0, 1.5)
        assert evolution.step() == moved
    # rounding grows from one iteration to the next, by the slope of the edge force
    same(found(evolution, degree), components + inner, 1e-6)


def test_the_evolution_stops_when_almost_nothing_moves() -> None:
    gradient, edges, domain = twin_scene(1)
    evolution = core([circle((60, 45), 10, 6, 3)], gradient=gradient, edges=edges, domain=domain)
    while evolution.advance(10):
        pass
    assert evolution.stop_reason == "converged"
    moved, samples = evolution.step()
    assert moved * 100 <= samples


def test_options_and_contours_out_of_range_are_refused() -> None:
    ring = circle((60, 45), 10, 6, 3)
    for name, value in (("balloon", np.inf), ("sigma", 0.0), ("exponent", 0.5), ("max_iterations", -1)):
        with pytest.raises(ValueError, match="out of range"):
            core([ring], **{name: value})
    with pytest.raises(ValueError, match="two patches"):
        core([ring[:1]])
    with pytest.raises(ValueError, match="differ in size"):
        core([ring], edges=np.zeros((3, 3), np.uint8))


@pytest.mark.parametrize("patches", [50, 200, 800])
def test_sorting_takes_n_log_n_comparisons(patches: int) -> None:
    """Lemma 4, at the initialisation: no more than merging sorted halves takes."""
    evolution = core([circle((60, 45), 30, patches, 3)], threshold=1e3)
    evolution.flip()
    counts = evolution.counts()
    assert 0 < counts["comparisons"] <= patches * np.log2(patches)
    assert counts["flips"] == 0
