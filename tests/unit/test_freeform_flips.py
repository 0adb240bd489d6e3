"""Flips of the free form on contours made for them: what is joined, cut off, kept and dropped, and where."""

from functools import partial
from itertools import pairwise
from math import acos, cos, hypot, pi, sin

import naive_freeform as naive
import numpy as np
import pytest

import ffseg
from ffseg.geometry.freeform import FreeForm
from ffseg.image.raster import rasterize
from tests import evolutions, scenes
from tests.crossings import self_intersections
from tests.evolutions import SHAPE, Edges, areas, around, box, contours, evolution, region, ring

Point = tuple[float, float]


def meeting(p: list[Point], q: list[Point]) -> list[Point]:
    """Two polygons joined where they first cross: p up to there, then q, as evenly spaced points."""
    for a, b in ((a, b) for a in range(len(p) - 1) for b in range(len(q) - 1)):
        if naive.cross(p[a], p[a + 1], q[b], q[b + 1]):
            one, other = naive.turn(p[a], p[a + 1], q[b]), naive.turn(p[a], p[a + 1], q[b + 1])
            u = one / (one - other)
            at = (q[b][0] + u * (q[b + 1][0] - q[b][0]), q[b][1] + u * (q[b + 1][1] - q[b][1]))
            return evenly([*p[: a + 1], at, *q[b + 1 :]], len(p))
    raise AssertionError("they do not cross")


def evenly(path: list[Point], count: int) -> list[Point]:
    lengths = [hypot(bx - ax, by - ay) for (ax, ay), (bx, by) in pairwise(path)]
    places = np.cumsum([0.0, *lengths])
    along = np.linspace(0, places[-1], count)
    return list(zip(*(np.interp(along, places, axis) for axis in zip(*path, strict=True)), strict=True))


@pytest.mark.parametrize("late", [False, True])
def test_curves_that_cross_near_an_end_are_joined_where_they_cross(late: bool) -> None:
    """The halves would still cross; the new curves run evenly along both sides of the corner."""
    one, two = box(20, 30, 80, 90, 2), box(55, 55, 115, 115, 2) if late else box(75, 35, 135, 95, 2)
    apart = evolution([one, two], balloon=0.3, topology=False, iterations=1)
    joined = evolution([one, two], balloon=0.3, iterations=1)
    (outline,) = contours(joined)
    first, second = (
        [
            [(x, y) for x, y in part.evaluate(np.arange(4) / 3 / part.num_patches + i / part.num_patches)]
            for i in range(8)
        ]
        for part in contours(apart)
    )
    crossing = [(p, q) for p in first for q in second if naive.crossings(p, q)]
    assert len(crossing) == 2
    assert (joined.counts()["flips"], joined.counts()["merges"], joined.counts()["drops"]) == (2, 1, 1)
    assert self_intersections([outline]) == []
    for p, q in crossing:
        candidates = [meeting(p, q), meeting(q, p)]  # one bounds what both cover, the other lies within it
        distances = [
            np.abs(outline.patches - np.array(naive.interpolate(path))).max(axis=(1, 2)).min() for path in candidates
        ]
        assert min(distances) < 1e-9


@pytest.mark.parametrize("widths", [[(44, 52)], [(44, 52), (85, 93)]])
def test_a_patch_that_another_crosses_twice_is_done_with_in_one_iteration(widths: list[tuple[int, int]]) -> None:
    """What a flip has changed is looked at again in the next round: few patches, and enough for the sorted sweep."""
    starts = [box(20, 60, 160, 110, 7), *(box(left, 40, right, 80, 3) for left, right in widths)]
    made = evolution(starts, balloon=0.3, iterations=1)
    assert (made.counts()["flips"], len(contours(made))) == (2 * len(widths), 1)
    assert self_intersections(contours(made)) == []


def limacon() -> FreeForm:
    """r = 100 + 200 cos(a): an outer loop of 7 patches, and within it an inner one of 161."""
    node = acos(-0.5)
    joints = [*np.linspace(0.08 - node, node - 0.08, 7), *np.linspace(node + 0.02, 2 * pi - node - 0.02, 161)]
    joints.append(joints[0] + 2 * pi)
    angles = np.concatenate([np.linspace(a, b, 4)[:-1] for a, b in pairwise(joints)])
    return around(angles, 100 + 200 * np.cos(angles), at=(100, 260))


def test_the_outer_one_of_two_loops_stays_though_it_has_fewer_patches() -> None:
    """At the crossing the inner loop turns towards what is filled: it is that one whose ground is covered already."""
    made = evolution([limacon()], np.zeros((520, 460), np.uint8), balloon=0.3, iterations=1)
    node = acos(-0.5)
    outer = 100**2 * node + 2 * 100 * 200 * sin(node) + 0.5 * 200**2 * (node + 0.5 * sin(2 * node))
    assert made.counts()["flips"] == 1
    assert areas(made)[-1] == pytest.approx(outer, rel=0.02)


def bulging_ends(outer: int, inner: int, first: int) -> FreeForm:
    """A ring whose two ends, a patch each, bulge through each other; the contour begins with patch `first`."""

    def end(angle: float, bulge: float, inwards: bool) -> list[Point]:
        places = [(angle + bulge * 4 * t * (1 - t), 200 - 50 * (t if inwards else 1 - t)) for t in (0, 1 / 3, 2 / 3)]
        return [(r * cos(a), r * sin(a)) for a, r in places]

    half = 4 / 175
    out = np.linspace(half, 2 * pi - half, 3 * outer + 1)[:-1]
    back = np.linspace(2 * pi - half, half, 3 * inner + 1)[:-1]
    points = [(200 * cos(a), 200 * sin(a)) for a in out] + end(2 * pi - half, 2 * half, True)
    points += [(150 * cos(a), 150 * sin(a)) for a in back] + end(half, -2 * half, False)
    return FreeForm.from_samples(np.roll(np.array(points) + 220, -3 * first, axis=0), 3)


@pytest.mark.parametrize("first", [0, 9])
def test_ends_that_cross_twice_leave_the_outline_and_the_hole(first: int) -> None:
    """Which of the two turns inwards cannot be told from one of two crossings."""
    made = evolution([bulging_ends(8, 24, first)], np.zeros((440, 440), np.uint8), balloon=0.3, iterations=1)
    assert areas(made) == pytest.approx([-pi * 149.7**2, pi * 200.3**2], rel=0.01)


@pytest.mark.parametrize("edge", [False, True])
def test_a_loop_of_adjacent_patches_round_an_edge_is_not_cut_off(edge: bool) -> None:
    """They are halved instead, so that halves that are not adjacent cross; in open ground the loop is dropped."""
    knot = [(60.0, 90.0), (110.0, 40.0), (110.0, 110.0), (90.0, 60.0), (70.0, 110.0), (70.0, 40.0), (120.0, 90.0)]
    back = [(140.0, 95.0), (140.0, 120.0), (120.0, 120.0), (100.0, 121.0), (80.0, 121.0), (60.0, 120.0)]
    start = FreeForm(np.array([*knot, *back, (40.0, 120.0), (40.0, 95.0)]), 3)
    assert start.winding([[90.0, 67.0]]).tolist() == [-1]
    edges = np.zeros(SHAPE, np.uint8)
    edges[67, 90] = 255 * edge
    made = evolution([start], edges, balloon=0.3, iterations=3)
    assert region(made)[67, 90] != edge
    assert self_intersections(contours(made)) == []
    assert made.counts()["flips"] >= 1
    if not edge:
        (outline,) = contours(made)
        assert outline.num_patches < start.num_patches


def test_a_flip_does_not_cut_off_an_edge() -> None:
    """The exchanged halves would round the corner on the far side of the edge; joined at their crossing they do not."""
    edges = np.zeros(SHAPE, np.uint8)
    edges[[40, 41, 42], [86, 85, 84]] = 255
    starts = [box(20, 30, 80, 90, 2), box(75, 45, 135, 105, 2)]
    free, held = (evolution(starts, known, balloon=0.3, iterations=1) for known in (None, edges))
    assert (free.counts()["flips"], held.counts()["flips"]) == (2, 2)
    assert region(free)[42, 84]
    assert not region(held)[edges > 0].any()


def test_a_patch_over_several_strips_of_the_filter_is_in_each() -> None:
    """A box with one patch to a side meets a circle far below its upper end, among enough patches for two strips."""
    starts = [box(40, 40, 100, 600, 1), FreeForm.circle((100, 560), 12, 12, 3)]
    starts += [FreeForm.circle((140 + 30 * (i % 25), 100 + 30 * (i // 25)), 8, 12, 3) for i in range(50)]
    made = evolution(starts, np.zeros((640, 900), np.uint8), balloon=0.3, iterations=1)
    assert (made.counts()["merges"], len(contours(made))) == (1, 51)


def eight(patches: int, loop_radius: float, loop_patches: int) -> FreeForm:
    """A circle of radius 40 with a small loop outside it that turns the other way; two straight patches cross there."""
    far, near = 1.5 / 40, 0.8
    out = np.linspace(far, 2 * pi - far, 3 * patches + 1)
    loop = np.linspace(pi - near, near - pi, 3 * loop_patches + 1)
    circle = np.stack([90 + 40 * np.cos(out), 70 + 40 * np.sin(out)], axis=1)
    small = np.stack([130 + loop_radius * (1 + np.cos(loop)), 70 + loop_radius * np.sin(loop)], axis=1)
    steps = np.array([[1 / 3], [2 / 3]])
    there = circle[-1] + steps * (small[0] - circle[-1])
    back = small[-1] + steps * (circle[0] - small[-1])
    return FreeForm.from_samples(np.concatenate([circle, there, small, back]), 3)


def test_a_component_of_negligible_area_is_dropped_at_once() -> None:
    made = evolution([eight(12, 0.9, 3)], balloon=0.3, iterations=1)
    assert areas(made) == pytest.approx([pi * 40.3**2], rel=0.01)
    assert made.counts()["drops"] == 1


def test_a_component_beside_a_fold_stays_though_it_has_fewer_patches() -> None:
    """A small loop of the opposite orientation is a fold of the front and no hole in which the larger one would lie."""
    made = evolution([eight(4, 2.5, 8)], balloon=0.3, iterations=1)
    assert made.counts()["flips"] == 1
    assert areas(made)[-1] == pytest.approx(pi * 40.3**2, rel=0.02)


def test_what_a_hole_is_cut_off_from_is_dropped_where_it_is_filled_already() -> None:
    """A ring that closes within another front: its hole has fewer patches, and its outline bounds nothing."""
    angles = np.linspace(-0.06, 2 * pi + 0.06, 37), np.linspace(2 * pi + 0.06, -0.06, 13)
    arcs = [np.stack([90 + r * np.cos(a), 70 + r * np.sin(a)], axis=1) for r, a in zip((45, 25), angles, strict=True)]
    steps = np.array([[1 / 3], [2 / 3]])
    ends = [a[-1] + steps * (b[0] - a[-1]) for a, b in zip(arcs, arcs[::-1], strict=True)]
    ring = FreeForm.from_samples(np.concatenate([arcs[0], ends[0], arcs[1], ends[1]]), 3)
    made = evolution([FreeForm.circle((90, 70), 62, 20, 3), ring], balloon=0.3, iterations=1)
    assert made.counts()["flips"] >= 1
    assert [area > 0 for area in areas(made)] == [False, True]
    assert areas(made)[1] == pytest.approx(pi * 62.3**2, rel=0.01)


refined = partial(evolutions.evolution, refine=True)


def blocks(places: list[tuple[int, int]], half: int = 2) -> Edges:
    edges = np.zeros(SHAPE, np.uint8)
    for x, y in places:
        edges[y - half : y + half + 1, x - half : x + half + 1] = 255
    return edges


@pytest.mark.parametrize("balloon", [2.0, 4.0])
@pytest.mark.parametrize("shift", range(0, 12, 2))
def test_fronts_that_meet_over_obstacles_leave_a_hole_round_each(shift: int, balloon: float) -> None:
    """However the patches lie when they meet: what a flip cuts off is never an obstacle."""
    places = [(90, 26 + shift), (91, 58 + shift), (89, 90 + shift), (94, 118)]
    starts = [FreeForm.circle((40 + shift / 3, 70), 12, 13, 3), FreeForm.circle((141, 70 - shift / 2), 12, 13, 3)]
    made = refined(starts, blocks(places), balloon=balloon, iterations=500)
    found = areas(made)
    assert (made.stop_reason, [area > 0 for area in found]) == ("converged", [False] * len(places) + [True])
    inside = [sum(c.winding([[float(x), float(y)]])[0] for c in contours(made)) for x, y in places]
    assert inside == [0] * len(places)


def test_hundreds_of_fronts_that_meet_leave_holes_round_obstacles_only() -> None:
    """So many loops that turn inside out at once are asked for by rows."""
    edges, places = np.zeros((300, 300), np.uint8), [(18.0 * x, 18.0 * y) for x in range(1, 16) for y in range(1, 16)]
    between = [(round(x) + 9, round(y) + 9) for x, y in places if (x + y) % 5 == 0]
    for x, y in between:
        edges[y - 1 : y + 2, x - 1 : x + 2] = 255
    found = areas(evolution([FreeForm.circle(one, 6, 8, 3) for one in places], edges, iterations=300, refine=True))
    assert [area > 0 for area in found] == [False] * len(between) + [True]


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5])
def test_no_component_is_left_in_open_ground(degree: int) -> None:
    """Nine fronts meet: one outline stays, no sliver between them and nothing covered twice."""
    starts = [FreeForm.circle((40 + 48 * i, 30 + 40 * j), 9, 12, degree) for i in range(3) for j in range(3)]
    made = refined(starts, balloon=3.0, iterations=300)
    assert len(contours(made, degree)) == 1
    assert areas(made, degree)[0] > 0.97 * SHAPE[0] * SHAPE[1]


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("radius", [6, 9, 12, 15, 18])
def test_a_hole_that_its_front_passes_in_one_step_is_gone(radius: int, degree: int) -> None:
    """Each sample reaches the other side at once: what comes out there has its old orientation, and crosses nothing."""
    outer, inner = (FreeForm.circle((SHAPE[1] / 2, SHAPE[0] / 2), r, 8, degree) for r in (radius + 4, radius))
    made = refined([outer, inner.reversed()], iterations=300)
    assert (made.stop_reason, len(contours(made, degree))) == ("converged", 1)


@pytest.mark.parametrize("degree", [5, 6])
def test_a_twisted_loop_loses_no_obstacle_that_it_holds(degree: int) -> None:
    """Round a spot of 3 x 3 px the front of a ring closes to two lobes as large, of one hole and of none."""
    image = np.full((116, 93), 150, np.uint8)
    image[59:62, 46:49] = 20
    distance = np.hypot(*(axis - at for axis, at in zip(np.mgrid[:116, :93], (22, 24), strict=True)))
    ring = ((distance > 15.5) & (distance < 20.5)).astype(np.uint8)
    result = ffseg.segment(image, {"contour.degree": degree, "edges.source": "gradient"}, start_mask=ring)
    assert result.num_holes == 1
    assert not result.mask[60, 47]


@pytest.mark.parametrize("seed", range(8))
def test_a_single_front_never_covers_ground_twice(seed: int) -> None:
    """One start: after every iteration there is one outer component, and no two contours cross."""
    scene = scenes.scene(seed)
    params = ffseg.load_params(None, {"init.center": list(scenes.START), "init.radius": scenes.START_RADIUS})
    seen: list[ffseg.Progress] = []
    result = ffseg.segment(scene.image, params, callback=seen.append)
    for progress in [*seen, ffseg.Progress(-1, result.contours)]:
        positive = [contour.signed_area for contour in progress.contours if contour.signed_area > 0]
        assert len(positive) == 1, progress.iteration
        assert min(abs(contour.signed_area) for contour in progress.contours) >= 4.0, progress.iteration


@pytest.mark.parametrize("offset", [0.0, 1.5, 3.0, 4.5, 6.0, 7.5, 9.0])
@pytest.mark.parametrize("depth", [2.0, 5.0, 9.0])
def test_what_two_boxes_cover_together_stays_covered(offset: float, depth: float) -> None:
    """Sides cross anywhere along their patches: near an end, curves are joined where they cross, and nothing sticks out."""
    one, two = box(20, 30, 80, 90, 6), box(80 - depth, 30 + offset + 10, 140, 90 + offset + 13, 6)
    made = refined([one, two], balloon=0.3, refine=False, iterations=1)
    outer = [contour for contour in contours(made) if contour.signed_area > 0]
    assert len(outer) == 1
    covered, found = rasterize((one, two), SHAPE), rasterize(contours(made), SHAPE)
    assert (covered & ~found).sum() <= 2 * 5 * 5  # half a square of a patch's length at either crossing
    grown = rasterize((box(19, 29, 81, 91, 6), box(79 - depth, 39 + offset, 141, 104 + offset, 6)), SHAPE)
    assert (found & ~grown).sum() <= 2 * 5 * 5


def test_a_start_within_another_that_it_never_meets_is_dropped_at_the_end() -> None:
    """A wall keeps them apart, but the outer one has filled the ground of the inner one already."""
    edges = ring(20) | ring(60)
    made = refined([FreeForm.circle((90, 70), 56, 40, 3), FreeForm.circle((90, 70), 8, 12, 3)], edges, iterations=300)
    assert [area > 0 for area in areas(made)] == [True]
    assert areas(made)[0] > pi * 55**2


def test_a_fold_of_a_closing_front_is_dropped() -> None:
    """A front that closes in and has thrown a small loop: the loop turns the other way and bounds nothing."""
    angles = -np.arange(96) * 2 * pi / 96
    front = np.stack([90 + 60 * np.cos(angles), 70 + 60 * np.sin(angles)], axis=1)
    loop = [(150.0 - 8 * sin(a) - 6, 70 + 6 * cos(a)) for a in np.arange(12) * 2 * pi / 12]
    for turned in (False, True):
        knot = np.array(loop[::-1] if turned else loop)
        start = FreeForm.from_samples(np.concatenate([front[:1], knot, front[1:]]), 3)
        made = refined([start], blocks([(90, 70)], 10), balloon=2.0, iterations=300)
        assert [area > 0 for area in areas(made)] == [False]
        assert -1100 < areas(made)[0] < -400


@pytest.mark.parametrize("row", [196.5, 203.0, 401.5])
def test_fronts_meet_across_the_borders_of_strips(row: float) -> None:
    """Circles that stand a little higher and lower in turns, where the filter cuts a large image."""
    shape = (600, 1200)
    starts = [FreeForm.circle((40 + 35.7 * i, row + 5 * (i % 2)), 12, 25, 3) for i in range(32)]
    more = [FreeForm.circle((40 + 30 * i, 520), 5, 25, 3) for i in range(32)]
    made = refined([*starts, *more], np.zeros(shape, np.uint8), balloon=2.0, refine=False, iterations=5)
    upper = [contour for contour in contours(made) if contour.bounding_box[0][1] < 450]
    assert sum(contour.signed_area > 0 for contour in upper) == 1


@pytest.mark.parametrize(("shape", "radius"), [((1, 1), 40), ((1, 140), 6), ((5, 1), 40)])
def test_no_hole_is_left_without_a_region(shape: tuple[int, int], radius: float) -> None:
    """A start wider than the image is turned inside out; the table had a hole in nothing."""
    result = ffseg.segment(np.zeros(shape, np.uint8), {"init.radius": radius})
    assert (result.mask.any(), result.contours, result.num_holes) == (False, (), 0)
