"""The comparison: rows, gates, Markdown and panels."""

import tarfile
from dataclasses import replace
from pathlib import Path
from unittest.mock import DEFAULT, Mock

import cv2
import numpy as np
import pytest
from batches import table
from runs import COMPARED

import ffseg
from ffseg import plugins
from ffseg.compare import run as work
from ffseg.compare.shared import common_source
from ffseg.compare.text import markdown
from ffseg.errors import OutputError, ParameterError, SegmentationError, UsageError
from ffseg.geometry.freeform import FreeForm
from ffseg.io.overlays import Polyline
from ffseg.io.panels import STRIP, TILE_WIDTH, Tile, encode_panel
from ffseg.parameter_files import load_params
from ffseg.peer_parameters import PeerParameters
from ffseg.result import Segmentation, Timings
from ffseg.scene import Stats
from tests.discs import write_case
from tests.masks import write_image
from tests.small_things import small_things


@pytest.fixture
def case(tmp_path: Path) -> Path:
    write_case(tmp_path)
    return tmp_path


def task_of(folder: Path, methods: str, **settings: object) -> work.Comparison:
    jobs = work.plan_comparison([str(folder)], str(folder / "out"), str(folder / "truth"))
    params = load_params(None, {"init.radius": 10.0, **settings})
    return work.Comparison(jobs, str(folder / "out"), plugins.methods_named(methods), params, PeerParameters(), 2)


def silent(row: work.Row) -> None:
    """Say nothing."""


def test_rows_files_and_panel(case: Path) -> None:
    seen: list[work.Row] = []
    sigma = {"edges.sigma": PeerParameters().cv_edges.sigma}  # which the peer's other parameters were chosen with
    rows = work.compare(task_of(case, "freeform,snake,levelset,cv_edges", **sigma), seen.append)
    assert (rows, [row.method for row in rows]) == (seen, ["freeform", "snake", "levelset", "cv_edges"])
    assert all(row.status == "ok" and row.iou is not None and row.iou > 0.98 and row.holes == 0 for row in rows)
    assert rows[2].iterations is not None
    assert rows[2].iterations > 1500  # nodes of a disc of radius 30 less the start
    assert rows[3].iterations is None
    written = table(case / "out" / "compare.csv")[0]
    assert tuple(written)[: len(COMPARED)] == COMPARED
    assert float(written["total_ms"]) >= float(written["evolve_ms"]) > 0
    assert cv2.imread(str(case / "out" / "panels" / "disc.png")).shape == (STRIP + 300, 4 * TILE_WIDTH, 3)
    page = (case / "out" / "compare.md").read_text(encoding="utf-8")
    assert "| freeform (FF) |" in page
    assert "configs/peers.yaml, chosen on drawn scenes, or of `--peers`:\ncv_edges: sigma " in page


def test_all_methods_have_the_same_edges_and_starts(case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The start lies across the disc's border and is moved: once, for all."""
    watched = Mock(wraps=work.segment)
    monkeypatch.setattr(work, "segment", watched)
    task = replace(task_of(case, "freeform,levelset,cv_edges", **{"init.center": [84, 45], "init.radius": 8}), repeat=1)
    rows = work.compare(task, silent)
    assert [(row.source, row.start_moved) for row in rows] == [("gradient", "yes")] * 3
    scenes = [call.args[0] for call in watched.call_args_list]
    assert len({id(scene.edges) for scene in scenes}) == 1
    (circles,) = {scene.params.init.circles for scene in scenes}
    assert len(circles) == 1
    assert "same edge map (source gradient, sigma 1.5 px)" in (case / "out" / "compare.md").read_text()
    watched.reset_mock()
    work.compare(replace(task, own_edges=True), silent)
    assert not any(call.args[0].edges_given for call in watched.call_args_list)


def test_a_start_that_was_taken_for_a_click_is_one_for_all(tmp_path: Path) -> None:
    """The others grew from the wide circle, which holds the small disc whole."""
    image, truth = small_things(10.0)
    write_image(tmp_path / "a.png", image)
    write_image(tmp_path / "truth" / "a.png", truth)
    task = task_of(tmp_path, "freeform,snake,levelset", **{"init.center": [120, 90], "init.radius": "auto"})
    rows = work.compare(task, silent)
    assert [row.start_moved for row in rows] == ["yes"] * 3
    assert all(row.iou is not None and row.iou > 0.75 for row in rows)


def test_a_start_mask_that_is_moved_is_moved_for_all(case: Path) -> None:
    y, x = np.mgrid[:90, :120]
    write_image(case.parent / "bar.png", (np.abs(x - 89.5) < 1.5) & (np.abs(y - 45) < 3))
    on_an_edge = {"init.mask": str(case.parent / "bar.png"), "edges.source": "gradient"}
    rows = work.compare(task_of(case, "freeform,snake", **on_an_edge), silent)
    assert [(row.status, row.start_moved) for row in rows] == [("ok", "yes")] * 2


def test_what_a_method_may_not_see_no_other_sees() -> None:
    auto, prior = load_params(), load_params(None, {"edges.source": "prior"})
    assert common_source(auto, ("freeform", "snake", "levelset")) == "auto"
    assert common_source(auto, ("freeform", "paper")) == common_source(auto, ("cv_grabcut", "freeform")) == "gradient"
    assert common_source(prior, ("freeform", "cv_grabcut")) == "prior"


@pytest.mark.parametrize("packed", [False, True])
def test_an_interrupted_comparison_goes_on(packed: bool, tmp_path: Path) -> None:
    for name in ("a.png", "b.png", "c.png"):
        write_case(tmp_path, name)
    task, seen = task_of(tmp_path, "freeform,cv_edges"), list[work.Row]()
    if packed:
        with tarfile.open(tmp_path / "in.tar", "w") as archive:
            for path in sorted(tmp_path.glob("*.png")):
                archive.add(path, path.name)
        packs = [str(tmp_path / "in.tar")]
        task = replace(task, jobs=work.plan_comparison(packs, str(tmp_path / "out"), str(tmp_path / "truth")))

    def tell(row: work.Row) -> None:
        seen.append(row)
        if len(seen) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work.compare(task, tell)
    first = (tmp_path / "out" / "compare.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in first[1:]] == ["a.png", "a.png"]
    with (tmp_path / "out" / "compare.jsonl").open("a") as journal:  # lines of another shape are not known
        journal.write('{"image":"x"}\n{"image":"x","rows":[3]}\n')
    paces: list[int] = []
    rows = work.compare(task, seen.append, lambda done, seconds: paces.append(done))
    assert [row.image for row in seen[3:]] == ["b.png"] * 2 + ["c.png"] * 2
    assert (tmp_path / "out" / "compare.csv").read_text().splitlines()[:3] == first
    assert (len(rows), paces) == (6, [2, 3])
    assert not (tmp_path / "out" / "compare.jsonl").exists()
    work.compare(task, seen.append)
    assert len(seen) == 3 + 4 + 6, "a finished one begins anew"
    (tmp_path / "out" / "compare.jsonl").mkdir()
    with pytest.raises(OutputError, match="cannot be written"):
        work.compare(task, seen.append)


def test_a_comparison_that_was_killed_leaves_no_panels(tmp_path: Path) -> None:
    """Those that stood in its journal only stayed for ever; one that was being written is nobody else's."""
    for name in ("a.png", "b.png"):
        write_case(tmp_path, name)
    task, panels = task_of(tmp_path, "cv_edges"), tmp_path / "out" / "panels"

    def tell(row: work.Row) -> None:
        if row.image == "b.png":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work.compare(task, tell)
    (tmp_path / "out" / "compare.csv").unlink()
    (tmp_path / "out" / "compare.md").unlink()
    (panels / "b.png").write_bytes(b"written, not yet in the journal")
    assert task_of(tmp_path, "cv_edges").jobs == task.jobs
    for name in ("a.png", "b.png"):
        (tmp_path / name).unlink()
    write_case(tmp_path, "c.png")
    work.compare(task_of(tmp_path, "freeform"), silent)
    assert [path.name for path in panels.glob("*.png")] == ["c.png"]


def test_one_comparison_at_a_time_in_a_folder(case: Path) -> None:
    """Both ended well, and one had lost its table."""
    task = task_of(case, "cv_edges")

    def another(_: work.Row) -> None:
        work.compare(task, silent)

    with pytest.raises(UsageError, match="another ffseg run is writing to"):
        work.compare(task, another)


def test_the_median_of_the_times_counts(case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = ffseg.segment(ffseg.read_image(case / "disc.png"))
    runs = Mock(side_effect=[replace(result, timings=Timings(1, ms, ms + 1)) for ms in (9.0, 1.0, 2.0)])
    monkeypatch.setattr(work, "segment", runs)
    (row,) = work.compare(replace(task_of(case, "freeform"), repeat=3), silent)
    assert row.evolve_ms == 2


def test_a_method_that_fails_leaves_the_others(case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ffseg.methods.peers.cv_edges", Mock(side_effect=RuntimeError("package\nbroke")))
    rows = work.compare(task_of(case, "cv_edges,freeform"), silent)
    assert ([row.status for row in rows], rows[0].error) == (["failed", "ok"], "internal: RuntimeError: package broke")


def test_a_peer_that_is_not_installed_is_skipped(case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    peer = plugins.PEERS["skfmm"]
    monkeypatch.setitem(plugins.METHODS, "skfmm", replace(peer, module="no_such_module"))
    rows = work.compare(task_of(case, "skfmm,freeform"), silent)
    assert (rows[0].status, rows[0].error) == ("skipped", "the package scikit-fmm is not installed; add ffseg[peers]")
    assert (work.missed_gates(rows, {"": 0.9}), len(work.missed_gates(rows, {"skfmm": 0.9}))) == ([], 1)
    with pytest.raises(SegmentationError, match=r"needs the package scikit-fmm; install it, or ffseg\[peers\]"):
        plugins.methods_named("skfmm")


def test_an_unreadable_image_fails_every_method(case: Path) -> None:
    (case / "bad.png").write_bytes(b"<html>not an image</html>")
    rows = work.compare(task_of(case, "freeform,snake"), silent)
    assert [(row.image, row.status) for row in rows[:2]] == [("bad.png", "failed")] * 2
    assert rows[0].error.startswith("not-an-image: ")
    assert rows[2].status == "ok"


@pytest.mark.parametrize("place", ["read_source", "segment"])
def test_an_image_without_memory_fails_alone(place: str, case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It ended the comparison, and the images after it were not compared."""
    write_case(case, "second.png")
    task = replace(task_of(case, "cv_edges"), repeat=1)
    starved = Mock(wraps=getattr(work, place), side_effect=[MemoryError, *[DEFAULT] * 9])
    monkeypatch.setattr(work, place, starved)
    first, second = work.compare(task, silent)
    assert (first.status, first.error) == ("failed", "out-of-memory: there is not enough memory for it; scale it down")
    assert second.status == "ok"


def test_a_domain_of_one_image_that_cannot_be_read_fails_that_image(case: Path) -> None:
    """It ended the comparison with no table, where a run has a failed row."""
    write_case(case, "second.png")
    (case / "domains").mkdir()
    (case / "domains" / "disc.png").write_text("no image")
    cv2.imwrite(str(case / "domains" / "second.png"), np.full((90, 120), 255, np.uint8))
    images = [str(case / name) for name in ("disc.png", "second.png")]
    jobs = work.plan_comparison(images, str(case / "out"), domains=str(case / "domains"))
    first, second = work.compare(replace(task_of(case, "cv_edges"), jobs=jobs), silent)
    assert (first.status, second.status) == ("failed", "ok")
    assert first.error.startswith("parameters: domain.masks: ")


def test_holes_are_counted_as_a_run_counts_them(case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mask = np.ones((90, 120), np.bool_)
    mask[10:12, 10:12] = mask[20, 20] = mask[30, 30] = False  # what the mask shows, contours or none
    contours = (
        FreeForm.box(0.0, 0.0, 119.0, 89.0),
        FreeForm.polygon([(9.5, 9.5), (9.5, 11.5), (11.5, 11.5), (11.5, 9.5)]),
    )
    found = Segmentation(mask, contours, Stats(1, 0, 0, 0, 0, 4, 4, 4, "converged"), Timings(1.0, 1.0, 2.0))
    monkeypatch.setattr(work, "segment", lambda *_, **__: found)
    (row,) = work.compare(task_of(case, "freeform"), silent)
    assert row.holes == found.num_holes == 3


def test_a_truth_of_another_size_fails(case: Path) -> None:
    cv2.imwrite(str(case / "truth" / "disc.png"), np.zeros((10, 10), np.uint8))
    (row,) = work.compare(task_of(case, "freeform"), silent)
    assert row.status == "failed"
    assert "size" in row.error


def test_gates() -> None:
    rows = [work.Row("a", "freeform", iou=0.99), work.Row("a", "snake", iou=0.959996), work.Row("b", "snake", iou=None)]
    assert (work.missed_gates(rows[:2], {}), work.missed_gates(rows[:2], {"": 0.95})) == ([], [])
    assert work.missed_gates(rows[:2], {"": 0.96}) == ["a: snake has IoU 0.9599, the gate is 0.96"]
    assert work.missed_gates(rows[:2], {"": 0.96, "snake": 0.9}) == []
    assert work.missed_gates(rows, {"snake": 0.9}) == ["b: snake has no IoU, the gate is 0.9"]


def test_methods_are_named_or_grouped() -> None:
    assert plugins.methods_named("snake, freeform,snake") == ("snake", "freeform")
    assert set(plugins.methods_named("peers")) == set(plugins.PEERS)
    assert plugins.methods_named("levelset,all")[0] == "levelset"
    with pytest.raises(ParameterError, match="there is no 'snak'; did you mean 'snake'"):
        plugins.methods_named("freeform,snak")


def test_a_panel_never_replaces_an_input(tmp_path: Path) -> None:
    write_case(tmp_path / "panels")
    with pytest.raises(UsageError, match="replace an input"):
        work.plan_comparison([str(tmp_path / "panels" / "disc.png")], str(tmp_path))


def test_a_bad_domain_mask_is_named(case: Path) -> None:
    task = task_of(case, "freeform", **{"domain.mask": str(case / "none.png")})
    with pytest.raises(ParameterError, match=r"domain\.mask: .*none\.png"):
        work.compare(task, silent)


def test_markdown_shows_failures_and_means(case: Path) -> None:
    task = task_of(case, "freeform,snake")
    rows = [
        work.Row("a|b.png", "freeform", iou=0.5, evolve_ms=2.0, total_ms=3.0, boundary_mean_px=float("nan")),
        work.Row("a|b.png", "snake", status="failed", error="it *broke*"),
        work.Row("c.png", "freeform", iou=1.0, evolve_ms=4.0, total_ms=5.0),
        work.Row("c.png", "snake", iou=0.9, evolve_ms=4.0, total_ms=5.0),
    ]
    text = markdown(task, rows)
    assert "## a\\|b.png" in text
    assert "| snake (PM) | failed: it \\*broke\\* |" in text
    assert "| freeform (FF) | 2 | 3.0 | 4.0 | 0.7500 | 0.5000 |" in text
    assert "nan" not in text


def test_panels_hold_any_number_of_tiles() -> None:
    image = np.full((30, 40, 3), 100, np.uint8)
    square = Polyline(np.array([[5.0, 5.0], [30.0, 5.0], [30.0, 20.0]]), "outer")
    for count, shape in ((1, (1, 1)), (4, (1, 4)), (5, (2, 4))):
        tiles = [Tile("method", np.ones((30, 40), bool), [square])] * count
        panel = cv2.imdecode(np.frombuffer(encode_panel(image, tiles), np.uint8), cv2.IMREAD_COLOR)
        assert panel.shape[:2] == (shape[0] * (STRIP + 300), shape[1] * TILE_WIDTH)
    assert len(encode_panel(image[..., 0], [Tile("failed", None, ())])) > 100


def test_the_error_of_a_method_is_a_row(case: Path) -> None:
    task = task_of(case, "snake", **{"init.circles": [[40, 45, 5], [80, 45, 5]]})
    (row,) = work.compare(task, silent)
    assert row.status == "failed"
    assert row.error.startswith("segmentation: ")
    assert "2 starts" in row.error


def test_panel_of_a_tall_image_stays_small() -> None:
    image = np.full((30_000, 10), 90, np.uint8)
    panel = cv2.imdecode(np.frombuffer(encode_panel(image, [Tile("a", None, ())]), np.uint8), cv2.IMREAD_COLOR)
    assert panel.shape == (24 + 1600, 400, 3)
