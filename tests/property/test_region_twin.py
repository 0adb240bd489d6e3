"""Region evidence against sums over the mask: random contours, and every moment of random evolutions."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ffseg.geometry.freeform import FreeForm
from ffseg.image.edges import edge_map
from ffseg.image.raster import rasterize
from ffseg.methods import freeform
from ffseg.methods.base import Progress, View
from ffseg.methods.region import Colours, ColourSums, bhattacharyya, contrast, histogram_distance
from ffseg.parameters import load_params
from ffseg.starts.given import start_contours
from tests import naive_region, scenes
from tests import strategies as own

RELATIVE = 1e-9
"""The sums are whole numbers; only the division and the twin's own sums in float64 round."""


def agree(found: Colours, image: np.ndarray, mask: np.ndarray, bins: int) -> None:
    count, mean, covariance = naive_region.moments(image, mask)
    assert found.count == count
    np.testing.assert_allclose(found.mean, mean, rtol=RELATIVE, atol=0)
    scale = RELATIVE * max(1.0, float(np.abs(covariance).max()))
    np.testing.assert_allclose(found.covariance, covariance, rtol=RELATIVE, atol=scale)
    if bins:
        np.testing.assert_array_equal(found.histogram, naive_region.histogram(image, mask, bins))
    else:
        assert found.histogram.size == 0


@given(
    st.lists(own.troubled_contour(scaled=False), max_size=3), st.integers(0, 2**32 - 1),
    st.sampled_from([(30, 40), (17, 64), (3, 97), (1, 1), (40, 5)]), st.sampled_from([1.0, 1.5, 3.0, 7.3]),
)  # fmt: skip
def test_troubled_contours_agree_with_their_mask(made, seed: int, shape: tuple[int, int], band: float) -> None:
    rng = np.random.default_rng(seed)
    channels, bins = int(rng.integers(1, 4)), int(rng.integers(0, 9))
    image = rng.integers(0, 256, (*shape, channels), np.uint8)
    image = image[..., 0] if channels == 1 and seed % 2 else image
    degree = max((degree for _, degree in made), default=1)
    scaled = [FreeForm(points * 15 + rng.uniform(0, 30, 2), own_degree) for points, own_degree in made]
    contours = [c.elevated(degree) for c in scaled]
    found = ColourSums(image, bins).measure(contours, band)
    parts = naive_region.parts(rasterize(contours, shape), band)
    for colours, mask in zip((found.inside, found.inner, found.outer), parts, strict=True):
        agree(colours, image, mask, bins)


def snapshots(seed: int) -> Iterator[tuple[np.ndarray, tuple[FreeForm, ...]]]:
    """Contours of a random scene whenever a topological event has changed their number, and at the end."""
    scene = scenes.scene(seed)
    params = load_params(None, {"init.center": list(scenes.START), "init.radius": scenes.START_RADIUS})
    seen: list[Progress] = []
    edges, starts = edge_map(scene.image, params.edges), start_contours(scene.image.shape, params)
    freeform.run(View(scene.image, edges, starts, params, callback=seen.append, every=1))
    events = [b for a, b in pairwise(seen) if len(a.contours) != len(b.contours)]
    for progress in [*events, seen[-1]]:
        yield scene.image, progress.contours


def check_evolution(seed: int) -> int:
    """Compare at every event; returns how many there were. Bands of one row of neighbours keep the twin fast."""
    rng, events, sums = np.random.default_rng(seed), 0, None
    for grey, contours in snapshots(seed):
        if sums is None:
            image = np.stack([grey, rng.integers(0, 256, grey.shape, np.uint8), 255 - grey], axis=-1)
            sums = ColourSums(image, 0)
        found = sums.measure(contours, 1.0)
        mask = rasterize(contours, grey.shape)
        around = np.pad(mask, 1, mode="edge")
        sides = [around[1:-1, :-2], around[1:-1, 2:], around[:-2, 1:-1], around[2:, 1:-1]]
        inner = mask & ~np.logical_and.reduce(sides)
        outer = ~mask & np.logical_or.reduce(sides)
        for colours, part in zip((found.inside, found.inner, found.outer), (mask, inner, outer), strict=True):
            agree(colours, image, part, 0)
        events += 1
    return events


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 6])
def test_every_event_of_an_evolution_agrees_with_its_mask(seed: int) -> None:
    assert check_evolution(seed) >= 2


@pytest.mark.long
def test_every_event_of_a_thousand_evolutions_agrees_with_its_mask() -> None:
    assert sum(check_evolution(seed) for seed in range(1000)) > 2000


def colours(image: np.ndarray) -> Colours:
    box = FreeForm.polygon(np.array([[0.0, 0], [50, 0], [50, 50], [0, 50]]))
    return ColourSums(image, 4).measure([box]).inside


def test_distances_of_known_gaussians() -> None:
    rng = np.random.default_rng(3)
    noise = rng.normal(0, 8, (50, 50, 2)).round()
    one, two = (colours((base + noise).astype(np.uint8)) for base in (100, 124))
    # The same noise moved by 24 in both channels: d' C^-1 d / 8 and no second term.
    floor = one.covariance + np.eye(2) / 12
    step = np.array([24.0, 24.0])
    assert bhattacharyya(one, two) == pytest.approx(step @ np.linalg.inv(floor) @ step / 8, rel=1e-9)
    assert bhattacharyya(one, one) == pytest.approx(0, abs=1e-12)
    assert bhattacharyya(one, two) == pytest.approx(bhattacharyya(two, one), rel=1e-12)
    assert histogram_distance(one, one) == pytest.approx(0, abs=1e-7)
    far = colours(np.full((50, 50, 2), 255, np.uint8))
    assert histogram_distance(one, far) == 1.0


def test_an_empty_side_is_said() -> None:
    full = np.full((20, 20), 9, np.uint8)
    box = FreeForm.polygon(np.array([[-1.0, -1], [30, -1], [30, 30], [-1, 30]]))
    found = ColourSums(full).measure([box])
    assert (found.inside.count, found.inner.count, found.outer.count) == (400, 0, 0)
    assert np.isinf(bhattacharyya(found.inner, found.outer))
    assert contrast(found) == 0.0
    assert histogram_distance(found.inner, found.inside) == 1.0


def test_contrast_of_a_step() -> None:
    image = np.zeros((40, 40), np.uint8)
    image[:, 20:] = 100
    image[1::2] += 10  # a spread of 5 on either side
    left = FreeForm.polygon(np.array([[0.0, 0], [20, 0], [20, 40], [0, 40]]))
    found = ColourSums(image, 0).measure([left], 3.0)
    assert found.outer.mean - found.inner.mean == pytest.approx(100)
    assert contrast(found) == pytest.approx(100 / np.sqrt(2 * (25 + 1 / 12)))


def test_what_cannot_be_measured_is_refused() -> None:
    image = np.zeros((4, 4, 3), np.uint8)
    with pytest.raises(ValueError, match="at most 512"):
        ColourSums(image, 9)
    with pytest.raises(ValueError, match="one to three"):
        ColourSums(np.zeros((4, 4, 4), np.uint8))
    sums = ColourSums(image)
    with pytest.raises(ValueError, match="band"):
        sums.measure([], 0.5)
    line = FreeForm.polygon(np.array([[0.0, 0], [3, 0], [3, 3]]))
    with pytest.raises(ValueError, match="degrees"):
        sums.measure([line, line.elevated()])
