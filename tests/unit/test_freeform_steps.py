"""Single steps of the free form on edge maps and contours made for them: what each step must do can be worked out."""

from math import cos, hypot, pi, sin

import naive_freeform as naive
import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from ffseg.geometry.freeform import FreeForm
from ffseg.image.raster import rasterize
from ffseg.native import _core
from tests.crossings import self_intersections
from tests.evolutions import FLAT, SHAPE, around, contours, evolution, region, ring
from tests.naive_pairs import grown


def distances(made: _core.Evolution, degree: int = 3) -> NDArray[np.float64]:
    points = np.concatenate([contour.flatten(0.01) for contour in contours(made, degree)])
    return np.hypot(*(points - (90, 70)).T)


@pytest.mark.parametrize("degree", range(1, 7))
@pytest.mark.parametrize("balloon", [1.0, 2.0, 5.0])
def test_a_circle_in_open_ground_grows_by_the_balloon(degree: int, balloon: float) -> None:
    made = evolution([FreeForm.circle((90, 70), 20, 48 // degree, degree)], balloon=balloon, iterations=6)
    samples = np.concatenate([c.evaluate(np.arange(48) / 48) for c in contours(made, degree)])
    np.testing.assert_allclose(np.hypot(*(samples - (90, 70)).T), 20 + 6 * balloon, atol=0.02 * balloon)


def test_uneven_samples_are_evened_out_along_the_tangent() -> None:
    angles = np.cumsum(np.tile([0.5, 1.5], 18)) * 2 * pi / 36
    start = around(angles, 20)
    made = evolution([start], balloon=0.5)

    def ratio(contour: FreeForm) -> float:
        samples = contour.evaluate(np.arange(37) / 36)
        steps = np.hypot(*np.diff(samples, axis=0).T)
        return float(steps.max() / steps.min())

    assert ratio(start) == pytest.approx(3.0, rel=0.02)
    made.advance(12)
    assert ratio(contours(made)[0]) < 1.2
    assert np.median(distances(made)) == pytest.approx(26.0, abs=0.5)  # and the shape keeps to first order


@pytest.mark.parametrize("degree", range(1, 7))
@pytest.mark.parametrize("threshold", [10.0, 24.0, 40.0])
def test_a_contour_stops_before_the_band_of_a_thin_ring(degree: int, threshold: float) -> None:
    """The band is the edge pixel and one more to either side; a sample stops at most a march step before it."""
    start = [FreeForm.circle((90, 70), 8, 13, degree)]
    made = evolution(start, ring(50), refine=True, split_threshold=threshold, balloon=8.0, iterations=500)
    assert made.stop_reason == "converged"
    found = distances(made, degree=degree)
    column, row = np.rint(np.concatenate([c.flatten(0.01) for c in contours(made, degree)])).astype(int).T
    # between two samples the curve may run through the band, but not meet the edge
    assert not ring(50)[row, column].any()
    assert np.percentile(found, 2) > 50 - 1.5 - 2.0  # a staircase of pixels holds samples a pixel or two apart
    assert found.mean() > 50 - 1.5 - 1.0
    assert len(contours(made, degree)) == 1


@pytest.mark.parametrize("slope", [0, 1, 2, 3, 5])
@pytest.mark.parametrize("balloon", [2.0, 8.0])
def test_no_thin_line_is_jumped(slope: int, balloon: float) -> None:
    """Lines one pixel wide in several directions, diagonal ones too: what lies behind them stays outside."""
    edges = np.zeros(SHAPE, np.uint8)
    columns = np.arange(SHAPE[1])
    for column in columns:
        row = 110 - (column * slope) // 8
        if 0 <= row < SHAPE[0]:
            edges[row, column] = 255
    made = evolution([FreeForm.circle((60, 40), 10, 13, 3)], edges, refine=True, balloon=balloon, iterations=500)
    mask = region(made)
    behind = np.arange(SHAPE[0])[:, None] > 110 - (columns * slope) // 8
    assert not (mask & behind).any()
    assert (mask & ~behind).sum() > 0.93 * (~behind).sum()


def test_an_obstacle_becomes_a_hole_and_a_speck_between_samples_is_seen() -> None:
    for radius in (0.0, 2.0, 6.0, 14.0):
        edges = ring(radius, (120.0, 70.0)) if radius else np.zeros(SHAPE, np.uint8)
        edges[70, 120] = 255
        made = evolution([FreeForm.circle((60, 70), 10, 13, 3)], edges, refine=True, balloon=8.0, iterations=500)
        assert made.stop_reason == "converged"
        holes = [contour for contour in contours(made) if contour.signed_area < 0]
        assert len(holes) == 1, radius
        assert holes[0].winding([[120.0, 70.0]]).tolist() == [-1]
        assert not region(made)[70, 120]
        assert region(made).sum() > SHAPE[0] * SHAPE[1] - pi * (radius + 4) ** 2 - 60  # the image's corners are rounded


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize("gap", [20.0, 32.0, 38.0])
def test_two_circles_that_overlap_become_one(degree: int, gap: float) -> None:
    """No area is won or lost where they join, but for the corners a flip cuts (less than a patch)."""
    patches = 36 // degree
    starts = [FreeForm.circle((70, 70), 20, patches, degree), FreeForm.circle((70 + gap, 70), 20, patches, degree)]
    made = evolution(starts, balloon=0.3, iterations=3)
    (outline,) = contours(made, degree)
    grown = [FreeForm.circle((70 + step, 70), 20.9, patches, degree) for step in (0.0, gap)]
    union = rasterize(grown, SHAPE)
    assert made.counts()["merges"] >= 1
    assert (region(made, degree) ^ union).sum() < 0.05 * union.sum()
    assert outline.signed_area == pytest.approx(union.sum(), rel=0.05)


def horseshoe(gap: float) -> FreeForm:
    """A ring that is not closed, on the right: its two ends stand `gap` apart."""
    half = gap / 2 / 35
    out = [half + (2 * pi - 2 * half) * i / 47 for i in range(48)]
    outer = [(80 + 45 * cos(a), 70 + 45 * sin(a)) for a in out]
    inner = [(80 + 25 * cos(a), 70 + 25 * sin(a)) for a in reversed(out)]
    return FreeForm.from_samples(np.array(outer + inner), 3)


@pytest.mark.parametrize("edge", [True, False])
def test_a_front_that_closes_on_itself_leaves_a_hole_round_an_obstacle(edge: bool) -> None:
    edges = ring(12, (80.0, 70.0)) if edge else None
    made = evolution([horseshoe(8.0)], edges, refine=True, balloon=1.0, iterations=8)
    areas = sorted(contour.signed_area for contour in contours(made))
    assert len(areas) == 2
    assert areas[0] < 0 < areas[1]
    assert made.counts()["flips"] >= 1
    made.advance(100)
    holes = [contour for contour in contours(made) if contour.signed_area < 0]
    assert len(holes) == int(edge)  # round nothing it closes and is dropped


@pytest.mark.parametrize("row", [20, 150, 290, 400, 560])
def test_fronts_meet_wherever_they_are_in_a_large_image(row: int) -> None:
    """Enough patches for several strips of the filter: a pair is found in each of them."""
    shape = (600, 1200)
    starts = [FreeForm.circle((40 + 36 * i, row), 12, 24, 3) for i in range(32)]
    options = {"edges": np.zeros(shape, np.uint8), "balloon": 2.0, "split_threshold": 1000.0, "iterations": 5}
    made = evolution(starts, **options)
    assert (made.counts()["merges"], len(contours(made))) == (31, 1)
    apart = [FreeForm.circle((40 + 36 * i, row + (i % 2) * 2), 12, 24, 3) for i in range(0, 32, 2)]
    still = evolution(apart, **options)
    assert (still.counts()["flips"], len(contours(still))) == (0, 16)


@pytest.mark.parametrize("seed", range(10))
def test_split_keeps_the_curve_and_ends_below_the_threshold(seed: int) -> None:
    rng = np.random.default_rng([seed, 5])
    angles = np.arange(12) * 2 * pi / 12
    start = around(angles, 45 + rng.uniform(3, 8) * np.sin(2 * angles + rng.uniform(0, 6)))
    made = evolution([start], refine=True, topology=False, split_threshold=30.0, balloon=0.3, iterations=4)
    (after,) = contours(made)

    def spread(patch: NDArray[np.float64]) -> float:
        return float(np.hypot(*(patch[:, None] - patch[None]).transpose(2, 0, 1)).max())

    assert max(map(spread, after.patches)) <= 30.0
    assert min(map(spread, after.patches)) > 7.0
    assert made.counts()["splits"] >= after.num_patches - start.num_patches
    before, now = rasterize((start,), SHAPE), region(made)
    assert (before & ~now).sum() < 0.01 * before.sum()
    assert (now & ~grown(before, 3)).sum() < 0.01 * before.sum()  # it has grown by 1.2 px
    calm = evolution([start], refine=True, topology=False, split_threshold=200.0, balloon=0.3, iterations=1)
    assert calm.counts()["splits"] == 0
    assert contours(calm)[0].num_patches <= start.num_patches


@pytest.mark.parametrize(("short", "prunes"), [(4.5, 1), (9.5, 0)])
def test_a_short_patch_is_pruned_in_open_ground(short: float, prunes: int) -> None:
    """Below a fifth of the threshold, here 8 px: its neighbours meet in its middle."""
    angles = np.concatenate([np.arange(3) * short / 90, np.linspace(short / 30, 2 * pi, 31)[:-1]])
    start = around(angles, 30)
    made = evolution([start], refine=True, balloon=0.3, split_threshold=40.0, iterations=1)
    (after,) = contours(made)
    assert (made.counts()["prunes"], after.num_patches) == (prunes, start.num_patches - prunes)
    assert after.signed_area == pytest.approx(pi * 30.3**2, rel=0.01)
    joints = after.patches[:, 0]
    middle = (90 + 30.3 * cos(short / 60), 70 + 30.3 * sin(short / 60))
    assert (np.hypot(*(joints - middle).T).min() < 1.0) == bool(prunes)


def gradient_ring(radius: float, height: float = 20.0) -> NDArray[np.uint16]:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    return np.rint(32 * height * np.exp(-0.5 * ((np.hypot(x - 90, y - 70) - radius) / 1.5) ** 2)).astype(np.uint16)


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
@pytest.mark.parametrize("offset", [-2.5, -1.0, 0.0, 0.7])
def test_a_contour_settles_on_the_ridge(degree: int, offset: float) -> None:
    start = [FreeForm.circle((90, 70), 50 + offset, 60 // degree, degree)]
    made = evolution(start, refine=True, split_threshold=24.0, gradient=gradient_ring(50.0))
    found = distances(made, degree=degree)
    assert abs(found - 50.0).max() < 0.3
    assert abs(found.mean() - 50.0) < 0.03


def test_what_is_no_ridge_or_out_of_reach_leaves_the_contour_where_it_is() -> None:
    start = FreeForm.circle((90, 70), 40, 20, 3)
    for gradient, settle, found in (
        (gradient_ring(50.0), 4.0, 40.0),
        (gradient_ring(45.5), 4.0, 40.0),  # its slope is in reach, its ridge is not
        (gradient_ring(42.0, height=0.9), 4.0, 40.0),
        (gradient_ring(43.0), 0.0, 40.0),
        (gradient_ring(43.0), 4.0, 43.0),
    ):
        made = evolution([start], refine=True, settle=settle, gradient=gradient)
        assert distances(made) == pytest.approx(found, abs=0.1)


def test_gaps_of_a_ridge_take_what_their_neighbours_found() -> None:
    gradient = gradient_ring(52.0)
    gradient[68:72, 130:] = 0  # four pixels of it have faded
    made = evolution([FreeForm.circle((90, 70), 50, 40, 3)], refine=True, gradient=gradient)
    assert distances(made).min() > 51.3
    assert distances(made).max() < 52.4


def test_a_settled_contour_does_not_cross_itself() -> None:
    """Two ridges closer together than the contour's own arms: samples of one arm are drawn to the other's ridge."""
    for width in (3.0, 4.0, 6.0):
        y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
        lines = np.minimum(abs(y - 70 + width / 2), abs(y - 70 - width / 2))
        gradient = np.rint(640 * np.exp(-0.5 * (lines / 1.2) ** 2) * (abs(x - 90) < 60)).astype(np.uint16)
        samples = [(40 + 2.5 * i, 70 - width / 2 + 2.0) for i in range(40)]
        samples += [(140 - 2.5 * i, 70 + width / 2 - 2.0) for i in range(41)]
        start = FreeForm.from_samples(np.array(samples), 3)
        made = evolution([start], refine=True, split_threshold=12.0, gradient=gradient)
        assert self_intersections(contours(made)) == [], width


def test_samples_the_domain_has_stopped_settle_at_its_limit() -> None:
    domain = np.zeros(SHAPE, np.uint8)
    domain[30:110, 40:140] = 255
    start = [FreeForm.circle((90, 70), 20, 20, 3)]
    made = evolution(start, domain=domain, refine=True, balloon=4.0, iterations=500, gradient=FLAT)
    mask = region(made)
    assert not mask[domain == 0].any()
    assert mask[31:109, 41:139].mean() > 0.98
    points = contours(made)[0].flatten(0.01)
    upper = points[(points[:, 1] < 50) & (abs(points[:, 0] - 90) < 30)]
    assert upper[:, 1].mean() == pytest.approx(29.5, abs=0.1)
    box = np.concatenate([contour.bounding_box for contour in contours(made)])
    assert hypot(*(box[0] - (39.5, 29.5))) < 0.6
    assert hypot(*(box[1] - (139.5, 109.5))) < 0.6


def test_an_edge_beyond_the_domain_draws_no_sample_out_of_it() -> None:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    domain = ((x - 90) ** 2 + (y - 70) ** 2 < 41**2).astype(np.uint8)
    start = [FreeForm.circle((90, 70), 39, 40, 3)]
    made = evolution(start, domain=domain, refine=True, settle=4.0, gradient=gradient_ring(43.0))
    assert 40.0 < distances(made).min() < distances(made).max() < 42.0


def facing(degree: int) -> list[FreeForm]:
    """Two circles of five patches; the middle of one patch of each lies where they overlap."""
    angles = np.arange(5 * degree) * 2 * pi / (5 * degree)
    circles = []
    for center, first in ((70.0, -pi / 5), (107.0, 0.0)):
        turned = angles + first
        circles.append(FreeForm(np.stack([center + 21 * np.cos(turned), 70 + 21 * np.sin(turned)], axis=1), degree))
    return circles


@pytest.mark.parametrize("degree", [2, 3, 4, 5, 6])
def test_a_flip_exchanges_the_halves_that_the_twin_exchanges(degree: int) -> None:
    """Algorithm 3 with k = floor(d / 2): the control points of both new patches, and the components they join."""
    apart = evolution(facing(degree), balloon=0.3, topology=False, iterations=1)
    joined = evolution(facing(degree), balloon=0.3, iterations=1)
    moved: list[naive.Component] = [contour.patches.tolist() for contour in contours(apart, degree)]
    components = [[[(x, y) for x, y in patch] for patch in component] for component in moved]
    assert naive.flip(components, []) == 1
    ((expected,), (found,)) = components, contours(joined, degree)
    assert (joined.counts()["flips"], joined.counts()["merges"]) == (1, 1)
    at = min(range(len(expected)), key=lambda i: hypot(*(np.array(expected[i][0]) - found.control_points[0])))
    np.testing.assert_allclose(found.patches, np.array(expected[at:] + expected[:at]), rtol=0, atol=1e-9)


def waist(degree: int) -> FreeForm:
    """Four patches: the upper and the lower one bulge through each other, lobes to the left and right of them."""

    def patch(a: tuple[float, float], b: tuple[float, float], across: tuple[float, float]) -> list[tuple[float, float]]:
        inner = [k / degree for k in range(1, degree)]
        return [a, *((across[0] or a[0] + t * (b[0] - a[0]), across[1] or a[1] + t * (b[1] - a[1])) for t in inner)]

    corners = [(70.0, 50.0), (110.0, 50.0), (110.0, 90.0), (70.0, 90.0)]
    across = [(0.0, 76.0), (150.0, 0.0), (0.0, 64.0), (30.0, 0.0)]
    sides = [patch(corners[i], corners[(i + 1) % 4], across[i]) for i in range(4)]
    return FreeForm(np.array([point for side in sides for point in side]), degree)


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_a_flip_separates_what_the_twin_separates(degree: int) -> None:
    apart = evolution([waist(degree)], balloon=0.3, topology=False, iterations=1)
    parted = evolution([waist(degree)], balloon=0.3, iterations=1)
    components = [[[(x, y) for x, y in patch] for patch in contours(apart, degree)[0].patches.tolist()]]
    inner: list[naive.Component] = []
    assert naive.flip(components, inner) == 1
    assert (parted.counts()["flips"], parted.counts()["merges"]) == (1, 0)
    ours = sorted((contour.patches for contour in contours(parted, degree)), key=lambda patches: patches[:, 0, 0].min())
    twins = sorted(components + inner, key=lambda patches: min(patch[0][0] for patch in patches))
    for one, other in zip(ours, twins, strict=True):
        at = min(range(len(other)), key=lambda i: hypot(*(np.array(other[i][0]) - one[0, 0])))
        np.testing.assert_allclose(one, np.array(other[at:] + other[:at]), rtol=0, atol=1e-9)


def test_a_ridge_finer_than_the_samples_is_followed() -> None:
    """Waves of 12 px: patches whose curve leaves the ridge between samples are split."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)

    def off(dx: NDArray[np.float64], dy: NDArray[np.float64]) -> NDArray[np.float64]:
        angle = np.arctan2(dy, dx)
        slope = 48 * np.cos(24 * angle) / 45
        return (np.hypot(dx, dy) - 45 - 2 * np.sin(24 * angle)) / np.sqrt(1 + slope**2)

    gradient = np.rint(640 * np.exp(-0.5 * (off(x - 90, y - 70) / 1.2) ** 2)).astype(np.uint16)
    angles = np.arange(240) * 2 * pi / 240
    made = evolution([around(angles, 44 + 2 * np.sin(24 * angles))], refine=True, gradient=gradient)
    points = contours(made)[0].flatten(0.01) - (90, 70)
    assert made.counts()["splits"] > 0
    assert np.abs(off(*points.T)).mean() < 0.18  # 0.13; 0.25 without splits


def test_crossings_of_a_settled_contour_are_taken_out() -> None:
    """A knot on a circle is drawn back, so that nothing is won by it; of a figure eight one lobe stays."""
    angles = np.arange(96) * 2 * pi / 96
    circle = [(90 + 40 * cos(a), 70 + 40 * sin(a)) for a in angles]
    knotted = [*circle[:20], (97, 112), (92, 106), (86, 110), (91, 114), (98, 108), (90, 109), *circle[26:]]
    eight = [(90 + 50 * cos(a), 70 + 30 * sin(2 * a)) for a in angles]
    for samples, least, most in ((knotted, 4950.0, pi * 40**2), (eight, 1950.0, 2050.0)):
        made = evolution([FreeForm.from_samples(np.array(samples), 3)], settle=0.01, gradient=FLAT)
        assert self_intersections(contours(made)) == []
        (area,) = (abs(contour.signed_area) for contour in contours(made))
        assert least < area < most


@pytest.mark.parametrize("balloon", [0.5, 1.0, 1.5])
def test_a_front_in_small_steps_stays_off_the_pixels_beside_edges(balloon: float) -> None:
    """Steps shorter than what is looked at beside edges stop at an edge as long ones do."""
    edges = np.zeros(SHAPE, np.uint8)
    edges[20:121, [30, 110]] = edges[[20, 120], 30:111] = 255
    start = [FreeForm.circle((70, 70), 12, 12, 3)]
    made = evolution(start, edges, balloon=balloon, refine=True, split_threshold=14.0, iterations=1001)
    found = region(made)
    assert made.stop_reason == "converged"
    assert found[30:111, 40:101].all()
    assert not (found & grown(edges > 0, 1)).any()


@pytest.mark.parametrize("degree", [3, 4])
def test_a_patch_that_folds_becomes_its_chord(degree: int) -> None:
    """In a notch narrower than a step is long the samples of both its patches run past each other."""
    angles = np.arange(24 * degree) * 2 * pi / (24 * degree)
    depth = np.where(np.abs(angles - pi / 2) < 0.26, 9 * np.cos((angles - pi / 2) / 0.26 * pi / 2), 0)
    made = evolution([around(angles, 30 - depth, degree)], balloon=4.0, topology=False, refine=True, iterations=1)
    (found,) = contours(made, degree)
    along = found.patches[:, -1] - found.patches[:, 0]
    inner = found.patches[:, 1:-1] - found.patches[:, :1]
    bent = np.abs(along[:, None, 0] * inner[..., 1] - along[:, None, 1] * inner[..., 0]).max(axis=1)
    straight = np.flatnonzero(bent < 1e-9)
    assert made.counts()["prunes"] == len(straight) == 2
    np.testing.assert_allclose(found.patches[straight, 0, 0].mean(), 90, atol=4)  # beside the notch


def test_an_obstacle_whose_neck_a_contour_crosses_stays_one() -> None:
    """The way round a box beside a wall, whose two sides have swapped places in between: the box is a hole then."""
    outline = [(20, 20), (160, 20), (160, 120), (81, 120), (99, 90), (120, 90), (120, 30), (60, 30), (60, 90), (81, 90)]
    outline += [(99, 120), (20, 120)]
    ring = shapely.LinearRing(outline)
    samples = [ring.interpolate(at / 180, normalized=True).coords[0] for at in range(180)]
    made = evolution([FreeForm.from_samples(np.array(samples), 3)], settle=0.01, gradient=FLAT)
    assert self_intersections(contours(made)) == []
    outer, hole = sorted((one.signed_area for one in contours(made)), reverse=True)
    assert outer == pytest.approx(140 * 100, rel=0.02)
    assert hole == pytest.approx(-60 * 60, rel=0.1)
