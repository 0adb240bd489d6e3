"""Interest points of components against their slow twins."""

import cv2
import naive_pairs
import numpy as np
import pytest

from ffseg.geometry.freeform import FreeForm
from ffseg.image.components import Component, contour_components
from ffseg.image.interest import harris_points, outline_points, strongest
from ffseg.native import _core
from tests.components import component_of

SHAPE = (40, 52)
ALL = 10_000


def scene(seed: int) -> tuple[np.ndarray, list[Component]]:
    """A textured image and components: inside, at a corner of the image, one pixel, and a ring."""
    random = np.random.default_rng(seed)
    smooth = cv2.GaussianBlur(random.uniform(0, 255, SHAPE), (0, 0), 1.5)
    image = cv2.normalize(smooth, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    masks = np.zeros((4, *SHAPE), np.bool_)
    masks[0, 12:28, 9:31] = random.uniform(0, 1, (16, 22)) < 0.3
    masks[1, 33:40, 44:52] = True
    masks[2, 5, 40] = True
    masks[3, 2:30, 33:50], masks[3, 6:26, 36:46] = True, False
    return image, [component_of(index, mask) for index, mask in enumerate(masks)]


def whole(component: Component) -> np.ndarray:
    mask = np.zeros(SHAPE, np.bool_)
    mask[component.window()] = component.mask
    return mask


@pytest.mark.parametrize("grow", [0, 2])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_corners_agree_with_their_twin(seed: int, grow: int) -> None:
    image, components = scene(seed)
    found = harris_points(image, components, 7, grow)
    for place, component in enumerate(components):
        own = found.pixels[found.owner == place]
        twin = naive_pairs.corners(image, naive_pairs.grown(whole(component), grow), 7)
        assert len(own) == len(twin) > 0
        # The sub-pixel place stays within half a pixel of its peak, per axis.
        assert np.abs(own - np.array(twin)).max() <= 0.5


def test_the_strongest_corners_are_those_that_are_found_when_fewer_are_asked_for() -> None:
    image, components = scene(1)
    empty = Component(len(components), (0, 0), np.zeros((4, 4), np.bool_))
    components.insert(1, empty)  # the others keep their own
    many, few = harris_points(image, components, 7), harris_points(image, components, 3)
    found = strongest(many, 3)
    assert found.owner.tolist() == few.owner.tolist()
    assert len(few.owner) < len(many.owner)
    np.testing.assert_array_equal(found.pixels, few.pixels)


@pytest.mark.parametrize("grow", [0, 2])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_outline_samples_agree_with_their_twin(seed: int, grow: int) -> None:
    image, components = scene(seed)
    found = outline_points(image, components, ALL, grow)
    for place, component in enumerate(components):
        twin = naive_pairs.outline(image, naive_pairs.grown(whole(component), grow))
        assert found.pixels[found.owner == place].tolist() == [list(map(float, pixel)) for pixel in twin]


def test_outline_samples_are_thinned_evenly_from_first_to_last() -> None:
    image, components = scene(4)
    every = outline_points(image, components[3:], ALL).pixels
    few = outline_points(image, components[3:], 6).pixels
    assert len(every) > 12
    expected = np.linspace(0, len(every) - 1, 6)
    places = [int(np.flatnonzero((every == pixel).all(axis=1))[0]) for pixel in few]
    assert np.abs(places - expected).max() <= 0.5


def test_a_corner_is_placed_to_a_part_of_a_pixel() -> None:
    """A blurred square whose corner lies between pixels, moved in steps of an eighth of a pixel."""
    offsets = []
    for shift in np.linspace(0, 1, 9):
        cover = np.clip(np.arange(60) + 0.5 - (20 + shift), 0, 1)
        image = np.rint(50 + 150 * np.outer(cover, cover)).astype(np.uint8)
        component = Component(0, (10, 10), np.ones((22, 22), np.bool_))
        corner = harris_points(cv2.GaussianBlur(image, (0, 0), 1.0), [component], 1).pixels[0]
        offsets.append(corner - shift)
    # The operator's window pulls a corner inward by half a pixel, nearly the same for every shift; a whole-pixel
    # position would spread by 0.9 px.
    assert np.ptp(offsets, axis=0).max() < 0.2
    assert np.mean(offsets, axis=0) == pytest.approx([21.0, 21.0], abs=0.2)


def test_flat_and_empty_components_have_no_points() -> None:
    flat = np.full(SHAPE, 90, np.uint8)
    components = [Component(0, (3, 4), np.ones((9, 8), np.bool_)), Component(1, (0, 0), np.zeros((0, 0), np.bool_))]
    assert (len(harris_points(flat, components, 5).pixels), len(outline_points(flat, components, 5).pixels)) == (0, 0)
    assert len(harris_points(flat, [], 5).pixels) == 0


def test_the_points_of_a_component_do_not_depend_on_its_neighbours() -> None:
    image, components = scene(5)
    for find in (harris_points, outline_points):
        together = find(image, components, 6)
        for place, component in enumerate(components):
            assert np.array_equal(together.pixels[together.owner == place], find(image, [component], 6).pixels)


def test_a_hole_outside_the_image_is_an_empty_component() -> None:
    beyond = FreeForm.circle((80.0, 20.0), 10.0, 8, 3).reversed()
    across = FreeForm.circle((51.0, 20.0), 6.0, 8, 3).reversed()
    _, components = contour_components([beyond, across], SHAPE)
    assert [component.area > 0 for component in components] == [False, True]
    image, _ = scene(6)
    assert set(outline_points(image, components, 5).owner) == {1}


def test_the_native_border_refuses_windows_that_leave_the_image() -> None:
    image, points, counts = np.zeros((20, 30), np.uint8), np.empty((5, 2)), np.empty(1, np.int64)
    for window in ([-1, 0, 3, 3], [28, 0, 3, 3], [0, 18, 3, 3], [0, 0, 3, 4], [2**62, 0, 2**62, 1]):
        with pytest.raises(ValueError, match="window"):
            _core.harris_points(image, np.array([window]), np.ones(9, np.uint8), 0, points, counts)
    with pytest.raises(ValueError, match="differ in size"):
        _core.outline_points(image, np.array([[0, 0, 3, 3]]), np.ones(9, np.uint8), -1, points, counts)
