"""The camera's own image: found where it stays while the scene moves, nowhere else."""

from pathlib import Path

import cv2
import numpy as np
import pytest

import ffseg
from ffseg.errors import SegmentationError
from ffseg.image.own import MIN_IMAGES, own_image
from ffseg.samples.write import write_samples
from tests.campaigns.own_images import DRIVES, FOUND, KINDS, MOST_LOST, Case, judged
from tests.discs import overlap

SHAPE = (180, 240)
ROWS, COLUMNS = np.indices(SHAPE)
BONNET = ROWS + 12 * np.cos((COLUMNS - 120) / 80) > 160
MOUNT = np.hypot(ROWS - 80, COLUMNS - 120) < 18
SURROUND = np.hypot(ROWS - 90, COLUMNS - 120) > 86
ROD = abs(COLUMNS - 120) < 4
OWN = {"bonnet": BONNET, "mount": MOUNT, "mirror": SURROUND | MOUNT, "mirror with a rod": SURROUND | MOUNT | ROD}


def scene(number: int, colour: bool = True) -> np.ndarray:
    """Rectangles and texture, other ones each time."""
    rng = np.random.default_rng(number)
    image = np.full((*SHAPE, 3), rng.integers(90, 150), np.uint8)
    for _ in range(25):
        x, y, w, h = rng.integers((0, 0, 10, 10), (240, 180, 80, 60))
        cv2.rectangle(image, (int(x), int(y)), (int(x + w), int(y + h)), rng.integers(40, 220, 3).tolist(), -1)
    image = cv2.GaussianBlur(image, (0, 0), 0.8)
    noisy = np.clip(image + rng.normal(0, 3, image.shape), 0, 255).astype(np.uint8)
    return noisy if colour else cv2.cvtColor(noisy, cv2.COLOR_BGR2GRAY)


def frames(own: np.ndarray | None, count: int = 12, colour: bool = True) -> list[np.ndarray]:
    """Scenes behind the same own image, a plain one with the noise of each."""
    rng, found = np.random.default_rng(99), [scene(number, colour) for number in range(count)]
    for image in found if own is not None else ():
        image[own] = np.clip(rng.normal(30, 3, image.shape), 0, 255).astype(np.uint8)[own]
    return found


@pytest.mark.parametrize("kind", OWN)
@pytest.mark.parametrize("colour", [True, False])
def test_what_stays_is_the_cameras(kind: str, colour: bool) -> None:
    found = own_image(frames(OWN[kind], colour=colour))
    assert found.dtype == bool
    assert overlap(found, OWN[kind]) > 0.85  # the mount, of radius 18, drawn larger by a pixel: 0.897, by two: 0.81


def test_nothing_is_the_cameras_where_all_moves() -> None:
    assert not own_image(frames(None)).any()


def test_the_order_of_the_images_does_not_matter() -> None:
    images = frames(OWN["mount"])
    assert np.array_equal(own_image(images), own_image(images[::-1]))


def test_a_large_image_is_reduced_and_its_mask_is_not() -> None:
    large = [cv2.resize(image, None, fx=5, fy=5, interpolation=cv2.INTER_CUBIC) for image in frames(BONNET)]
    found = own_image(large)
    assert found.shape == (900, 1200)
    assert overlap(found, np.kron(BONNET, np.ones((5, 5), np.bool_))) > 0.95


@pytest.mark.parametrize("itself", [True, False])
def test_a_camera_that_stands_is_told_from_one_that_moves(itself: bool) -> None:
    rng, seen = np.random.default_rng(3), frames(BONNET if itself else None)[0]
    standing = [np.clip(seen + rng.normal(0, 3, seen.shape), 0, 255).astype(np.uint8) for _ in range(12)]
    with pytest.raises(SegmentationError, match="take some between which the camera has moved"):
        own_image(standing)


def test_few_images_and_images_of_two_sizes_are_refused() -> None:
    images = frames(BONNET, MIN_IMAGES)
    assert own_image(images).any()
    with pytest.raises(SegmentationError, match="4 images are too few; take 5 or more"):
        own_image(images[1:])
    with pytest.raises(SegmentationError, match="image 5 has 180 x 240 pixels"):
        own_image([*images[:4], np.ascontiguousarray(images[4].transpose(1, 0, 2))])
    with pytest.raises(SegmentationError, match="0 images are too few"):
        own_image([])
    with pytest.raises(SegmentationError, match=r"images is one of shape .*; give a list"):
        own_image(images[0])


@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (7, 5)])
def test_tiny_images_are_no_trouble(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 255, (*shape, 3)).astype(np.uint8) for _ in range(6)]
    try:
        assert own_image(images).shape == shape
    except SegmentationError as error:
        assert "hardly changes" in str(error)


def test_the_robot_under_a_mirror_and_the_dark_round_it(tmp_path: Path) -> None:
    write_samples(tmp_path, 3)
    images = [ffseg.read_image(path) for path in sorted(tmp_path.glob("pair*/*.png"))]
    camera = ffseg.load_camera(tmp_path / "pair" / "camera.yaml")
    rows, columns = np.indices(images[0].shape[:2])
    robot = np.hypot(columns - camera.center[0], rows - camera.center[1]) <= camera.robot_radius
    assert overlap(own_image(images), ~camera.domain() | robot) > 0.97  # the limit is known to a pixel of 400


SEEDS = {"street": 42, "room": 43, "mirror": 42}


@pytest.mark.parametrize("kind", KINDS)
def test_cameras_that_are_drawn_on_their_way(kind: str) -> None:
    """The short form of ``tests.campaigns.own_images``."""
    itself, nothing = judged(Case(kind, SEEDS[kind], DRIVES[2]))
    assert itself.overlap >= FOUND
    assert itself.lost <= MOST_LOST
    assert nothing.lost <= MOST_LOST
