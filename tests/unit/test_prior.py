"""Which evidence decides: clear edges alone, else the learned prior; and how sure the result is."""

import platform
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from ffseg.api import segment
from ffseg.contour import run
from ffseg.errors import ParameterError
from ffseg.evidence import auto
from ffseg.evidence.maps import expected_overlap
from ffseg.evidence.prior import FEATURE_NAMES, MAX_LOG_ODDS, MIN_START_RADIUS, all_planes, prior, start_features
from ffseg.geometry.freeform import FreeForm
from ffseg.image import boundary
from ffseg.image.appearance import MEAN_LEVEL, Appearance, normalised_exposure
from ffseg.image.boundary import Boundary
from ffseg.image.edges import GRADIENT_SCALE, OVERLAP_ODDS_RATIO, PRIOR_CALIBRATION, EdgeMap, ScoreCalibration, edge_map
from ffseg.image.free import distances
from ffseg.io.masks import encode_png
from ffseg.learning.drawn.sights import Sight, sights
from ffseg.metrics import iou
from ffseg.native import _core
from ffseg.parameter_files import load_params
from ffseg.pipeline import segment as segment_scene
from ffseg.scene import Outcome, Progress, Scene
from tests.discs import disc_of
from tests.scenes import START, START_RADIUS, scene

DRAWN = {"init.center": list(START), "init.radius": START_RADIUS}
PARAMS = load_params(None, DRAWN)
FAINT = {"init.center": [120, 100], "init.radius": 20}


def faint(contrast: float, texture: float) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """A disc of another colour, whose brightness hardly differs, on a ground of coarse texture."""
    inside = disc_of((200, 240))(120, 100, 59.99)
    coarse = np.kron(np.random.default_rng(5).normal(0, texture, (25, 30)), np.ones((8, 8)))
    image = np.stack([110 + coarse - contrast * inside, 110 + coarse, 110 + coarse + contrast * inside], axis=2)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8), np.where(inside, np.uint8(255), np.uint8(0))


def sight(kind: str, number: int, look: int = 0) -> tuple[Sight, dict[str, object]]:
    """A look at the drawing of that number, and the parameters of its start."""
    seen = list(sights(kind, look + 1, number))[look]
    return seen, {"init.center": list(seen.start[:2]), "init.radius": seen.start[2]}


@pytest.mark.parametrize("number", [*range(7), 26])  # the faint tenth of the last has 3.27 times what an edge needs
def test_clear_edges_decide_alone(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ffseg.evidence.prior.prior_view", pytest.fail)
    drawn = scene(number)
    found = segment(drawn.image, PARAMS)
    plain = segment(drawn.image, load_params(None, {**DRAWN, "edges.source": "gradient"}))
    assert found.source == "gradient"
    assert np.array_equal(found.mask, plain.mask)
    assert found.score > 0.9


def test_slits_of_a_snake_ask_for_no_prior() -> None:
    """It cannot part where it meets itself behind an obstacle: its slits there lie on no edge."""
    found = segment(scene(0).image, load_params(None, {**DRAWN, "method": "snake"}))
    assert found.source == "gradient"
    named = segment(scene(0).image, PARAMS, "snake")  # as `ffseg compare` and callers from Python do
    assert (named.source, np.array_equal(named.mask, found.mask)) == ("gradient", True)


def test_texture_is_left_to_the_prior() -> None:
    image, truth = faint(25, 12)
    found = segment(image, load_params(None, FAINT))
    plain = segment(image, load_params(None, {**FAINT, "edges.source": "gradient"}))
    assert (found.source, plain.source) == ("prior", "gradient")
    assert iou(found.mask, truth) > iou(plain.mask, truth) + 0.1
    assert 0 < found.score < 1


@pytest.mark.parametrize("source", ["auto", "prior"])
def test_where_more_is_asked_of_the_prior_the_region_is_smaller(source: str) -> None:
    image, _ = faint(25, 12)
    levels = [FAINT | {"edges.source": source, "region.probability": level} for level in (0.1, 0.5, 0.9)]
    areas = [np.count_nonzero(segment(image, load_params(None, level)).mask) for level in levels]
    assert areas[0] > areas[1] > areas[2]


def test_odds_at_a_level_and_what_is_expected_of_them() -> None:
    odds = np.array([[3.0, 1.0], [0.0, -4.0]], np.float32)
    at_four_fifths = odds - np.float32(np.log(4))
    sure = 1 / (1 + np.exp(-(3.0 - np.log(4))))  # the only one above the level
    assert expected_overlap(at_four_fifths, odds > 2) == pytest.approx(sure, rel=1e-6)


def test_given_thresholds_are_trusted() -> None:
    image, _ = faint(25, 12)
    found = segment(image, load_params(None, FAINT | {"edges.canny": [5, 10]}))
    assert (found.source, found.thresholds) == ("gradient", (5.0, 10.0))


def test_a_turned_or_mirrored_image_gives_the_turned_or_mirrored_odds() -> None:
    image, _ = faint(25, 12)
    start = np.hypot(*(np.indices(image.shape[:2]) - np.array([90, 130])[:, None, None])) < 18
    plain = prior(Appearance(image), start)
    for turn in (np.flipud, np.fliplr, np.rot90):
        turned = turn(prior(Appearance(turn(image)), np.ascontiguousarray(turn(start))).copy())
        back = {np.rot90: lambda plane: np.rot90(plane, 2)}.get(turn, lambda plane: plane)(turned)
        # a threshold of a tree may fall between two roundings of a sum: rarely, and for few of its pixels
        assert np.mean((plain > 0) != (back > 0)) < 0.005


def test_the_start_is_inside_whatever_it_looks_like() -> None:
    rng = np.random.default_rng(3)
    image = rng.integers(0, 256, (90, 120, 3)).astype(np.uint8)
    start = np.zeros((90, 120), np.bool_)
    start[40:50, 50:70] = True
    assert (prior(Appearance(image), start)[start] == MAX_LOG_ODDS).all()


def test_what_looks_like_the_start_behind_another_colour_is_as_far_off_as_that() -> None:
    """No colour tells the strips on both sides from each other; a flood over colours does."""
    image = np.repeat(np.repeat([90, 160, 90], 30)[None], 60, axis=0).astype(np.uint8)
    start = np.hypot(*(np.indices(image.shape) - np.array([30, 15])[:, None, None])) < 8
    planes = dict(zip(FEATURE_NAMES, all_planes(start_features(Appearance(image), start)), strict=True))
    near, across, behind = ((slice(None), slice(first, first + 8)) for first in (3, 18, 34))  # of every second pixel
    middles = [np.median(planes["from_start@0.7"][place]) for place in (near, behind)]
    assert middles[0] == pytest.approx(middles[1], abs=1e-3)
    flood = planes["unlike_barrier"]
    assert flood[near].max() < flood[across].min()
    assert flood[behind].min() >= flood[across].max()


@pytest.mark.parametrize("radius", [1.0, 2.0, 3.0])
def test_a_small_start_is_looked_at_with_its_surroundings(radius: float) -> None:
    """Of a start of a few pixels nobody can tell what its region looks like."""
    image, _ = faint(25, 12)
    at = np.hypot(*(np.indices(image.shape[:2]) - np.array([100, 120])[:, None, None]))
    seen, usual = (start_features(Appearance(image), at < size).inside > 0 for size in (radius, MIN_START_RADIUS))
    assert np.count_nonzero(seen ^ usual) <= 12  # of 49: the ring of a disc in pixels
    assert (at[seen] <= MIN_START_RADIUS + 1).all()
    assert (start_features(Appearance(image), at < 9).inside > 0).sum() == np.count_nonzero(at < 9)


def test_expected_overlap_against_its_definition() -> None:
    odds = np.full((40, 60), -2.0, np.float32)
    odds[:, :30] = 2.0
    mask = np.zeros((40, 60), np.bool_)
    mask[:, :20] = True
    high = 1 / (1 + np.exp(-2.0))
    expected = 20 * high / (20 + 10 * high)  # what is unlikely does not count
    assert expected_overlap(odds, mask) == pytest.approx(expected, rel=1e-6)  # single precision


def test_a_promise_is_sobered_by_its_odds() -> None:
    promised = np.linspace(0, 0.99, 34)
    odds = [p / (1 - p) for p in promised]
    for least, own in zip((PRIOR_CALIBRATION.iou(float(p)) for p in promised), odds, strict=True):
        assert least / (1 - least) == pytest.approx(own / OVERLAP_ODDS_RATIO, rel=1e-9)
    assert PRIOR_CALIBRATION.iou(1.0) == 1.0


def test_a_calibration_goes_both_ways_and_clicks_take_its_doubts_away() -> None:
    for used in (PRIOR_CALIBRATION, ScoreCalibration(0.5, 9.0), ScoreCalibration(1.0, 0.5)):
        assert [used.overlap(used.iou(p)) for p in (0.0, 0.3, 0.9, 1.0)] == pytest.approx([0.0, 0.3, 0.9, 1.0])
        assert used.after(0) == used
        far = [abs(used.after(clicks).iou(0.8) - 0.8) for clicks in (0, 1, 2, 5, 50)]
        assert far == sorted(far, reverse=True)
        assert far[-1] < 0.03
    for slope, ratio in ((0.0, 1.0), (1.0, -2.0), (1.0, float("inf")), (float("nan"), 1.0)):
        with pytest.raises(ParameterError, match="give numbers above 0"):
            ScoreCalibration(slope, ratio)


def test_nothing_to_ask_of_an_even_image() -> None:
    even = np.full((80, 100), 90, np.uint8)
    params = load_params(None, {"init.radius": 12})
    edges = edge_map(even, params.edges)
    assert Boundary((), edges).is_clear()
    assert segment(even, params).source == "gradient"


@pytest.mark.parametrize(("kind", "number", "look"), [("tissue", 100_002, 1), ("street", 100_003, 0)])
def test_what_looks_only_nearly_alike_is_left_out(
    kind: str, number: int, look: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cells beyond a wall, the ground beside a road."""
    seen, start = sight(kind, number, look)
    params = load_params(None, start)
    found = iou(segment(seen.image, params).mask, seen.truth)
    assert found > 0.75
    monkeypatch.setattr("ffseg.evidence.prior.CAUTION", 0.0)
    assert iou(segment(seen.image, params).mask, seen.truth) < found - 0.05


@pytest.mark.parametrize(("kind", "number"), [("thing", 100_001), ("mirror", 100_002)])  # no edge parts them
def test_a_trial_on_faint_edges_ends_early_and_changes_nothing(
    kind: str, number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen, start = sight(kind, number)
    params, ends = load_params(None, start), []

    def told(scene: Scene) -> Outcome:
        watch, heard = scene.callback, []
        assert watch is not None

        def hear(progress: Progress) -> None:
            heard.append(progress.iteration)
            watch(progress)

        try:
            return run(replace(scene, callback=hear))
        finally:
            ends.append(heard[-1])

    monkeypatch.setattr(auto, "run", told)
    early = segment(seen.image, params)
    monkeypatch.setattr(boundary, "MIN_JOINTS", seen.image.size)
    whole = segment(seen.image, params)
    assert (early.source, early.score) == ("prior", whole.score)
    assert [c.control_points.tolist() for c in early.contours] == [c.control_points.tolist() for c in whole.contours]
    assert ends[0] < ends[1] / 2


@pytest.mark.parametrize("look", [0, 1])
def test_a_region_that_meets_no_edge_before_the_image_ends_is_left_to_the_prior(look: int) -> None:
    """Cells in noise whose walls are no edges: alone, the image's own give nine tenths and more of it."""
    seen, start = sight("tissue", 200_001, look)
    found, own = (segment(seen.image, load_params(None, start | {"edges.source": s})) for s in ("auto", "gradient"))
    assert (found.source, own.doubts) == ("prior", ("filled",))
    assert iou(found.mask, seen.truth) > iou(own.mask, seen.truth) + 0.1


@pytest.mark.parametrize(
    ("times", "texture", "clear"), [(1.4, 0.5, False), (1.6, 0.5, True), (20, 0.7, False), (20, 0.5, True)]
)
def test_strong_edges_are_trusted_round_plain_regions(times: float, texture: float, clear: bool) -> None:
    """Noise alone has half the gradient that an edge needs."""
    needed = 10 * GRADIENT_SCALE
    ring = FreeForm.circle((50, 40), 25, 24, 3)
    gradient = np.full((80, 100), round(texture * needed), np.uint16)
    x, y = np.rint(ring.control_points[::3]).astype(int).T
    gradient[y, x] = round(times * needed)
    edges = EdgeMap(gradient, np.zeros((80, 100), np.uint8), None, (5.0, 10.0))
    assert Boundary((ring,), edges).is_clear() == clear
    assert Boundary((ring,), edges).clear_share() == (0.5 if texture > 0.6 else 1.0 if times > 1.5 else 0.04)


def test_what_a_camera_sees_of_its_robot_says_nothing_of_the_ground() -> None:
    """The robot in the start is as lively as can be; the ground round it is plain up to clear edges."""
    image = cv2.circle(np.full((240, 320), 60, np.uint8), (160, 120), 100, 180, -1)
    robot = cv2.circle(np.zeros_like(image), (160, 120), 24, 1, -1) > 0
    image[robot] = np.random.default_rng(0).integers(0, 256, robot.sum())
    for source in ("auto", "gradient"):
        params = load_params(None, {"edges.source": source, "init.center": "auto", "init.radius": 30})
        found = segment_scene(Scene(image, params, center=(160.0, 120.0), robot=30.0))
        assert (found.source, found.score) == ("gradient", 1.0)
    assert segment_scene(Scene(image, params)).score == 0.5


@pytest.mark.parametrize("step", [1, 3])
def test_what_is_lively_is_counted_by_distance(step: int) -> None:
    rng = np.random.default_rng(step)
    region = cv2.GaussianBlur(rng.normal(0, 1, (70, 90)), (0, 0), 5) > 0
    gradient, levels = rng.integers(0, 40, region.shape).astype(np.uint16), 10 + 30 * np.exp(-np.arange(27) / 6)
    squares = np.minimum(np.rint(distances(region).astype(float) ** 2).astype(int), 26)
    lively = (region & (squares > 1) & (gradient > levels[squares]))[::step].sum() / region[::step].sum()
    assert 0.05 < lively < 0.9
    assert _core.lively_share(region.view(np.uint8), gradient, levels, step, 1.0) == pytest.approx(lively, rel=1e-12)
    assert _core.lively_share(region.view(np.uint8), gradient, levels, step, lively / 2) == 1.0


@pytest.mark.parametrize("noise", [0, 2, 4, 8, 12])
@pytest.mark.parametrize("width", [10, 14, 20, 30])
def test_a_passage_is_plain_however_narrow_it_is(width: int, noise: float) -> None:
    """What lies on both sides of it is the edges of its own boundary, which reach to its middle."""
    passage = np.zeros((300, 300), np.float32)
    for turn, top in enumerate(range(20, 280 - width, width + 6)):
        passage[top : top + width, 20:280] = 1
        if top + 2 * width + 6 < 280:
            side = slice(280 - width, 280) if turn % 2 == 0 else slice(20, 20 + width)
            passage[top : top + 2 * width + 6, side] = 1
    image = 50 + (160 - 6 * noise) * passage + np.random.default_rng(0).normal(0, noise, passage.shape)
    image = np.clip(cv2.GaussianBlur(image, (0, 0), 0.6), 0, 255).astype(np.uint8)
    found = segment(image, load_params(None, {"init.circles": [[60, 19.5 + width / 2, width / 2 - 1.5]]}))
    assert (found.source, found.doubts) == ("gradient", ())
    assert iou(found.mask, np.where(passage > 0, np.uint8(255), np.uint8(0))) > 0.99


def test_a_front_that_still_moves_is_no_faint_edge() -> None:
    inside = disc_of((900, 1200))(600, 450, 400)
    image = np.where(inside, 160, 60) + np.random.default_rng(1).normal(0, 5, inside.shape)
    image = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    assert segment(image, load_params(None, {"init.radius": 20})).source == "gradient"


def test_a_small_part_of_a_clear_boundary_may_be_faint() -> None:
    y, x = np.indices((400, 500))
    inside = disc_of((400, 500))(250, 200, 149.99)
    contrast = np.where(abs(np.arctan2(y - 200, x - 250)) < 0.1, 11.6, 100)  # 3 % of the outline
    image = 100 + np.where(inside, 0, contrast) + np.random.default_rng(1).normal(0, 5, inside.shape)
    image = np.clip(np.rint(cv2.GaussianBlur(image, (0, 0), 0.6)), 0, 255).astype(np.uint8)
    found = segment(image, load_params(None, {"init.radius": 30}))
    assert (found.source, found.doubts) == ("gradient", ())
    assert iou(found.mask, np.where(inside, np.uint8(255), np.uint8(0))) > 0.99


def test_a_start_across_edges_is_left_to_the_prior() -> None:
    """It lies on a dark and on a light part of one thing, and may mean either or both."""
    seen, start = sight("thing", 730_027)
    found, own = (segment(seen.image, load_params(None, start | {"edges.source": s})) for s in ("auto", "gradient"))
    assert (found.source, own.doubts) == ("prior", ("start",))
    assert iou(found.mask, seen.truth) > iou(own.mask, seen.truth) + 0.5


def test_specks_round_clicks_are_no_boundary() -> None:
    """Everything is edges there: a contour that stops on some of them has found nothing."""
    seen, _ = sight("organ", 720_010)
    clicks = {"init.circles": [[108, 75, 2.1], [122, 13, 2.1]]}
    found, own = (segment(seen.image, load_params(None, clicks | {"edges.source": s})) for s in ("auto", "gradient"))
    assert (found.source, bool(own.score <= 0.5)) == ("hints", True)
    assert iou(found.mask, seen.truth) > 0.7 > 0.1 > iou(own.mask, seen.truth)


@pytest.mark.parametrize("look", [0, 1])
def test_a_drawn_thing_whose_own_edges_lead_astray_is_left_to_the_prior(look: int) -> None:
    """The faint tenth of the contour on its own edges has 2.13 and 2.39 times what an edge needs, and an IoU below 0.1."""
    seen, start = sight("thing", 100_000, look)
    found = segment(seen.image, load_params(None, start))
    assert found.source == "prior"
    assert iou(found.mask, seen.truth) > 0.7


@pytest.mark.parametrize("contrast", [75, 90, 110])
def test_faint_edges_of_a_plain_region_in_noise_are_clear_enough(contrast: int) -> None:
    inside = disc_of((200, 240))(120, 100, 59.99)
    noise = np.random.default_rng(1).normal(0, 25, inside.shape)
    image = np.clip(np.rint(60 + contrast * inside + noise), 0, 255).astype(np.uint8)
    found = segment(image, load_params(None, FAINT))
    assert found.source == "gradient"
    assert found.score > 0.9
    assert iou(found.mask, np.where(inside, np.uint8(255), np.uint8(0))) > 0.99


def test_a_clear_thing_among_faint_clutter_keeps_its_own_edges() -> None:
    inside = disc_of((200, 300))(90, 100, 44.99)
    clutter = np.kron(np.random.default_rng(2).normal(0, 9, (25, 38)), np.ones((8, 8)))[:, :300]
    clutter[:, :151] = 0
    image = np.clip(np.rint(100 + 90 * inside + clutter), 0, 255).astype(np.uint8)
    found = segment(image, load_params(None, {"init.center": [90, 100], "init.radius": 15}))
    assert found.source == "gradient"
    assert iou(found.mask, np.where(inside, np.uint8(255), np.uint8(0))) > 0.995


def test_another_exposure_gives_nearly_the_same_odds() -> None:
    image, _ = faint(20, 10)
    start = np.hypot(*(np.indices(image.shape[:2]) - np.array([100, 120])[:, None, None])) < 18
    plain = prior(Appearance(image), start) > 0
    dark = prior(Appearance(np.rint(image * 0.5).astype(np.uint8)), start) > 0
    # half the levels leave rounding of a level more, which moves a border in texture by pixels
    assert np.mean(plain != dark) < 0.02


def test_the_mean_level_is_brought_to_the_middle() -> None:
    image = np.random.default_rng(4).integers(20, 61, (80, 120, 3)).astype(np.uint8)
    # a sampled mean, and rounding to levels
    assert normalised_exposure(image).mean() == pytest.approx(MEAN_LEVEL, abs=1.0)
    assert normalised_exposure(np.zeros((8, 8), np.uint8)).max() == 0


def test_haze_over_the_whole_picture_is_taken_off() -> None:
    image = np.random.default_rng(4).integers(0, 256, (240, 320, 3)).astype(np.uint8)
    hazy = np.rint(180 + 0.25 * image).astype(np.uint8)
    clear, lifted = normalised_exposure(image).astype(float), normalised_exposure(hazy).astype(float)
    assert clear.mean() == pytest.approx(MEAN_LEVEL, abs=1)  # the mean is that of every fourth pixel
    assert clear.std() == pytest.approx(image.std() * clear.mean() / image.mean(), rel=0.01)
    assert np.abs(clear - lifted).mean() < 3  # a level of the hazy picture is four of the clear one


def test_a_bright_picture_with_dark_places_has_no_haze() -> None:
    image = np.full((60, 80, 3), 200, np.uint8)
    image[:12, :12] = 20
    gain = MEAN_LEVEL / image[::4, ::4].mean()
    assert set(np.unique(normalised_exposure(image))) == {round(20 * gain), round(200 * gain)}


@pytest.mark.parametrize("shape", [(20, 20000), (4097, 40), (1, 5000, 3), (60, 4100, 3)])
def test_a_side_longer_than_planes_that_are_flooded(shape: tuple[int, ...]) -> None:
    """The features are reduced; the level is drawn at the size of the image."""
    rng = np.random.default_rng(2)
    image = rng.integers(60, 190, shape).astype(np.uint8)
    found = segment(image, load_params(None, {"edges.source": "prior", "init.radius": 4}))
    assert found.mask.shape == shape[:2]


LOOP = """
import resource, sys, ffseg
for _ in range(6):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    source = ffseg.segment(ffseg.read_image(sys.argv[1])).source
print(source, resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries keep freed memory by other rules")
def test_the_memory_of_one_image_serves_the_next(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(60, 190, (480, 640, 3)).astype(np.uint8)
    (tmp_path / "a.png").write_bytes(encode_png(cv2.GaussianBlur(noise, (0, 0), 2), []))
    command = [sys.executable, "-c", LOOP, str(tmp_path / "a.png")]
    source, faults = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    assert source == "prior"
    assert int(faults) < 600  # pages; they are 5000 where the planes of every image go back to the system
