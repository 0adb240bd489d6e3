"""The native pixel features and the forest beside their twins."""

import naive_evidence as naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ffseg.native import _core
from tests.stumps import stump

sides = st.tuples(st.integers(1, 9), st.integers(1, 11))
channels = st.sampled_from([(), (3,), (4,)])
images = hnp.arrays(np.uint8, st.tuples(sides, channels).map(lambda parts: parts[0] + parts[1]))


@st.composite
def starts(draw: st.DrawFn, shape: tuple[int, int]) -> np.ndarray:
    inside = draw(hnp.arrays(np.uint8, shape, elements=st.sampled_from([0, 0, 0, 1])))
    inside[draw(st.integers(0, shape[0] - 1)), draw(st.integers(0, shape[1] - 1))] = 1
    return inside


@st.composite
def coloured(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Planes of L, a, b and a start region."""
    shape = draw(sides)
    whole = draw(hnp.arrays(np.int16, (3, *shape), elements=st.integers(-400, 400)))
    lab = (whole / 4).astype(np.float32)
    lab[0] = np.abs(lab[0])
    return lab, draw(starts(shape))


@st.composite
def hilly(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Heights and a start region; many heights are equal, some beyond the highest level."""
    shape = draw(sides)
    values = st.sampled_from([0.0, 0.25, 0.5, 1.0, 3.75, 40.0, 90.0])
    return draw(hnp.arrays(np.float32, shape, elements=values)), draw(starts(shape))


def made(shape: tuple[int, ...], function: object, *arguments: object) -> np.ndarray:
    out = np.full(shape, np.nan, np.float32)
    function(*arguments, out)  # type: ignore[operator]
    return out


@given(images, st.integers(1, 5))
@settings(max_examples=60)
def test_reduced_colours_are_those_of_the_twin(image: np.ndarray, factor: int) -> None:
    twin = naive.reduced_lab(image, factor)
    # lines between 4096 tabled values: 1e-6 of a cube root near its foot, times 500, twice
    np.testing.assert_allclose(made(twin.shape, _core.evidence_lab, image, factor), twin, rtol=0, atol=2e-2)


def test_lab_of_known_colours() -> None:
    """White, black, and the red of sRGB, whose L, a, b are in every table."""
    image = np.array([[[255, 255, 255], [0, 0, 0], [0, 0, 255]]], np.uint8)
    lab = made((3, 1, 3), _core.evidence_lab, image, 1)
    np.testing.assert_allclose(lab[:, 0].T, [[100, 0, 0], [0, 0, 0], [53.24, 80.09, 67.20]], atol=0.05)


@given(hnp.arrays(np.float32, (1, 40), elements=st.floats(np.float32(1e-30), np.float32(1e30), width=32)))
def test_logarithms_are_those_of_the_c_library(values: np.ndarray) -> None:
    twin = np.log(values.astype(np.float64))
    # half a unit in the last place of the larger part, and what the series leaves out
    np.testing.assert_allclose(made(values.shape, _core.evidence_logarithm, values), twin, rtol=1.2e-7, atol=1.2e-7)


@given(hnp.arrays(np.float32, (1, 40), elements=st.floats(-200, 200, width=32)))
def test_exponentials_are_those_of_the_c_library(values: np.ndarray) -> None:
    twin = np.exp(np.clip(values, -87, 87).astype(np.float64))
    # half a unit in the last place of each of the two factors
    np.testing.assert_allclose(made(values.shape, _core.evidence_exponential, values), twin, rtol=1.2e-7)


@given(hilly())
@settings(max_examples=60)
def test_thinned_planes_and_their_largest(drawn: tuple[np.ndarray, np.ndarray]) -> None:
    plane, _ = drawn
    planes, small = np.stack([plane, plane + 1, -plane]), tuple(-(-length // 2) for length in plane.shape)
    thin = made((2, *small), _core.evidence_thin, [planes[2], planes[0]])
    np.testing.assert_array_equal(thin, planes[[2, 0], ::2, ::2])
    padded = np.pad(plane, [(0, length % 2) for length in plane.shape], mode="edge")
    blocks = padded.reshape(small[0], 2, small[1], 2)
    np.testing.assert_array_equal(made(small, _core.evidence_steepest, plane), blocks.max(axis=(1, 3)))


def test_planes_of_other_sizes_or_none_are_not_thinned() -> None:
    plane, other = np.zeros((2, 2), np.float32), np.zeros((2, 3), np.float32)
    for planes, shape, why in (
        ([], (0, 1, 1), "no plane"),
        ([plane, other], (2, 1, 1), "differ in size"),
        ([plane], (1, 2, 1), "differ in size"),
        ([plane], (2, 1, 1), "more or fewer planes"),
    ):
        with pytest.raises(ValueError, match=why):
            made(shape, _core.evidence_thin, planes)


@given(hilly(), st.integers(1, 4), st.integers(1, 3), st.tuples(st.integers(1, 40), st.integers(1, 40)))
@settings(max_examples=60)
def test_enlarged_is_linear(
    drawn: tuple[np.ndarray, np.ndarray], factor: int, stride: int, shape: tuple[int, int]
) -> None:
    plane, _ = drawn
    found = made(shape, _core.evidence_enlarge, plane, factor, stride)
    middles = [(np.arange(length) * stride + 0.5) * factor - 0.5 for length in plane.shape]
    wide = np.stack([np.interp(np.arange(shape[1]), middles[1], row) for row in plane])
    twin = np.stack([np.interp(np.arange(shape[0]), middles[0], column) for column in wide.T], axis=1)
    np.testing.assert_allclose(found, twin, rtol=0, atol=1e-4)  # single precision: values up to 90


@pytest.mark.parametrize("sigma", [0.7, 1.5, 3.0])
def test_a_pixel_is_smoothed_alike_in_wide_and_narrow_planes(sigma: float) -> None:
    """Pixels of wide planes are worked on side by side, and must have the bits of each by itself."""
    plane = np.random.default_rng(7).normal(0, 40, (30, 150)).astype(np.float32)
    found, reach = made(plane.shape, _core.evidence_blur, plane, sigma), int(np.ceil(3 * sigma))
    for x in range(reach, plane.shape[1] - reach):
        narrow = plane[:, x - reach : x + reach + 1]
        for part in (narrow, np.pad(narrow, [(0, 0), (16 - reach, 0)], mode="edge")):
            alone = made(part.shape, _core.evidence_blur, np.ascontiguousarray(part), sigma)
            np.testing.assert_array_equal(alone[:, -reach - 1], found[:, x])


@given(coloured(), st.floats(0.2, 7))
@settings(max_examples=40)
def test_texture_is_that_of_the_twin(drawn: tuple[np.ndarray, np.ndarray], sigma: float) -> None:
    lab, _ = drawn
    twin = naive.texture(lab, sigma)
    found = made(twin.shape, _core.evidence_texture, lab, sigma)
    # single precision: values up to 100, squares of slopes up to 2500 before they are smoothed, roots of their
    # rounding errors where they cancel
    np.testing.assert_allclose(found[:3], twin[:3], rtol=0, atol=1e-3)
    np.testing.assert_allclose(found[3:6], twin[3:6], rtol=1e-4, atol=1e-3)
    np.testing.assert_allclose(found[6:8], twin[6:8], rtol=1e-4, atol=2e-3)


@given(coloured(), st.floats(0.2, 7))
@settings(max_examples=40)
def test_colour_is_the_texture_that_does_not_tell_of_shapes(drawn: tuple[np.ndarray, np.ndarray], sigma: float) -> None:
    lab, _ = drawn
    whole = made((8, *lab.shape[1:]), _core.evidence_texture, lab, sigma)
    np.testing.assert_array_equal(made((4, *lab.shape[1:]), _core.evidence_colour, lab, sigma), whole[[0, 1, 2, 5]])


@given(coloured(), st.floats(0.5, 10))
@settings(max_examples=60)
def test_colour_from_the_start_is_that_of_the_twin(drawn: tuple[np.ndarray, np.ndarray], floor: float) -> None:
    lab, inside = drawn
    twin = naive.relative(lab.astype(np.float64), inside, floor)
    found = made(twin.shape, _core.evidence_relative, lab, inside, floor, lab)
    some = np.ascontiguousarray(lab[:, ::2, ::2])
    few = made((4, *some.shape[1:]), _core.evidence_relative, lab, inside, floor, some)
    np.testing.assert_array_equal(few, found[:, ::2, ::2])
    np.testing.assert_allclose(found, twin, rtol=1e-5, atol=1e-4)


@given(coloured())
@settings(max_examples=60)
def test_likelihood_is_that_of_the_twin(drawn: tuple[np.ndarray, np.ndarray]) -> None:
    lab, inside = drawn
    twin = naive.likelihood(lab, inside)
    np.testing.assert_allclose(made(twin.shape, _core.evidence_likelihood, lab, inside), twin, rtol=1e-5, atol=1e-5)


@given(hilly(), st.sampled_from([0.25, 0.01, 1.0]))
@settings(max_examples=100)
def test_barrier_is_that_of_the_twin(drawn: tuple[np.ndarray, np.ndarray], step: float) -> None:
    heights, inside = drawn
    twin = naive.barrier(heights, inside, step)
    found = made(twin.shape, _core.evidence_barrier, heights, inside, step)
    np.testing.assert_allclose(found, twin, rtol=1e-6, atol=1e-6)


@given(hilly(), st.sampled_from([0.25, 0.01, 1.0]), st.integers(1, 30))
@settings(max_examples=100)
def test_way_is_that_of_the_twin(drawn: tuple[np.ndarray, np.ndarray], step: float, least: int) -> None:
    heights, inside = drawn
    twin = naive.geodesic(heights, inside, step, least)
    found = made(twin.shape, _core.evidence_geodesic, heights, inside, step, least)
    np.testing.assert_allclose(found, twin, rtol=1e-6, atol=1e-6)


def test_without_a_start_all_is_beyond_the_highest_barrier() -> None:
    planes = made((5, 2, 3), _core.evidence_barrier, np.zeros((2, 3), np.float32), np.zeros((2, 3), np.uint8), 0.01)
    np.testing.assert_allclose(planes[0], 40.95)


@st.composite
def forests(draw: st.DrawFn) -> dict[str, np.ndarray]:
    """Random trees, of one leaf up to 32."""
    arrays: dict[str, list] = {name: [] for name in ("feature", "threshold", "left", "right", "root", "value")}
    for _ in range(draw(st.integers(1, 5))):
        arrays["root"].append(grown(arrays, draw(st.integers(1, 32)), draw(st.randoms(use_true_random=False))))
    kinds = {"threshold": np.float32, "value": np.float32}
    return {name: np.array(values, kinds.get(name, np.int32)) for name, values in arrays.items()}


def grown(arrays: dict[str, list], leaves: int, random: object) -> int:
    """Add a tree of so many leaves; returns its root."""
    if leaves == 1:
        arrays["value"].append(random.uniform(-2, 2))  # type: ignore[attr-defined]
        return -len(arrays["value"])
    node, left = len(arrays["feature"]), random.randint(1, leaves - 1)  # type: ignore[attr-defined]
    arrays["feature"].append(random.randint(0, 3))  # type: ignore[attr-defined]
    arrays["threshold"].append(random.choice([-1.0, 0.0, 0.5, 2.0]))  # type: ignore[attr-defined]
    arrays["left"].append(0)
    arrays["right"].append(0)
    arrays["left"][node] = grown(arrays, left, random)
    arrays["right"][node] = grown(arrays, leaves - left, random)
    return node


@given(forests(), st.tuples(st.integers(1, 3), st.integers(1, 70)), st.randoms(use_true_random=False))
@settings(max_examples=100)
def test_forest_is_that_of_the_twin(arrays: dict[str, np.ndarray], shape: tuple[int, int], random: object) -> None:
    choices = [-1.0, 0.0, 0.5, 2.0, 7.0, np.nan, np.inf, -np.inf]  # thresholds are hit exactly
    values = [random.choice(choices) for _ in range(4 * shape[0] * shape[1])]  # type: ignore[attr-defined]
    planes = np.array(values, np.float32).reshape(4, *shape)
    forest = _core.EvidenceForest(**arrays, features=4)
    assert forest.trees == len(arrays["root"])
    found = made(shape, forest.score, planes)
    for y, x in np.ndindex(shape):
        assert found[y, x] == np.float32(naive.forest(arrays, planes[:, y, x]))


STUMP = stump("b", 0.5, 1.0, ("a", "b")).arrays


NO_FORESTS = {
    "a feature that there is not": [("feature", [4]), ("feature", [-1])],
    "threshold is not finite": [("threshold", [np.nan])],
    "a node is absent or has two places": [("left", [0]), ("left", [7]), ("root", [0, 0])],
    "a leaf is absent or has two places": [("right", [-1]), ("right", [-(2**31)])],
    "a node or a leaf belongs to no tree": [("root", []), ("value", [1, 2, 3])],
    "leaf is not finite": [("value", [1, np.inf])],
    "arrays of the nodes differ in size": [("feature", [1, 1])],
}


@pytest.mark.parametrize(("name", "values", "sentence"), [(*one, s) for s in NO_FORESTS for one in NO_FORESTS[s]])
def test_what_is_no_forest_is_refused(name: str, values: list[float], sentence: str) -> None:
    arrays = {**STUMP, name: np.array(values, STUMP[name].dtype)}
    with pytest.raises(ValueError, match=sentence):
        _core.EvidenceForest(**arrays, features=4)


def test_a_tree_of_33_leaves_is_refused() -> None:
    nodes = np.arange(32, dtype=np.int32)
    chain = {"feature": 0 * nodes, "left": -1 - nodes, "right": np.append(nodes[1:], np.int32(-33)), "root": nodes[:1]}
    chain |= {"threshold": np.zeros(32, np.float32), "value": np.zeros(33, np.float32)}
    with pytest.raises(ValueError, match="more than 32 leaves"):
        _core.EvidenceForest(**chain, features=1)


@given(coloured(), st.floats(0.01, 2), st.floats(0.5, 20), st.integers(0, 12))
@settings(max_examples=60)
def test_diffusion_is_the_twins(drawn: tuple[np.ndarray, np.ndarray], kept: float, contrast: float, steps: int) -> None:
    lab, inside = drawn
    values = 14 * inside.astype(np.float32) - 7
    system, twin = naive.neighbours(lab, kept, contrast), values.ravel().astype(np.float64)
    for _ in range(steps):
        twin = (kept * values.ravel() - (system - np.diag(np.diag(system))) @ twin) / np.diag(system)
    found = made(inside.shape, _core.evidence_diffuse, values, lab, kept, contrast, steps)
    np.testing.assert_allclose(found.ravel(), twin, rtol=0, atol=1e-4)  # single precision, values up to 7


def test_diffusion_ends_where_the_energy_is_least() -> None:
    lab = np.random.default_rng(5).normal(50, 3, (3, 7, 9)).astype(np.float32)
    values = np.zeros((7, 9), np.float32)
    values[2:4, 3:6] = 5
    least = np.linalg.solve(naive.neighbours(lab, 0.2, 4.0), 0.2 * values.ravel().astype(np.float64))
    found = made((7, 9), _core.evidence_diffuse, values, lab, 0.2, 4.0, 1000)
    np.testing.assert_allclose(found.ravel(), least, rtol=0, atol=1e-4)
