"""The printed method as one of the methods: what it finds on drawn scenes, and what it says of itself."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import ffseg
from ffseg.samples.scenes import SCENES


def scene(name: str) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    drawn = SCENES[name]()
    image = drawn.image if drawn.image.ndim == 2 else np.ascontiguousarray(drawn.image[..., ::-1])
    return image, drawn.truth > 0


def iou(mask: NDArray[np.bool_], truth: NDArray[np.bool_]) -> float:
    return float((mask & truth).sum() / (mask | truth).sum())


@pytest.mark.parametrize(("name", "least"), [("simple", 0.995), ("complex", 0.97), ("toy", 0.95)])
def test_overlap_on_the_samples(name: str, least: float) -> None:
    """It stops at edges and passes obstacles; measured 0.9982, 0.9777 and 0.9588."""
    image, truth = scene(name)
    result = ffseg.segment(image, ffseg.load_params("paper"))
    assert iou(result.mask, truth) > least
    assert result.stats.stop_reason == "converged"
    assert result.stats.initial_points == 39
    assert result.stats.final_points == sum(len(c.control_points) for c in result.contours)
    assert result.stats.flips >= result.num_holes


def test_balloon_is_cut_and_its_sign_kept() -> None:
    """It grows by two pixels an iteration in open ground, or closes in by two."""
    image = np.full((200, 200), 128, np.uint8)
    for balloon, radius in ((8.0, 40 + 2 * 10), (-8.0, 40 - 2 * 10)):
        overrides = {"contour.balloon": balloon, "contour.max_iterations": 10, "contour.refine": False}
        result = ffseg.segment(image, ffseg.load_params("paper", overrides))
        assert result.mask.sum() == pytest.approx(np.pi * radius**2, rel=0.01)
        assert result.stats.stop_reason == "max_iterations"


def test_diffusion_slows_it_down() -> None:
    """On a slope of one grey level per pixel F_diff is 1/2, whatever p (Eq. 8)."""
    image = np.tile(np.arange(200, dtype=np.uint8), (200, 1))
    overrides = {"contour.max_iterations": 10, "contour.patches": 20, "edges.canny": [50, 100]}
    for exponent in (1, 2, 8):
        params = ffseg.load_params("paper", {**overrides, "edges.exponent": exponent})
        result = ffseg.segment(image, params)
        assert result.mask.sum() == pytest.approx(np.pi * 50**2, rel=0.01)


def test_snapshots_are_handed_out() -> None:
    image, _ = scene("toy")
    seen: list[ffseg.Progress] = []
    result = ffseg.segment(image, ffseg.load_params("paper", {"contour.max_iterations": 35}), callback=seen.append)
    assert [progress.iteration for progress in seen] == [0, 10, 20, 30, 35]
    assert len(seen[-1].contours) == len(result.contours)
