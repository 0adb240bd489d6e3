"""The printed method as one of the methods: what it finds on drawn scenes, and what it says of itself."""

import numpy as np
import pytest
from numpy.typing import NDArray

import ffseg
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed
from ffseg.native import _core
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
        overrides = {
            "contour.balloon": balloon,
            "contour.max_iterations": 10,
            "contour.refine": False,
            "init.radius": 40,
        }
        result = ffseg.segment(image, ffseg.load_params("paper", overrides))
        assert result.mask.sum() == pytest.approx(np.pi * radius**2, rel=0.01)
        assert result.stats.stop_reason == "max_iterations"


def test_diffusion_slows_it_down() -> None:
    """On a slope of one grey level per pixel F_diff is 1/2, whatever p (Eq. 8)."""
    image = np.tile(np.arange(200, dtype=np.uint8), (200, 1))
    overrides = {"contour.max_iterations": 10, "contour.patches": 20, "edges.canny": [50, 100], "init.radius": 40}
    for exponent in (1, 2, 8):
        params = ffseg.load_params("paper", {**overrides, "edges.exponent": exponent})
        result = ffseg.segment(image, params)
        assert result.mask.sum() == pytest.approx(np.pi * 50**2, rel=0.01)


def of_patches(patches: int) -> ffseg.Segmentation:
    image = np.full((400, 400), 128, np.uint8)
    over = {"init.radius": 150, "contour.patches": patches, "contour.balloon": 2.0}
    return ffseg.segment(image, ffseg.load_params("paper", over))


def test_more_patches_than_there_may_be_end_it() -> None:
    """What crosses itself everywhere grows without end: here it starts with as many."""
    result = of_patches(60_000)
    assert (result.stats.iterations, result.stats.stop_reason) == (1, "max_patches")
    assert result.score <= 0.5


@pytest.mark.parametrize("noise", [20.0, 40.0])
def test_noise_ends_with_a_stated_reason(noise: float) -> None:
    """A front that crosses itself everywhere flips within its budget, and is not swept for ever within one iteration."""
    grey = 128 + np.random.default_rng(1).normal(0, noise, (120, 160))
    over = {"edges.canny": [30, 60], "init.radius": 20, "contour.split_threshold": 4}
    result = ffseg.segment(np.clip(grey, 0, 255).astype(np.uint8), ffseg.load_params("paper", over))
    assert result.stats.stop_reason in {"converged", "max_patches", "budget"}


def test_the_budget_ends_flips_within_an_iteration() -> None:
    """Each flip sorts anew: thousands of them in one iteration would not end in time."""
    loops = [FreeForm.circle((60 + 3 * i, 60), 30, 40, 3) for i in range(8)]
    options = _core.PaperOptions()
    options.degree, options.split_threshold, options.balloon = 3, 40.0, 2.0
    options.exponent, options.sigma, options.topology, options.max_iterations = 2.0, 1.5, True, 100
    flips = []
    for budget in (0, 325):  # 320 patches are moved
        options.budget = budget
        blank = np.zeros((120, 160), np.uint16)
        made = _core.PaperEvolution(*packed(loops), blank, blank.astype(np.uint8), None, options)
        made.advance(1)
        flips.append(made.counts()["flips"])
    assert 0 < flips[1] < flips[0]
