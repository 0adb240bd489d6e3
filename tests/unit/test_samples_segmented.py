"""The default parameters on the sample images: what a new user sees first."""

from __future__ import annotations

import numpy as np
import pytest

import ffseg
from ffseg.samples.scenes import SCENES

LEAST_IOU = 0.99
"""What the stress campaign asks of every scene without passages narrower than 6 px."""


@pytest.fixture(scope="module", params=list(SCENES))
def outcome(request: pytest.FixtureRequest) -> tuple[str, ffseg.Segmentation, np.ndarray]:
    scene = SCENES[request.param]()
    image = scene.image if scene.image.ndim == 2 else np.ascontiguousarray(scene.image[:, :, ::-1])
    return request.param, ffseg.segment(image, ffseg.load_params()), scene.truth > 0


def test_region_is_found_and_the_contour_comes_to_rest(outcome: tuple[str, ffseg.Segmentation, np.ndarray]) -> None:
    _, result, truth = outcome
    assert result.stats.stop_reason == "converged"
    assert (result.mask & truth).sum() / (result.mask | truth).sum() >= LEAST_IOU


def test_every_hole_is_found(outcome: tuple[str, ffseg.Segmentation, np.ndarray]) -> None:
    name, result, _ = outcome
    assert sum(contour.signed_area < 0 for contour in result.contours) == {"toy": 4, "simple": 1, "complex": 9}[name]
