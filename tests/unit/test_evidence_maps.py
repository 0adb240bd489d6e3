"""Maps of evidence as edges: perfect, even, soft and wrong ones."""

import numpy as np
import pytest

import ffseg
from ffseg.evidence.maps import at_level, evidence_edges, strength_edges
from ffseg.image.edges import edge_map
from ffseg.metrics import iou
from ffseg.native import _core
from ffseg.parameters import Edges
from ffseg.samples.scenes import SCENES


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("seen", [True, False], ids=["image", "flat"])
def test_a_perfect_map_gives_the_truth(name: str, seen: bool) -> None:
    scene = SCENES[name]()
    image = scene.image if seen else np.full(scene.truth.shape, 100, np.uint8)
    edges = evidence_edges((scene.truth == 255).astype(np.float32), edge_map(image, Edges()))
    found = ffseg.segment(image, {"init.center": [400, 300], "init.radius": 40}, edges=edges)
    assert iou(found.mask, scene.truth) >= 0.999


@pytest.mark.parametrize("value", [0.0, 0.3, 0.5, 0.9, 1.0])
def test_an_even_map_adds_nothing(value: float) -> None:
    edges = edge_map(SCENES["simple"]().image, Edges())
    even = np.full(edges.edges.shape, value, np.float32)
    assert evidence_edges(even, edges) is edges
    assert strength_edges(even, edges) is edges


X, EVEN = np.arange(200, dtype=np.float32), np.full((150, 200), 100, np.uint8)
LEFT = {"init.center": [60, 75], "init.radius": 20}


def as_map(row: np.ndarray) -> np.ndarray:
    return np.repeat(row[None], 150, axis=0).astype(np.float32)


def right_end(result: ffseg.Segmentation, beyond: float = 100, rows: float = 50) -> np.ndarray:
    """Where the contour from a start on the left ends on the right."""
    points = result.contours[0].flatten(0.01)
    right = points[(points[:, 0] > beyond) & (np.abs(points[:, 1] - 75) < rows)][:, 0]
    assert len(right) > 3
    return right


@pytest.mark.parametrize("softness", [0.5, 2.0, 6.0])
def test_the_contour_settles_where_the_probability_is_one_half(softness: float) -> None:
    """A slope of probability: the level lies at 120.3, wherever the slope is steepest."""
    edges = evidence_edges(as_map(0.5 - 0.5 * np.tanh((X - 120.3) / softness / 2)), edge_map(EVEN, Edges()))
    np.testing.assert_allclose(right_end(ffseg.segment(EVEN, LEFT, edges=edges)), 120.3, atol=0.2)


@pytest.mark.parametrize(("level", "place"), [(0.5, 100.3), (0.8, 86.4), (0.2, 114.2)])
def test_the_region_ends_at_the_probability_that_is_asked_for(level: float, place: float) -> None:
    """Log odds fall by .1 a pixel and are 0 at 100.3: those of .8 are 1.386."""
    params = {"init.center": [50, 75], "init.radius": 20, "region.probability": level}
    found = ffseg.segment(EVEN, params, evidence=as_map(1 / (1 + np.exp((X - 100.3) / 10))))
    np.testing.assert_allclose(right_end(found, 70), place, atol=0.5)  # a soft slope: pixels between levels


def test_a_level_of_one_half_and_what_is_sure_change_nothing() -> None:
    rng = np.random.default_rng(1)
    probability = rng.uniform(0, 1, (20, 30)).astype(np.float32)
    assert at_level(probability, 0.5) is probability
    sure = np.round(probability)
    for level in (0.01, 0.3, 0.99):
        np.testing.assert_array_equal(at_level(sure, level), sure)
        np.testing.assert_array_equal(at_level(probability, level) >= 0.5, probability >= level)


def test_an_edge_of_the_image_near_the_level_moves_it() -> None:
    """The map ends at 120, the image has a step at 122.5."""
    image = np.where(X < 123, EVEN, np.uint8(200))
    edges = evidence_edges(as_map(X < 120), edge_map(image, Edges()))
    found = right_end(ffseg.segment(image, LEFT, edges=edges), rows=40)
    assert 121 < np.median(found) < 122.6  # towards the step, as far as the map allows


def test_edges_of_the_image_count_only_where_the_map_is_undecided() -> None:
    image = np.full((100, 200), 100, np.uint8)
    image[:, 50], image[:, 150] = 220, 220
    probability = np.full((100, 200), 0.95, np.float32)
    probability[:, 100:] = 0.55
    probability[0] = 0.0  # it must say something
    own = edge_map(image, Edges())
    assert own.edges[50, 40:60].any()
    assert own.edges[50, 140:160].any()
    found = evidence_edges(probability, own)
    assert not found.edges[50, 40:60].any()
    assert found.edges[50, 140:160].any()
    assert own.edges[50, 40:60].any(), "the image's own edge map stays as it was"


def test_edge_strength_stops_the_contour_on_its_ridge() -> None:
    edges = strength_edges(as_map(np.exp(-0.5 * ((X - 120.4) / 1.5) ** 2)), edge_map(EVEN, Edges()))
    np.testing.assert_allclose(right_end(ffseg.segment(EVEN, LEFT, edges=edges)), 120.4, atol=0.2)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (2, 2)])
def test_maps_of_a_few_pixels(shape: tuple[int, int]) -> None:
    image = np.zeros(shape, np.uint8)
    probability = np.linspace(0, 1, shape[0] * shape[1], dtype=np.float32).reshape(shape)
    assert evidence_edges(probability, edge_map(image, Edges())).edges.shape == shape


def test_the_native_level_refuses_what_is_not_finite() -> None:
    above = np.array([[np.nan, 1]], np.float32)
    with pytest.raises(ValueError, match="not finite"):
        _core.evidence_level(above, 0.1, 2, 1, 100, np.zeros((1, 2), np.uint16), np.zeros((1, 2), np.uint8))


def test_pixels_below_the_level_beside_it_are_edges() -> None:
    above = np.array([[1, 1, -1, -1], [1, -1, -1, -1], [-1, -1, -1, 1]], np.float32)
    gradient, edges = np.zeros((3, 4), np.uint16), np.zeros((3, 4), np.uint8)
    _core.evidence_level(above, 0.1, 2, 1, 100, gradient, edges)
    assert (edges > 0).tolist() == [
        [False, False, True, False],
        [False, True, False, True],
        [True, False, True, False],
    ]
    # value over slope: 1 over |(1 - -1) / 2| = 1 px from the level, where the bell is exp(-1/2)
    assert gradient[0, 2] == round(100 * np.exp(-0.5))
