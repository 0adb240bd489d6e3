"""What is joined, cut off, kept and dropped by flips of the free form, step by step and at the end."""

from functools import partial
from math import cos, pi, sin

import numpy as np
import pytest

import ffseg
from ffseg.geometry.freeform import FreeForm
from ffseg.image.raster import rasterize
from tests import evolutions, scenes
from tests.evolutions import SHAPE, Edges, areas, box, contours

evolution = partial(evolutions.evolution, refine=True)


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
    made = evolution(starts, blocks(places), balloon=balloon)
    made.advance(500)
    found = areas(made)
    assert made.stop_reason == "converged"
    assert [area > 0 for area in found] == [False] * len(places) + [True]
    inside = [sum(c.winding([[float(x), float(y)]])[0] for c in contours(made)) for x, y in places]
    assert inside == [0] * len(places)


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5])
def test_no_component_is_left_in_open_ground(degree: int) -> None:
    """Nine fronts meet: one outline stays, no sliver between them and nothing covered twice."""
    starts = [FreeForm.circle((40 + 48 * i, 30 + 40 * j), 9, 12, degree) for i in range(3) for j in range(3)]
    made = evolution(starts, balloon=3.0)
    made.advance(300)
    assert len(contours(made, degree)) == 1
    assert areas(made, degree)[0] > 0.97 * SHAPE[0] * SHAPE[1]


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
    made = evolution([one, two], balloon=0.3, refine=False)
    made.advance(1)
    outer = [contour for contour in contours(made) if contour.signed_area > 0]
    assert len(outer) == 1
    covered, found = rasterize((one, two), SHAPE), rasterize(contours(made), SHAPE)
    assert (covered & ~found).sum() <= 2 * 5 * 5  # half a square of a patch's length at either crossing
    grown = rasterize((box(19, 29, 81, 91, 6), box(79 - depth, 39 + offset, 141, 104 + offset, 6)), SHAPE)
    assert (found & ~grown).sum() <= 2 * 5 * 5


def test_a_start_within_another_that_it_never_meets_is_dropped_at_the_end() -> None:
    """A wall keeps them apart, but the outer one has filled the ground of the inner one already."""
    edges = np.zeros(SHAPE, np.uint8)
    for radius in (20, 60):
        for i in range(1200):
            a = 2 * pi * i / 1200
            edges[round(70 + radius * sin(a)), round(90 + radius * cos(a))] = 255
    made = evolution([FreeForm.circle((90, 70), 56, 40, 3), FreeForm.circle((90, 70), 8, 12, 3)], edges)
    made.advance(300)
    assert [area > 0 for area in areas(made)] == [True]
    assert areas(made)[0] > pi * 55**2


def test_a_fold_of_a_closing_front_is_dropped() -> None:
    """A front that closes in and has thrown a small loop: the loop turns the other way and bounds nothing."""
    angles = -np.arange(96) * 2 * pi / 96
    ring = np.stack([90 + 60 * np.cos(angles), 70 + 60 * np.sin(angles)], axis=1)
    loop = [(150.0 - 8 * sin(a) - 6, 70 + 6 * cos(a)) for a in np.arange(12) * 2 * pi / 12]
    for turned in (False, True):
        knot = np.array(loop[::-1] if turned else loop)
        start = FreeForm.from_samples(np.concatenate([ring[:1], knot, ring[1:], ring[:0]])[:108], 3)
        edges = np.zeros(SHAPE, np.uint8)
        edges[60:80, 80:100] = 255
        made = evolution([start], edges, balloon=2.0)
        made.advance(300)
        assert [area > 0 for area in areas(made)] == [False]
        assert -1100 < areas(made)[0] < -400


@pytest.mark.parametrize("row", [196.5, 203.0, 401.5])
def test_fronts_meet_across_the_borders_of_strips(row: float) -> None:
    """Circles that stand a little higher and lower in turns, where the filter cuts a large image."""
    shape = (600, 1200)
    starts = [FreeForm.circle((40 + 35.7 * i, row + 5 * (i % 2)), 12, 25, 3) for i in range(32)]
    more = [FreeForm.circle((40 + 30 * i, 520), 5, 25, 3) for i in range(32)]
    made = evolution([*starts, *more], np.zeros(shape, np.uint8), balloon=2.0, refine=False)
    made.advance(5)
    upper = [contour for contour in contours(made) if contour.bounding_box[0][1] < 450]
    assert sum(contour.signed_area > 0 for contour in upper) == 1


@pytest.mark.parametrize(("shape", "radius"), [((1, 1), 40), ((1, 140), 6), ((5, 1), 40)])
def test_no_hole_is_left_without_a_region(shape: tuple[int, int], radius: float) -> None:
    """A start wider than the image is turned inside out; the table had a hole in nothing."""
    result = ffseg.segment(np.zeros(shape, np.uint8), {"init.radius": radius})
    assert (result.mask.any(), result.contours, result.num_holes) == (False, (), 0)
