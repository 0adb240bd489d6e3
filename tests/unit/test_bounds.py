"""The valid disc of a mirror, and free places for starts that cannot move."""

from pathlib import Path

import cv2
import numpy as np
import pytest

import ffseg
from ffseg.errors import SegmentationError
from ffseg.image.disc import Disc, valid_disc
from ffseg.image.free import clear_distances, distances, free_part_under, free_pixels
from tests import scenes


def mirror(shape: tuple[int, int], circle: tuple[float, float, float], surround: int = 12) -> np.ndarray:
    """A textured scene in a circle, dark outside, with noise: patches of many grey levels."""
    rng = np.random.default_rng(5)
    small = rng.integers(30, 256, (shape[0] // 24 + 1, shape[1] // 24 + 1, 3), np.uint8)
    scene = cv2.resize(small, shape[::-1], interpolation=cv2.INTER_LINEAR).astype(float)
    y, x = np.mgrid[: shape[0], : shape[1]]
    inside = np.hypot(x - circle[0], y - circle[1]) <= circle[2]
    image = np.where(inside[..., None], scene, surround) + rng.normal(0, 3, (*shape, 1))
    return np.clip(image, 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("shape", "circle", "surround"),
    [
        ((480, 640), (320.0, 240.0, 200.0), 12),
        ((480, 640), (300.0, 250.0, 290.0), 5),  # cut at the top and the bottom
        ((768, 1024), (520.0, 383.0, 450.0), 20),
        ((1200, 1600), (700.0, 560.0, 300.0), 35),
        ((300, 300), (150.0, 150.0, 140.0), 0),
    ],
)
def test_the_disc_is_found_to_a_hundredth(shape, circle, surround: int) -> None:
    found = valid_disc(mirror(shape, circle, surround))
    assert np.abs(np.array([found.x, found.y, found.radius]) - circle).max() < 0.012 * circle[2]
    assert valid_disc(mirror(shape, circle, surround).max(axis=2)).radius == pytest.approx(found.radius, rel=0.01)


def test_ordinary_images_have_no_disc() -> None:
    shape, whole = (480, 640), mirror((480, 640), (320.0, 240.0, 1000.0))
    y, x = np.mgrid[: shape[0], : shape[1]]
    box = np.zeros(shape, np.uint8)
    box[60:420, 80:560] = whole[60:420, 80:560].max(axis=2)
    plain = np.where(np.hypot(x - 320, y - 240) < 200, np.uint8(200), np.uint8(0))
    reflected = mirror(shape, (320.0, 240.0, 200.0))
    reflected[200:280, 570:620] = 200  # bright outside the circle
    ellipse = np.where(((x - 320) / 290) ** 2 + ((y - 240) / 200) ** 2 < 1, whole.max(axis=2), np.uint8(0))
    texture = cv2.GaussianBlur(np.random.default_rng(0).normal(0, 1, shape), (0, 0), 10)
    light = np.exp(-(((x - 320) / 230) ** 2) - ((y - 240) / 170) ** 2)
    lamp = np.clip(10 + (200 + 40 * texture / texture.std()) * light, 0, 255).astype(np.uint8)
    narrow = np.zeros((41, 252), np.uint8)
    narrow[1:11, 76:217] = 200  # its outline lies on a circle that holds no pixel
    smallest = np.zeros(shape, np.uint8), np.zeros((3, 3), np.uint8), np.full((1, 1), 255, np.uint8)
    drawn = (scenes.scene(seed).image for seed in range(40))
    for image in (whole, box, plain, reflected, ellipse, lamp, narrow, *smallest, *drawn):
        assert valid_disc(image) is None


@pytest.mark.parametrize(("long", "lopsided"), [(4, 0), (6, 4), (12, 8)])
def test_a_thing_that_is_nearly_round_is_no_disc(long: int, lopsided: int) -> None:
    """On black, as a fruit; the circle through its outline is not the limit of a scene."""
    y, x = np.mgrid[:300, :400]
    angle = np.arctan2(y - 150, x - 200)
    radius = 112 + long * np.cos(2 * angle) + lopsided * np.cos(3 * angle + 1)
    rough = np.clip(120 + 60 * np.random.default_rng(1).normal(size=(300, 400)), 40, 255)
    assert valid_disc(np.where(np.hypot(x - 200, y - 150) < radius, rough, 0).astype(np.uint8)) is None


def test_a_reflection_beside_the_disc_does_not_hide_it() -> None:
    image = mirror((300, 400), (170.0, 150.0, 100.0))
    image[146:154, 290:298] = 230  # the box round what is bright is wider than high
    assert valid_disc(image).radius == pytest.approx(100, rel=0.02)


def test_discs_of_real_images(data_folder: Path) -> None:
    """Known circles of mirrors and lenses; streets, floors and things have none."""
    known = {
        "omni_room/Im_R45_T0.png": (691, 571, 500),
        "omni_boards/VMRImage0.jpg": (517, 384, 452),
        "omni_boards/imgMei_001.jpg": (643, 522, 352),
        "omni_views/hypercat_1280x1024_02.jpg": (636, 513, 662),
        "omni_views/grid_floor_real_test1.jpg": (962, 543, 569),
        "real_floors/omni/images/lab_left.png": (364, 369, 361),
        "real_floors/omni/images/paracat_01.png": (519, 389, 385),
    }
    for name, circle in known.items():
        found = valid_disc(cv2.imread(str(data_folder / name)))
        assert found is not None, name
        assert np.abs(np.array([found.x, found.y, found.radius]) - circle).max() < 8, name
    folders = ("road/images", "real_floors/indoor/images", "seeded_objects/images", "scenes", "peer_examples")
    others = [path for folder in folders for path in sorted((data_folder / folder).iterdir())]
    images = [cv2.imread(str(path)) for path in others if path.suffix in {".png", ".jpg", ".bmp"}]
    assert len(images) > 50
    assert not any(valid_disc(image) for image in images)


def test_the_disc_bounds_the_contour_when_asked() -> None:
    image = mirror((480, 640), (320.0, 240.0, 200.0))
    image[:] = np.where(image.max(axis=2, keepdims=True) > 29, image, 12)
    loose = {"init.radius": 20, "edges.canny": [200, 300]}
    y, x = np.mgrid[:480, :640]
    outside = np.hypot(x - 320, y - 240) > 210
    held = ffseg.segment(image, loose)
    assert not held.mask[outside].any()
    assert held.mask[~outside].mean() > 0.9
    for more in ({"domain.disc": "off"}, {"init.center": [40, 40]}):  # whoever starts in the surround wants it
        assert ffseg.segment(image, {**loose, **more}).mask[outside].mean() > 0.9


def test_a_mask_takes_the_place_of_the_disc() -> None:
    image, domain = mirror((240, 320), (160.0, 120.0, 100.0)), np.full((240, 320), 255, np.uint8)
    assert ffseg.segment(image, {"init.radius": 9, "edges.canny": [200, 300]}, domain=domain).mask[5, 5]


def test_free_pixels_and_their_room() -> None:
    edges = np.zeros((40, 60), np.uint8)
    edges[:, 30] = 255
    domain = np.full((40, 60), 255, np.uint8)
    domain[:, :5] = 0
    free = free_pixels(edges, domain)
    assert np.nonzero(~free[20])[0].tolist() == [0, 1, 2, 3, 4, 29, 30, 31]
    assert np.nonzero(~free_pixels(edges, None, 9.0)[20])[0].tolist() == list(range(26, 35))  # less than 4.5 away
    room = clear_distances(free)
    assert (room[20, 10], room[20, 17]) == (6.0, 12.0)
    assert room[0, 45] == 1.0  # the border of the image
    left = free_part_under(free, np.indices((40, 60))[1] < 31)
    assert np.nonzero(left[20])[0].tolist() == list(range(5, 29))
    assert free_part_under(free, np.indices((40, 60))[1] < 4) is None


@pytest.mark.parametrize("method", ["freeform", "levelset"])
def test_a_start_on_an_edge_moves_and_says_so(method: str) -> None:
    image = np.zeros((120, 160), np.uint8)
    image[:, 60:100] = 200
    cv2.circle(image, (75, 60), 7, 20, 2)  # every sample of the start lies on this ring
    given = {"init.center": [75, 60], "init.radius": 7, "edges.canny": [2, 4], "edges.sigma": 0.8, "method": method}
    found = ffseg.segment(image, given)
    assert len(found.messages) == 1
    assert "the start at (75, 60), radius 7 lay on an edge and was moved to (" in found.messages[0]
    assert found.mask.any()
    assert not ffseg.segment(image, {**given, "init.center": [88, 100]}).messages


def test_a_start_outside_the_domain_moves_into_it() -> None:
    domain = np.zeros((120, 160), np.uint8)
    domain[40:80, 60:100] = 255
    start = {"init.center": [20, 60], "init.radius": 10}
    found = ffseg.segment(np.full((120, 160), 90, np.uint8), start, domain=domain)
    assert "lay outside the domain and was moved to (" in found.messages[0]
    assert found.mask[domain > 0].mean() > 0.9
    assert not found.mask[cv2.dilate(domain, np.ones((3, 3), np.uint8)) == 0].any()


def test_clearance_is_named_when_it_was_the_cause() -> None:
    """In a corridor of 12 px a clearance of 20 leaves no place: the start goes to the nearest that has room."""
    image = np.full((120, 160), 200, np.uint8)
    image[:54, :80] = image[66:, :80] = 20
    given = {"init.center": [40, 60], "init.radius": 3}
    assert not ffseg.segment(image, given).messages
    found = ffseg.segment(image, {**given, "contour.clearance": 20})
    assert "lay nearer to an edge than half of contour.clearance (20) and was moved to (40, 79)" in found.messages[0]
    assert found.mask[79, 40]
    assert not found.mask[60, 40]


def test_without_any_free_place_the_cause_is_named() -> None:
    flat, start = np.full((60, 80), 90, np.uint8), {"init.radius": 5, "edges.canny": [2, 4]}
    with pytest.raises(SegmentationError, match="outside the domain at every sample, and there is no free place; move"):
        ffseg.segment(flat, start, domain=np.zeros((60, 80), np.uint8))
    with pytest.raises(SegmentationError, match=r"half of contour.clearance \(200\) at every sample"):
        ffseg.segment(np.triu(flat), {**start, "init.center": [50, 20], "contour.clearance": 200})


def test_several_starts_are_all_moved() -> None:
    domain = np.zeros((120, 160), np.uint8)
    domain[:, 40:] = 255
    circles = {"init.circles": [[10, 30, 5], [12, 90, 6]]}
    found = ffseg.segment(np.full((120, 160), 90, np.uint8), circles, domain=domain)
    assert found.messages[0].endswith(", and 1 more")
    assert found.mask[domain > 0].mean() > 0.9


def test_disc_holds_its_points() -> None:
    disc = Disc(10.0, 10.0, 5.0)
    assert disc.holds(np.array([13.0, 14.0]))
    assert not disc.holds(np.array([13.1, 14.1]))
    assert disc.mask((21, 21), 0.0).sum() == 255 * 81  # lattice points within 5: the Gauss circle problem


@pytest.mark.parametrize("width", [37, 50, 61])
def test_distances_are_the_nearest_to_the_true_ones_wherever_the_memory_lies(width: int) -> None:
    mask = np.random.default_rng(width).random((40, width)) > 0.02
    rows, columns = np.indices(mask.shape)
    out = np.argwhere(~mask)
    squares = ((rows[..., None] - out[:, 0]) ** 2 + (columns[..., None] - out[:, 1]) ** 2).min(axis=2)
    assert np.array_equal(distances(mask), np.sqrt(squares).astype(np.float32))


def test_distances_of_a_mask_without_an_end_are_beyond_any_image() -> None:
    assert distances(np.ones((3, 4), np.bool_)).min() > 1e6
