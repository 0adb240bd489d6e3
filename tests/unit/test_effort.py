"""An evolution ends when it has done so much work to each pixel it may fill, and says so."""

from functools import partial

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

import ffseg
from ffseg.geometry.freeform import FreeForm
from ffseg.methods import freeform, paper, snake
from ffseg.methods.effort import MIN_BUDGET, budget, iterations
from ffseg.scene import Scene
from tests import evolutions


def island() -> NDArray[np.uint8]:
    image = np.full((160, 200), 200, np.uint8)
    cv2.rectangle(image, (10, 10), (189, 149), 60, 3)
    cv2.circle(image, (130, 80), 18, 60, -1)
    return image


def test_a_contour_that_goes_round_an_island_for_ever_spends_its_budget() -> None:
    """Without flips it passes over itself again and again (the paper's Figure 5, middle)."""
    over = {"contour.topology": False, "init.center": [60, 80], "init.radius": 20, "edges.source": "gradient"}
    result = ffseg.segment(island(), over)
    assert result.stats.stop_reason in {"budget", "max_patches"}
    assert any("the contour was stopped" in message for message in result.messages)
    assert result.score <= 0.5
    assert result.stats.iterations < MIN_BUDGET + freeform.WORK * island().size


@pytest.mark.parametrize("most", [50, 400, 3000])
def test_work_ends_within_an_iteration_of_the_budget(most: int) -> None:
    run = partial(evolutions.evolution, [FreeForm.circle((90, 70), 12, 13, 3)], refine=True, budget=most)
    made = run(iterations=10_000)
    assert made.stop_reason == ("budget" if most < 3000 else "converged")
    if most < 3000:
        before = run(iterations=made.counts()["iterations"] - 1)
        assert before.counts()["work"] <= most < made.counts()["work"]


def test_the_budget_is_in_proportion_to_the_domain() -> None:
    edges = ffseg.EdgeMap(np.zeros((40, 50), np.uint16), np.zeros((40, 50), np.uint8), None, (1.0, 2.0))
    scene = Scene(np.zeros((40, 50), np.uint8), ffseg.load_params(None), edges=edges)
    assert budget(scene, 4) == MIN_BUDGET + 4 * 2000
    domain = np.zeros((40, 50), np.uint8)
    domain[5:15, 5:25] = 7
    inner = ffseg.EdgeMap(edges.gradient, edges.edges, domain, (1.0, 2.0))
    assert budget(Scene(scene.image, scene.params, edges=inner), 4) == MIN_BUDGET + 4 * 200


def test_an_integer_bounds_iterations_and_auto_does_not() -> None:
    assert iterations(ffseg.load_params(None, {"contour.max_iterations": 7})) == 7
    assert iterations(ffseg.load_params(None)) > 10**9


@pytest.mark.parametrize("method", ["freeform", "snake", "paper"])
def test_an_evolution_cut_short_says_so(method: str) -> None:
    over = {"contour.max_iterations": 2, "init.center": [60, 80], "init.radius": 20, "method": method}
    result = ffseg.segment(island(), over)
    assert result.stats.stop_reason == "max_iterations"
    assert "the contour was stopped after 2 iterations (max_iterations)" in result.messages


@pytest.mark.parametrize(("method", "room"), [("snake", snake), ("paper", paper)])
def test_snake_and_paper_have_a_budget_too(method: str, room: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "budget", lambda scene, to_pixel: 100)
    result = ffseg.segment(island(), {"init.center": [60, 80], "init.radius": 20, "method": method})
    assert result.stats.stop_reason == "budget"
    assert any("budget" in message for message in result.messages)


def test_a_contour_of_many_patches_on_a_small_image_ends() -> None:
    """A hundred thousand patches round a circle of 40 px once took 45 s."""
    image = np.full((200, 200), 90, np.uint8)
    image[21:180, 21:180] = 180  # of odd sides: no enlargement of a smaller picture
    result = ffseg.segment(image, {"contour.patches": 100_000, "edges.source": "gradient"})
    assert result.stats.stop_reason == "converged"
    assert result.mask[30:170, 30:170].all()
