"""The free-form contour on random scenes, toy runs and hard starts, and the repairs of its curves."""

from math import pi
from pathlib import Path

import cv2
import numpy as np
import pytest

import ffseg
from ffseg.errors import SegmentationError
from ffseg.geometry.freeform import FreeForm
from ffseg.image.edges import edge_map
from ffseg.image.raster import rasterize
from ffseg.learning.drawn.sights import KINDS, sights
from ffseg.parameter_files import load_params
from ffseg.plugins import METHODS
from ffseg.scene import Scene
from tests import stress
from tests.crossings import self_intersections
from tests.discs import disc_of, overlap
from tests.evolutions import FLAT, SHAPE, areas, around, contours, evolution, ring

ROOT = Path(__file__).resolve().parents[2]
SHORT, LONG = 50, 2000
"""Scenes."""


disc = disc_of((120, 160))


def grey(path: Path) -> np.ndarray:
    return cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)


def holes_of(result: ffseg.Segmentation) -> int:
    return sum(contour.signed_area < 0 for contour in result.contours)


@pytest.mark.parametrize(
    "overrides",
    [{}, {"contour.degree": 2, "contour.split_threshold": 8.0}, {"contour.degree": 4, "contour.split_threshold": 14.0}],
    ids=["default", "degree 2", "degree 4"],
)
def test_random_scenes(overrides: dict[str, object], request: pytest.FixtureRequest) -> None:
    seeds = range(LONG if request.config.getoption("--long") else SHORT)
    assert [o for o in (stress.check(seed, overrides) for seed in seeds) if o.faults] == []


@pytest.mark.parametrize(
    ("name", "least", "holes"), [("a", 0.9995, 0), ("b", 0.999, 6), ("c", 0.996, 7), ("d", 0.999, 3), ("e", 0.992, 7)]
)
@pytest.mark.parametrize("degree", [2, 3, 4])
@pytest.mark.parametrize("threshold", [8.0, 24.0, 40.0])
def test_scenes(data_folder: Path, name: str, least: float, holes: int, degree: int, threshold: float) -> None:
    params = {"init.center": [400, 300], "contour.degree": degree, "contour.split_threshold": threshold}
    if name == "e":
        params["contour.clearance"] = 12.0  # its gaps are 8 px wide, that between ring and wall 4 px
    result = ffseg.segment(grey(data_folder / f"scenes/{name}.png"), params)
    truth = grey(data_folder / f"scenes/{name}_truth.png") > 0
    assert overlap(result.mask, truth) >= least - 0.002 * ((degree, threshold) != (3, 40.0))
    assert holes_of(result) == holes


@pytest.mark.parametrize("name", ["b", "c"])
@pytest.mark.parametrize(("sigma", "least_b", "least_c"), [(12, 0.997, 0.988), (18, 0.996, 0.985), (25, 0.994, 0.98)])
def test_noise(data_folder: Path, name: str, sigma: int, least_b: float, least_c: float) -> None:
    image, truth = grey(data_folder / f"scenes/{name}.png"), grey(data_folder / f"scenes/{name}_truth.png") > 0
    noisy = np.clip(np.round(image + np.random.default_rng(5).normal(0, sigma, image.shape)), 0, 255).astype(np.uint8)
    result = ffseg.segment(noisy, {"init.center": [400, 300]})
    assert overlap(result.mask, truth) >= (least_b if name == "b" else least_c)
    assert holes_of(result) == (6 if name == "b" else 7)


def test_two_starts_merge_and_one_that_closes_in_splits() -> None:
    image = np.where(disc(60, 60, 30) | disc(100, 60, 30), 200, 50).astype(np.uint8)
    merged = ffseg.segment(image, {"init.circles": [[50, 60, 8], [110, 60, 8]]})
    assert len(merged.contours) == 1
    assert merged.stats.merges >= 1
    apart = np.where(disc(45, 60, 22) | disc(115, 60, 22), 200, 50).astype(np.uint8)
    closing = {"init.boxes": [[6, 6, 153, 113]], "contour.balloon": -2.0, "edges.source": "gradient"}
    split = ffseg.segment(apart, closing)
    assert (len(split.contours), holes_of(split)) == (2, 0)
    assert overlap(split.mask, apart == 200) > 0.99


def test_toy_runs_differ_as_in_the_paper() -> None:
    image, truth = grey(ROOT / "samples/toy.png"), grey(ROOT / "samples/truth/toy.png") > 0
    fixed, full, refined = (ffseg.segment(image, f"toy-{how}") for how in ("fixed", "full", "refined"))
    assert overlap(fixed.mask, truth) < 0.9
    assert holes_of(fixed) == 0
    assert overlap(full.mask, truth) > 0.999
    assert (holes_of(full), full.stats.stop_reason) == (4, "converged")
    assert refined.stats.stop_reason.startswith("max_")  # loops round the holes for ever


def test_edge_free_image_fills_and_all_edge_image_ends() -> None:
    flat = ffseg.segment(np.full((60, 80), 90, np.uint8), {"init.radius": 10.0})
    assert flat.mask.mean() > 0.99  # the contour rounds the corners of the image
    noise = np.random.default_rng(0).integers(0, 256, (80, 90, 3), dtype=np.uint8)
    try:
        found = ffseg.segment(noise, {"init.radius": 10.0, "edges.canny": [0.1, 0.2]})
        assert found.stats.stop_reason in {"converged", "vanished"}
    except SegmentationError as error:
        assert "lies on an edge" in str(error)


@pytest.mark.parametrize("degree", [1, 3, 6])
def test_a_start_circle_that_leaves_the_image_fills_it(degree: int) -> None:
    """It once crashed the core."""
    found = ffseg.segment(np.full((48, 64), 90, np.uint8), {"init.radius": 40, "contour.degree": degree})
    assert found.mask.mean() > 0.9


def test_same_job_same_bytes() -> None:
    params = {"init.center": list(stress.scenes.START), "init.radius": 14.0}
    first, second = (ffseg.segment(stress.scenes.scene(5).image, params).contours for _ in range(2))
    assert [one.control_points.tobytes() for one in first] == [one.control_points.tobytes() for one in second]


@pytest.mark.parametrize("method", ["freeform", "levelset", "snake", "paper"])
def test_a_start_given_the_other_way_round_grows_all_the_same(method: str) -> None:
    """A method handed clockwise starts: the region is what lies in them, whichever way they run."""
    image = np.full((90, 120), 40, np.uint8)
    image[20:70, 30:95] = 200
    params = load_params(None, {"edges.canny": [5.0, 15.0], "contour.balloon": 2.0})
    edges, start = edge_map(image, params.edges), FreeForm.circle((60, 45), 9, 13, 3)
    right, turned = (
        METHODS[method].loaded()(Scene(image, params, edges=edges, starts=(one,))) for one in (start, start.reversed())
    )
    assert turned.stats == right.stats
    masks = [rasterize(outcome.contours or (), (90, 120)) for outcome in (right, turned)]
    assert (masks[0] == masks[1]).all()
    assert masks[0][30:60, 40:85].all()  # the corners are rounded


def test_the_free_form_has_no_use_for_the_edge_force() -> None:
    """As docs/method.md says; the printed method slows down with it."""
    image = cv2.imread(str(ROOT / "samples" / "simple.png"))
    for method, same in (("freeform", True), ("paper", False)):
        one, two = (
            ffseg.segment(image, {"edges.exponent": exponent, "edges.source": "gradient"}, method).contours
            for exponent in (2.0, 8.0)
        )
        points = [np.concatenate([contour.control_points for contour in contours]) for contours in (one, two)]
        assert np.array_equal(*points) == same


def test_samples_that_have_drawn_together_near_edges_are_laid_out_evenly() -> None:
    angles = np.concatenate([[i, i + 0.06, i + 0.12] for i in range(12)]) * 2 * pi / 12
    made = evolution([around(angles, 20)], ring(28), refine=True, balloon=0.5, iterations=1)
    (after,) = contours(made)
    assert after.num_patches == 12
    samples = after.evaluate(np.arange(37) / 36)
    steps = np.hypot(*np.diff(samples, axis=0).T).reshape(12, 3)
    assert (steps.max(axis=1) < 2 * steps.min(axis=1)).all()  # 15 times before; three times is let be


def test_a_curve_does_not_pass_between_two_pixels_of_a_diagonal_edge() -> None:
    """An edge that goes on diagonally is closed there: samples whose curve would lie across it stay where they are."""
    edges = np.zeros(SHAPE, np.uint8)
    edges[[60, 61], [100, 101]] = 255
    along, across = np.array([1.0, -1.0]) / np.sqrt(2), np.array([1.0, 1.0]) / np.sqrt(2)
    # After the move the side runs between the two pixels; no place looked at lies on their common corner.
    middle = np.array([100.5, 60.5]) + 0.3 * across + 0.2 * along
    corners = np.array([middle + 30 * (u * along) + 60 * v * across for u, v in ((-1, 0), (1, 0), (1, 1), (-1, 1))])
    steps = np.linspace(0, 1, 4)[:-1, None]
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    start = FreeForm(np.concatenate([a + steps * (b - a) for a, b in sides]), 3)
    made = evolution([start], edges, balloon=0.3, iterations=1)
    places = np.arange(12) / 12
    moved = np.hypot(*(contours(made)[0].evaluate(places) - start.evaluate(places)).T)
    assert moved[[1, 2]] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert moved[4:12] == pytest.approx([0.3] * 8, abs=1e-6)


def test_displacements_that_cross_do_not_turn_the_contour_round() -> None:
    """A small hole whose samples would all run through its middle to a line beside it."""
    x = np.arange(SHAPE[1], dtype=float)
    gradient = np.tile(np.rint(640 * np.exp(-0.5 * ((x - 91.5) / 4) ** 2)).astype(np.uint16), (SHAPE[0], 1))
    hole = FreeForm(FreeForm.circle((90, 70), 3, 8, 3).control_points[::-1].copy(), 3)
    made = evolution([hole], settle=6.0, topology=False, gradient=gradient)
    before, after = (np.diff(one.evaluate(np.arange(25) / 24), axis=0) for one in (hole, *contours(made)))
    assert ((before * after).sum(axis=1) > 0).all()


def test_contours_that_overlap_a_little_once_settled_are_drawn_apart() -> None:
    starts = [FreeForm.circle((60, 70), 20, 20, 3), FreeForm.circle((99.2, 70), 20, 20, 3)]
    made = evolution(starts, gradient=FLAT)
    assert self_intersections(contours(made)) == []
    assert areas(made) == pytest.approx([pi * 20**2] * 2, rel=0.02)


SETTINGS: tuple[dict[str, object], ...] = (
    {},
    {"edges.source": "gradient"},
    {"contour.settle": 0, "contour.refine": False},
    {"contour.degree": 4, "contour.split_threshold": 2},
)


@pytest.mark.parametrize("kind", KINDS)
def test_no_result_crosses_itself(kind: str) -> None:
    """Texture stops a front everywhere: one of three such results crossed itself when all was tested anew each round."""
    for seen in sights(kind, 3, 830_000):
        for settings in SETTINGS:
            found = ffseg.segment(seen.image, load_params(None, {"init.circles": [list(seen.start)], **settings}))
            assert self_intersections(found.contours) == [], settings


@pytest.mark.parametrize("settle", [0.0, 4.0])
@pytest.mark.parametrize("radius", [3, 12])
def test_what_bounds_nothing_once_settled_is_dropped(radius: float, settle: float) -> None:
    """In the region an outer contour, beside it a hole; what lies apart, and a hole in the region, stay."""
    outer = [FreeForm.circle(place, radius, 4, 3) for place in ((60, 40), (160, 40))]
    holes = [FreeForm.circle(place, radius, 4, 3).reversed() for place in ((60, 100), (160, 100))]
    starts = [FreeForm.circle((60, 70), 50, 20, 3), *outer, *holes]
    made = evolution(starts, gradient=FLAT, settle=settle)
    assert areas(made) == pytest.approx([-pi * radius**2, pi * radius**2, pi * 50**2], rel=0.02)


def test_a_small_contour_that_still_crosses_another_is_dropped() -> None:
    """Three patches beside the mirror's rim, which no smoothing parts from the contour round them."""
    seen = next(sights("mirror", 1, 810_004))
    found = ffseg.segment(seen.image, load_params(None, {"init.circles": [list(seen.start)]}))
    assert self_intersections(found.contours) == []
