"""Single flips of the free form on contours made for them: what is joined, where, and what of it stays."""

from itertools import pairwise
from math import acos, cos, hypot, pi, sin

import naive_freeform as naive
import numpy as np
import pytest

from ffseg.geometry.freeform import FreeForm
from tests.crossings import self_intersections
from tests.evolutions import SHAPE, areas, box, contours, evolution, region

Point = tuple[float, float]


def meeting(p: list[Point], q: list[Point]) -> list[Point]:
    """Two polygons joined where they first cross: p up to there, then q, as evenly spaced points."""
    for a, b in ((a, b) for a in range(len(p) - 1) for b in range(len(q) - 1)):
        if naive.cross(p[a], p[a + 1], q[b], q[b + 1]):
            one, other = naive.side(p[a], p[a + 1], q[b]), naive.side(p[a], p[a + 1], q[b + 1])
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
    apart = evolution([one, two], balloon=0.3, topology=False)
    joined = evolution([one, two], balloon=0.3)
    apart.advance(1)
    joined.advance(1)
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
    made = evolution(starts, balloon=0.3)
    made.advance(1)
    assert made.counts()["flips"] == 2 * len(widths)
    assert len(contours(made)) == 1
    assert self_intersections(contours(made)) == []


def limacon() -> FreeForm:
    """r = 100 + 200 cos(a): an outer loop of 7 patches, and within it an inner one of 161."""
    node = acos(-0.5)
    joints = [*np.linspace(0.08 - node, node - 0.08, 7), *np.linspace(node + 0.02, 2 * pi - node - 0.02, 161)]
    joints.append(joints[0] + 2 * pi)
    angles = np.concatenate([np.linspace(a, b, 4)[:-1] for a, b in pairwise(joints)])
    radii = 100 + 200 * np.cos(angles)
    return FreeForm.from_samples(np.stack([100 + radii * np.cos(angles), 260 + radii * np.sin(angles)], axis=1), 3)


def test_the_outer_one_of_two_loops_stays_though_it_has_fewer_patches() -> None:
    """At the crossing the inner loop turns towards what is filled: it is that one whose ground is covered already."""
    made = evolution([limacon()], np.zeros((520, 460), np.uint8), balloon=0.3)
    made.advance(1)
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
    made = evolution([bulging_ends(8, 24, first)], np.zeros((440, 440), np.uint8), balloon=0.3)
    made.advance(1)
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
    made = evolution([start], edges, balloon=0.3)
    made.advance(3)
    assert region(made)[67, 90] != edge
    assert self_intersections(contours(made)) == []


def test_a_flip_does_not_cut_off_an_edge() -> None:
    """The exchanged halves would round the corner on the far side of the edge; joined at their crossing they do not."""
    edges = np.zeros(SHAPE, np.uint8)
    edges[[40, 41, 42], [86, 85, 84]] = 255
    starts = [box(20, 30, 80, 90, 2), box(75, 45, 135, 105, 2)]
    free, held = evolution(starts, balloon=0.3), evolution(starts, edges, balloon=0.3)
    free.advance(1)
    held.advance(1)
    assert (free.counts()["flips"], held.counts()["flips"]) == (2, 2)
    assert region(free)[42, 84]
    assert not region(held)[edges > 0].any()


def test_a_patch_over_several_strips_of_the_filter_is_in_each() -> None:
    """A box with one patch to a side meets a circle far below its upper end, among enough patches for two strips."""
    starts = [box(40, 40, 100, 600, 1), FreeForm.circle((100, 560), 12, 12, 3)]
    starts += [FreeForm.circle((140 + 30 * (i % 25), 100 + 30 * (i // 25)), 8, 12, 3) for i in range(50)]
    made = evolution(starts, np.zeros((640, 900), np.uint8), balloon=0.3)
    made.advance(1)
    assert made.counts()["merges"] == 1
    assert len(contours(made)) == 51


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
    made = evolution([eight(12, 0.9, 3)], balloon=0.3)
    made.advance(1)
    assert areas(made) == pytest.approx([pi * 40.3**2], rel=0.01)
    assert made.counts()["drops"] == 1


def test_a_component_beside_a_fold_stays_though_it_has_fewer_patches() -> None:
    """A small loop of the opposite orientation is a fold of the front and no hole in which the larger one would lie."""
    made = evolution([eight(4, 2.5, 8)], balloon=0.3)
    made.advance(1)
    assert made.counts()["flips"] == 1
    assert areas(made)[-1] == pytest.approx(pi * 40.3**2, rel=0.02)


def test_what_a_hole_is_cut_off_from_is_dropped_where_it_is_filled_already() -> None:
    """A ring that closes within another front: its hole has fewer patches, and its outline bounds nothing."""
    angles = np.linspace(-0.06, 2 * pi + 0.06, 37), np.linspace(2 * pi + 0.06, -0.06, 13)
    arcs = [np.stack([90 + r * np.cos(a), 70 + r * np.sin(a)], axis=1) for r, a in zip((45, 25), angles, strict=True)]
    steps = np.array([[1 / 3], [2 / 3]])
    ends = [a[-1] + steps * (b[0] - a[-1]) for a, b in zip(arcs, arcs[::-1], strict=True)]
    ring = FreeForm.from_samples(np.concatenate([arcs[0], ends[0], arcs[1], ends[1]]), 3)
    made = evolution([FreeForm.circle((90, 70), 62, 20, 3), ring], balloon=0.3)
    made.advance(1)
    assert made.counts()["flips"] >= 1
    assert [area > 0 for area in areas(made)] == [False, True]
    assert areas(made)[1] == pytest.approx(pi * 62.3**2, rel=0.01)
