"""Start circles over a boundary: on one side of it, and said so, where the image's own edges decide."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

import ffseg
from ffseg.image.free import clear_distances, free_part_under, free_pixels, open_sides
from ffseg.image.raster import rasterize
from ffseg.starts import sides
from ffseg.starts.initial import circle_start
from ffseg.starts.moved import SPARE_MARGIN, nearest_free_circle
from tests.discs import overlap
from tests.small_things import small_things

CENTER, RADIUS, START = (110.0, 100.0), 60.0, 14.0


def disc() -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    y, x = np.mgrid[:200, :220]
    depth = RADIUS - np.hypot(x - CENTER[0], y - CENTER[1])
    return np.round(50 + 150 * np.clip(depth + 0.5, 0, 1)).astype(np.uint8), depth >= 0


def start(over: float, angle: float) -> dict[str, object]:
    """A start circle that reaches so far over the boundary."""
    along = RADIUS + over - START
    center = [CENTER[0] + along * np.cos(angle), CENTER[1] + along * np.sin(angle)]
    return {"init.center": center, "init.radius": START}


@pytest.mark.parametrize("over", [1.0, 2.0, 4.0, 6.0, 10.0])
@pytest.mark.parametrize("angle", [0.0, 0.6, 2.4, 4.0])
def test_a_start_over_the_boundary_keeps_to_the_side_of_most_of_it(over: float, angle: float) -> None:
    image, truth = disc()
    found = ffseg.segment(image, ffseg.load_params(None, start(over, angle)))
    assert overlap(found.mask, truth) > 0.99
    assert len(found.messages) == 1
    assert "lay across an edge and was moved to (" in found.messages[0]
    assert found.stats.stop_reason == "converged"


def test_the_other_side_is_taken_where_most_of_the_start_lies_there() -> None:
    image, truth = disc()
    found = ffseg.segment(image, ffseg.load_params(None, start(2 * START - 4, 1.0)))
    assert overlap(found.mask, ~truth) > 0.99
    assert "was moved to" in found.messages[0]


@pytest.mark.parametrize("method", ["snake", "levelset"])
def test_other_methods_are_given_the_same_start(method: str) -> None:
    image, truth = disc()
    found = ffseg.segment(image, ffseg.load_params(None, {**start(5.0, 0.3), "method": method}))
    assert not found.mask[~cv2.dilate(truth.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)].any()
    assert "lay across an edge" in found.messages[0]


def test_one_of_several_starts_is_moved() -> None:
    image, truth = disc()
    circles = [[*start(5.0, 0.3)["init.center"], START], [CENTER[0] - 20, CENTER[1], 9.0]]  # type: ignore[misc]
    found = ffseg.segment(image, {"init.circles": circles})
    assert overlap(found.mask, truth) > 0.99
    assert len(found.messages) == 1


def test_one_of_several_starts_that_lies_outside_the_domain_is_left_out() -> None:
    image, domain = np.full((120, 240), 90, np.uint8), np.zeros((120, 240), np.uint8)
    domain[:, 120:] = 255
    found = ffseg.segment(image, {"init.circles": [[180, 60, 5], [40, 60, 5]]}, domain=domain)
    assert not found.mask[:, :120].any()
    assert any("lies outside the domain and was left out" in one for one in found.messages)


def test_a_mark_within_the_start_is_no_boundary() -> None:
    image, truth = disc()
    cv2.circle(image, (110, 100), 4, 60, -1)
    found = ffseg.segment(image, ffseg.load_params(None, {"init.center": list(CENTER), "init.radius": START}))
    assert found.messages == ()
    assert overlap(found.mask, truth) > 0.98


def test_a_start_that_would_lose_most_of_itself_stays_and_is_told() -> None:
    """A circle across five strips is no circle a little over a boundary."""
    image = np.where(np.arange(160) // 11 % 2 == 0, 60, 190).astype(np.uint8)[None].repeat(140, axis=0)
    found = ffseg.segment(image, {"init.center": [80, 70], "init.radius": 25, "edges.source": "gradient"})
    assert len(found.messages) == 1
    assert "the start at (80, 70), radius 25 lies across an edge" in found.messages[0]


def test_boxes_and_what_closes_in_may_lie_across_edges() -> None:
    image, _ = disc()
    box = ffseg.segment(image, {"init.boxes": [[140, 80, 180, 120]]})
    closed = ffseg.segment(image, {"init.circles": [[110, 100, 65]], "contour.balloon": -6.0})
    assert not any("across an edge" in message for message in (*box.messages, *closed.messages))


def test_slits_join_and_make_no_sides() -> None:
    free = np.ones((40, 60), np.bool_)
    free[:, 30] = False
    free[20, 30] = True  # a slit of one pixel
    sides = open_sides(free)
    assert sides[30, 10] != sides[30, 50]
    assert min(sides[30, 10], sides[30, 50]) > 0
    assert sides[20, 30] == 0


def test_a_start_round_a_camera_stays_though_the_robot_is_seen_in_it() -> None:
    """The camera's own centre: most of the circle shows the robot, the floor begins at its rim."""
    image, truth = disc()
    center = (CENTER[0] + 6, CENTER[1])
    found = ffseg.segment(image, {"init.radius": RADIUS}, center=center)
    assert not any("moved" in message for message in found.messages)
    assert found.mask[~truth].mean() > 0.95
    moved = ffseg.segment(image, {"init.center": list(center), "init.radius": RADIUS})
    assert "was moved to" in moved.messages[0]
    assert moved.mask[~truth].mean() < 0.1


@pytest.mark.parametrize("seed", range(12))
def test_what_is_far_from_a_start_does_not_matter(seed: int) -> None:
    """The window that is looked at gives what the whole image gives."""
    rng = np.random.default_rng(seed)
    edges = (rng.random((220, 260)) < 0.004).astype(np.uint8)
    edges[:, int(rng.integers(60, 200))] = 1
    free = free_pixels(edges, None)
    labels = open_sides(free)
    old = circle_start((*rng.uniform((20, 20), (240, 200)), float(rng.uniform(4, 18))), ffseg.load_params())
    ground = free_part_under(labels > 0, rasterize([old], free.shape))
    _, whole = nearest_free_circle(old, clear_distances(free) - SPARE_MARGIN, ground)
    for most in (1, sides.SEARCH_RADII):
        found = sides._moved(old, free, labels, most)[1]
        assert (found.x, found.y) == (whole.x, whole.y)
        assert found.radius == pytest.approx(whole.radius, rel=1e-5)  # distances are summed in single precision


def test_a_start_round_the_robot_in_a_mirror_means_the_ground() -> None:
    """Most of the start shows the robot, a dark disc in the middle of the mirror's; who starts there means what is round it."""
    y, x = np.mgrid[:300, :300]
    depth = np.hypot(x - 150, y - 150)
    image = np.where(depth < 140, np.where(x + y > 400, 230, 150), 5)
    robot = depth < 25
    image = cv2.GaussianBlur(np.where(robot, 30, image).astype(np.uint8), (0, 0), 0.7)
    found = ffseg.segment(image, {"init.center": [162, 150], "init.radius": 26, "edges.source": "gradient"})
    ground = (depth < 136) & (x + y < 396) & (depth > 29)
    assert found.mask[ground].mean() > 0.95
    assert any("across an edge" in message for message in found.messages)


@pytest.mark.parametrize("hole", [(30, 8, 10), (14, 0, 8), (0, 0, 5)])
def test_a_start_over_ground_outside_the_domain_leaves_it(hole: tuple[int, int, int]) -> None:
    """What a start covers outside the domain stayed in the region, with a score of one and no word."""
    image, truth = disc()
    right, down, radius = hole
    domain = np.full(image.shape, 255, np.uint8)
    cv2.circle(domain, (110 + right, 100 + down), radius, 0, -1)
    found = ffseg.segment(image, {"init.center": list(CENTER), "init.radius": 25}, domain=domain)
    assert overlap(found.mask, truth & (domain > 0)) > 0.98
    assert "lay across the domain's limit and was moved to (" in found.messages[0]


@pytest.mark.parametrize(
    ("noise", "source", "least"), [(10.0, "gradient", 0.9), (25.0, "gradient", 0.9), (40.0, "prior", 0.4)]
)
def test_a_start_of_no_named_radius_finds_the_small_thing_in_it(noise: float, source: str, least: float) -> None:
    """Clear edges let it fill the image, with the small thing, and the prior took that for its surroundings."""
    image, truth = small_things(noise)
    found = ffseg.segment(image, {"init.center": [120, 90]})
    assert (found.source, overlap(found.mask, truth) > least) == (source, True)
    assert "edges part the start at (120, 90), radius 12: it was taken for a click, of radius 2.4" in found.messages
    named = ffseg.segment(image, {"init.center": [120, 90], "init.radius": 12})
    assert overlap(named.mask, truth) < 0.15, "who names a radius means all of it"
    assert not any("click" in message for message in named.messages)


def test_what_is_watched_is_what_is_found() -> None:
    image, _ = small_things(10.0)
    steps: list[ffseg.Progress] = []
    plain = ffseg.segment(image, {"init.center": [120, 90]})
    watched = ffseg.segment(image, {"init.center": [120, 90]}, callback=steps.append)
    assert [one.control_points.tolist() for one in watched.contours] == [
        one.control_points.tolist() for one in plain.contours
    ]
    assert watched.messages == plain.messages
    assert abs(steps[0].contours[0].signed_area) < 30, "it begins at the click"


def test_a_start_that_no_edge_parts_keeps_its_size() -> None:
    image, truth = disc()
    found = ffseg.segment(image, {"init.center": list(CENTER)})
    assert (overlap(found.mask, truth) > 0.99, found.messages) == (True, ())


def test_clicks_beside_a_start_of_no_named_radius_make_it_one() -> None:
    """A disc wide enough to hold the click outside was refused."""
    image, truth = small_things(25.0)
    found = ffseg.segment(image, {"init.center": [120, 90], "init.background": [[131, 90]]})
    assert overlap(found.mask, truth) > 0.9
