"""Parts of masks, filled from places and measured at once, are those of the labels one by one."""

import cv2
import numpy as np
import pytest

from ffseg.image.free import clear_distances
from ffseg.image.parts import connected_parts, parts_holding
from ffseg.starts.pockets import MIN_PIXELS, NARROW_WIDTH, START_RADIUS_FRACTION, discs, starts_beyond


@pytest.mark.parametrize("corners", [False, True])
@pytest.mark.parametrize("seed", range(20))
def test_what_hangs_together_with_places(seed: int, corners: bool) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 40, 2))
    mask, places = rng.random(shape) < rng.uniform(0.2, 0.8), rng.random(shape) < rng.uniform(0, 0.1)
    labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8 if corners else 4)[1]
    expected = mask & np.isin(labels, labels[places & mask])
    assert np.array_equal(parts_holding(mask, places, corners=corners), expected)


@pytest.mark.parametrize("seed", range(20))
def test_a_disc_in_each_part(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = cv2.GaussianBlur(rng.random((60, 80)), (0, 0), 3) > 0.5
    depth, told = clear_distances(mask), connected_parts(mask)
    expected = set()
    for part in np.flatnonzero(told.areas >= 20):
        row, column = np.unravel_index(np.where(told.labels == part, depth, 0).argmax(), mask.shape)
        expected.add((float(column), float(row), min(6.0, START_RADIUS_FRACTION * float(depth[row, column]))))
    found = discs(mask, told, np.flatnonzero(told.areas >= 20), 6.0)
    assert set(found) == expected
    assert [radius for _, _, radius in found] == sorted((radius for _, _, radius in found), reverse=True)


@pytest.mark.parametrize("seed", range(20))
def test_starts_beyond_narrow_places_lie_where_the_whole_image_is_deepest(seed: int) -> None:
    """Only what is near a component is measured; the distances are those of the whole image."""
    rng = np.random.default_rng(seed)
    free = cv2.GaussianBlur(rng.random((90, 120)), (0, 0), 4) > 0.49
    starts = np.zeros(free.shape, bool)
    starts[tuple(np.argwhere(free)[0])] = True
    whole = clear_distances(parts_holding(free, starts))
    deep = whole >= NARROW_WIDTH
    told = connected_parts(deep & ~parts_holding(deep, starts, corners=True), corners=True)
    expected = {
        (START_RADIUS_FRACTION * float(whole[told.labels == part].max()))
        for part in range(1, told.number)
        if told.areas[part] >= MIN_PIXELS
    }
    found = starts_beyond(free, starts, 100.0)
    assert {radius for _, _, radius in found} == expected
    assert all(START_RADIUS_FRACTION * float(whole[int(y), int(x)]) == radius for x, y, radius in found)
