"""Parts of masks, filled from places and measured at once, are those of the labels one by one."""

import cv2
import numpy as np
import pytest

from ffseg.image.parts import connected_parts, parts_holding
from ffseg.starts.pockets import START_RADIUS_FRACTION, depths, discs


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
    depth, told = depths(mask.astype(np.uint8)), connected_parts(mask)
    expected = set()
    for part in np.flatnonzero(told.areas >= 20):
        row, column = np.unravel_index(np.where(told.labels == part, depth, 0).argmax(), mask.shape)
        expected.add((float(column), float(row), min(6.0, START_RADIUS_FRACTION * float(depth[row, column]))))
    found = discs(depth, told, np.flatnonzero(told.areas >= 20), 6.0)
    assert set(found) == expected
    assert [radius for _, _, radius in found] == sorted((radius for _, _, radius in found), reverse=True)
