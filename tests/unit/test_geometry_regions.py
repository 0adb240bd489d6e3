"""Winding numbers of curves and the grouping of holes."""

import numpy as np

from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.regions import group_regions, oriented


def circle(x: float, y: float, radius: float, degree: int = 3) -> FreeForm:
    return FreeForm.circle((x, y), radius, 12, degree)


def test_winding_of_a_circle_close_to_its_curve() -> None:
    ring = circle(0, 0, 10, 6)  # within 1e-9 px of the true circle
    angle = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    assert (ring.winding(unit * (10 - 1e-6)) == 1).all()
    assert (ring.winding(unit * (10 + 1e-6)) == 0).all()
    assert (ring.reversed().winding(unit * 9.9) == -1).all()


def test_winding_keeps_the_shape_of_the_points() -> None:
    ring = circle(0, 0, 10)
    assert ring.winding([0.0, 0.0]).shape == ()
    assert ring.winding(np.zeros((2, 3, 2))).shape == (2, 3)
    assert ring.winding(np.zeros((0, 2))).shape == (0,)


def test_winding_counts_turns() -> None:
    t = np.arange(12) * (4 * np.pi / 12) + 0.1
    twice = FreeForm.from_samples(np.stack([np.cos(t), np.sin(t)], axis=-1) * (10 + t[:, None]), 3)
    assert twice.winding([0.0, 0.0]) == 2


def test_winding_on_a_box_is_half_open_like_the_raster() -> None:
    box = FreeForm.box(0, 0, 4, 3).elevated(3)
    y, x = np.indices((5, 6))
    inside = box.winding(np.stack([x, y], axis=-1)) == 1
    np.testing.assert_array_equal(inside, (x < 4) & (y < 3))


def test_holes_go_to_the_smallest_outer_round_them() -> None:
    sea, lake, island = circle(50, 50, 40), circle(50, 50, 25).reversed(), circle(50, 50, 15)
    pond, far = circle(50, 50, 5).reversed(), circle(200, 50, 20)
    regions = group_regions([pond, sea, far, lake, island])
    assert [r.outer for r in regions] == [sea, far, island]
    assert [r.holes for r in regions] == [(lake,), (), (pond,)]
    assert regions[0].contours == (sea, lake)
    assert regions[0].area == sea.signed_area + lake.signed_area


def test_lost_and_empty_contours_are_dropped() -> None:
    stray = circle(0, 0, 5).reversed()
    flat = FreeForm.polygon([(0, 0), (5, 0)])
    assert group_regions([stray, flat]) == ()
    assert group_regions([]) == ()


def test_a_hole_that_touches_its_outer_stays_with_it() -> None:
    outer, hole = FreeForm.box(0, 0, 10, 10), FreeForm.box(0, 0, 5, 5).reversed()
    edge = FreeForm.box(-1e-9, 2, 4, 6).reversed()
    (region,) = group_regions([hole, outer, edge])
    assert region.holes == (hole, edge)


def test_holes_of_different_degrees_are_asked_at_their_own_points() -> None:
    rng = np.random.default_rng(5)
    outers = [circle(x, y, 30) for x in (40, 120, 200) for y in (40, 120)]
    holes = [
        FreeForm.circle(outer.control_points.mean(axis=0) + rng.uniform(-9, 9, 2), 8, 7 + degree, degree).reversed()
        for outer in outers
        for degree in range(1, 7)
    ]
    mixed = [holes[index] for index in rng.permutation(len(holes))]
    regions = group_regions([*mixed, *outers])
    for outer, region in zip(outers, regions, strict=True):
        middle = outer.control_points.mean(axis=0)
        near = [hole for hole in mixed if np.hypot(*(hole.control_points.mean(axis=0) - middle)) < 30]
        assert len(near) == 6
        assert region.holes == tuple(near)


def test_contours_that_run_the_wrong_way_are_turned() -> None:
    outer, hole, island = circle(50, 50, 40), circle(50, 50, 20).reversed(), circle(50, 50, 5)
    right = (outer, hole, island, circle(150, 50, 10))
    assert oriented(right) == right  # the very same
    signs = [1, -1, 1, 1]
    for wrong in (
        [contour.reversed() for contour in right],
        [outer, hole, island, right[3].reversed()],
        [outer, hole, island, right[3]],
    ):
        found = oriented(wrong)
        assert np.sign([contour.signed_area for contour in found]).tolist() == signs
        for one, other in zip(found, right, strict=True):
            np.testing.assert_array_equal(np.sort(one.control_points, axis=0), np.sort(other.control_points, axis=0))
    assert oriented([]) == ()
    flat = FreeForm.polygon([(0, 0), (5, 0)])
    assert oriented([flat]) == (flat,)
