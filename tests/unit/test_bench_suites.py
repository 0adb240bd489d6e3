"""The suites of ``ffseg bench`` in their tiny form, and what they measure on."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from ffseg.bench import drawing, images, processes, programs
from ffseg.bench.measure import Order
from ffseg.bench.session import SUITES, Outcome, run_bench
from ffseg.errors import FfsegError, UsageError
from ffseg.image.reference import one_thread, reference_kernel
from ffseg.io.masks import encode_mask
from ffseg.plugins import PEERS
from tests.masks import read_mask

OTHERS = {"peers", "batch", "startup", "memory", "shards"}
"""Suites whose quantities depend on what is installed, or are those of processes."""


def quick(*suites: str, folder: Path | None = None) -> Outcome:
    return run_bench(Order(suites, quick=True, images=folder), lambda text: None)


def test_kernel_fills_what_the_edges_enclose() -> None:
    grey = np.full((100, 120), 50, np.uint8)
    cv2.circle(grey, (60, 50), 30, 200, -1)
    # Canny lies on the circle or a pixel beside it: the fill is its inside but for a ring of two pixels at most.
    assert np.pi * 27.5**2 < reference_kernel(grey) < np.pi * 30.5**2


def test_one_thread_is_given_back() -> None:
    before = cv2.getNumThreads()
    with one_thread():
        assert cv2.getNumThreads() == 1
    assert cv2.getNumThreads() == before


@pytest.mark.parametrize("seed", range(4))
def test_drawn_scene_is_the_same_at_every_size(seed: int) -> None:
    small, large = drawing.draw(seed, 200, 150), drawing.draw(seed, 800, 600)
    assert large.start_radius == 4 * small.start_radius
    shrunk = large.ground.reshape(150, 4, 200, 4).mean(axis=(1, 3))
    # Where a small pixel lies whole inside or outside in the large scene, the small scene says the same.
    whole = (shrunk == 0) | (shrunk == 1)
    assert whole.mean() > 0.9
    assert (small.ground[whole] == (shrunk[whole] == 1)).all()


def test_drawn_scene_leaves_the_start_free_and_the_rest_mixed() -> None:
    for seed in range(20):
        scene = drawing.draw(seed)
        y, x = np.mgrid[:600, :800]
        assert scene.ground[np.hypot(x - 399.5, y - 299.5) < scene.start_radius + 20].all()
        assert 0.1 < scene.ground.mean() < 0.9


def test_patch_contours_have_as_many_patches_as_the_figure_says() -> None:
    (*_, group) = images.patches(Order(quick=True), Path())
    assert group.facts == {"circles": 10}
    assert [task.x for task in group.tasks] == [100, 100, 100]
    assert [task.case for task in group.tasks] == ["still, 100", "filtered, 100", "merging, 100"]


@pytest.fixture(scope="module")
def whole() -> Outcome:
    """Every suite after the other, as the plain command runs them: what one leaves may not be in the way of the next."""
    return quick()


def test_every_suite_measures_what_it_says(whole: Outcome) -> None:
    assert list(dict.fromkeys(figure.suite for figure in whole.figures)) == list(SUITES)
    quantities = {(figure.suite, figure.quantity) for figure in whole.figures if figure.suite not in OTHERS}
    stages = {(suite, stage) for suite in ("size", "method", "scenes") for stage in ("edges", "evolve", "segment")}
    assert quantities == {("patches", "iteration"), *stages}
    assert all(figure.median > 0 for figure in whole.figures)
    assert all(figure.ratio > 0 for figure in whole.figures if figure.unit == "ms")
    assert all(item.ratio > 0 for item in whole.comparisons)
    assert {values["stopped"] for name, values in whole.facts.items() if "scenes" in name} == {"converged"}
    assert whole.slower == []


def test_peers_are_measured_beside_the_free_form(whole: Outcome) -> None:
    names = [name for name in images.BESIDE if PEERS[name].installed]
    assert "cv_edges_opened" in names
    cases = [case for name in names for case in (f"small, freeform beside {name}", f"small, {name}")]
    assert [figure.case for figure in whole.figures if figure.suite == "peers"] == cases
    assert len([item for item in whole.comparisons if item.suite == "peers"]) == len(names)
    assert len([part for part in whole.skipped if part.suite == "peers"]) == len(images.BESIDE) - len(names)


def test_the_truth_of_an_image_must_say_what_is_inside(tmp_path: Path) -> None:
    """As it does for every other command: levels of no known meaning and other sizes are refused."""
    scene = drawing.draw(5, 160, 120)
    (tmp_path / "one.png").write_bytes(cv2.imencode(".png", scene.image)[1].tobytes())
    levels = np.where(scene.ground, np.uint8(200), np.uint8(0))
    for truth, said in (
        (levels, "holds the levels 0, 200"),
        (np.zeros((60, 80), np.uint8), "has 80x60, the image 160x120"),
    ):
        (tmp_path / "one_truth.png").write_bytes(cv2.imencode(".png", truth)[1].tobytes())
        with pytest.raises(FfsegError, match=said):
            quick("scenes", folder=tmp_path)


def test_scenes_of_a_folder_are_scored_by_their_truth(tmp_path: Path) -> None:
    scene = drawing.draw(2, 240, 180)
    cv2.imwrite(str(tmp_path / "one.png"), scene.image)
    (tmp_path / "one_truth.png").write_bytes(encode_mask(scene.ground))
    outcome = quick("scenes", folder=tmp_path)
    assert [figure.case for figure in outcome.figures] == ["one"] * 3
    assert 0 < outcome.facts["scenes/one"]["iou"] <= 1


def test_a_folder_without_images_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="holds no image"):
        quick("scenes", folder=tmp_path)
    with pytest.raises(UsageError, match="there is no folder"):
        quick("scenes", folder=tmp_path / "absent")


def test_an_unknown_suite_is_refused_before_anything_runs() -> None:
    with pytest.raises(UsageError, match="no suite 'pathces'; did you mean 'patches'"):
        quick("patches", "pathces")


def test_bare_pipeline_writes_a_mask_for_each_image(tmp_path: Path) -> None:
    scene, folder, out = drawing.draw(2, 160, 120), tmp_path / "images", tmp_path / "out"
    folder.mkdir()
    for name in ("a", "b"):
        cv2.imwrite(str(folder / f"{name}.png"), scene.image)
    np.save(tmp_path / "masks.npy", scene.ground[None])
    programs.bare(str(folder), str(tmp_path / "masks.npy"), str(out))
    assert sorted(path.name for path in out.iterdir()) == ["a.png", "b.png"]
    assert (read_mask(out / "b.png") == scene.ground).all()


def test_a_child_that_fails_is_named_with_its_last_words() -> None:
    with pytest.raises(FfsegError, match=r"ended with exit code 3: no such luck"):
        processes.run_child(("-c", "import sys; print('no such luck', file=sys.stderr); sys.exit(3)"))


def test_memory_of_a_child_is_its_own() -> None:
    ballast = np.ones(60_000_000, np.uint8)  # of this process: it must not be counted
    empty = processes.peak_memory(lambda: ("-c", "pass"))()[0]
    filled = processes.peak_memory(lambda: ("-c", "x = b'x' * 50_000_000"))()[0]
    assert ballast[0] == 1
    assert empty < 40
    assert 45 < filled - empty < 60
