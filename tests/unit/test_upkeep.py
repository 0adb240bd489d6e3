"""The record of an output folder cannot go stale: part of the images, other outputs, other parameters, gone images."""

import errno
import json
import os
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import stand_in
from batches import Silent, images_fixture, make_images, run_batch, run_plan, snapshot, table

from ffseg.batch.executors import processes
from ffseg.batch.executors.base import Options
from ffseg.batch.outputs.table import Products
from ffseg.batch.plan.jobs import make_plan
from ffseg.batch.preview import preview
from ffseg.batch.record.lock import OutputLock
from ffseg.batch.workers.messages import Setup
from ffseg.errors import OutputError, UsageError
from ffseg.parameter_files import load_params
from tests.masks import write_image

NAMES = [f"{name}.png" for name in "abcdef"]
ALL = Products(True, ("coco", "geojson"))


images = images_fixture(NAMES)


def run_in(images: Path | list[Path], out: Path, **options: object):
    return run_batch(images, out, executor="inprocess", **options)


def rows(out: Path) -> list[str]:
    return [row["image"] for row in table(out / "timings.csv")]


def test_a_run_over_part_of_the_images_keeps_the_rest(images: Path, out: Path) -> None:
    run_in(images, out, products=ALL)
    coco = (out / "coco.json").read_bytes()
    before = table(out / "timings.csv")
    assert (run_in(images / "c.png", out, products=ALL).unchanged, table(out / "timings.csv")) == (1, before)
    assert (out / "coco.json").read_bytes() == coco
    shutil.copy(images / "d.png", images / "c.png")
    assert (run_in(images / "c.png", out, products=ALL).done, rows(out)) == (1, NAMES)
    assert run_in(images, out, products=ALL).unchanged == 6


def test_other_outputs_make_only_what_is_asked_for_and_missing(images: Path, out: Path) -> None:
    run_in(images, out, products=ALL)
    assert run_in(images, out).unchanged == 6, "nothing is asked for that is not there"
    assert (out / "coco.json").exists()
    (out / "overlays" / "b.png").unlink()
    assert run_in(images, out).unchanged == 6
    masks = {path: path.stat().st_mtime_ns for path in (out / "masks").iterdir()}
    summary = run_in(images, out, products=ALL)
    assert (summary.unchanged, summary.done) == (5, 1)
    assert (out / "overlays" / "b.png").exists()
    assert masks == {path: path.stat().st_mtime_ns for path in (out / "masks").iterdir()}


def test_truths_measure_what_is_there(images: Path, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NAMES:
        write_image(tmp_path / "truth" / name, np.eye(12, 16, dtype=np.bool_))
    truth = str(tmp_path / "truth")
    run_in(images, tmp_path / "straight", truth=truth)
    expected = [row["iou"] for row in table(tmp_path / "straight" / "timings.csv")]
    run_in(images, out)
    with monkeypatch.context() as patch:
        patch.setattr(stand_in, "segment", None)  # nothing is segmented from here on
        assert run_in(images, out, truth=truth).unchanged == 6
        assert ([row["iou"] for row in table(out / "timings.csv")], run_in(images, out).unchanged) == (expected, 6)
        assert [row["iou"] for row in table(out / "timings.csv")] == expected, "the IoU is as true as before"
        write_image(tmp_path / "truth" / "b.png", np.eye(12, 16, 1, dtype=np.bool_))
        assert run_in(images, out).unchanged == 6
        assert [row["iou"] for row in table(out / "timings.csv")] == [expected[0], "", *expected[2:]]
        write_image(tmp_path / "truth" / "c.png", np.zeros((5, 5), np.bool_))
        summary = run_in(images, out, truth=truth)
        assert (summary.unchanged, summary.failed) == (5, 1)
        assert (out / "masks" / "c.png").exists(), "only its truth is wrong"
        assert run_in(images, out).failed == 0


def test_an_image_that_takes_over_an_output_takes_its_row(tmp_path: Path, out: Path) -> None:
    make_images(tmp_path / "one", ["x.png", "y.png"])
    make_images(tmp_path / "two", ["x.jpg"])
    run_in(tmp_path / "one", out, products=ALL)
    run_in(tmp_path / "two", out)
    assert rows(out) == ["x.jpg", "y.png"]
    assert not (out / "overlays" / "x.png").exists()
    assert (run_in(tmp_path / "two", out).unchanged, rows(out)) == (1, ["x.jpg", "y.png"])


def test_a_run_in_which_every_image_failed_stands_in_nobodys_way(tmp_path: Path) -> None:
    make_images(tmp_path / "in", ["a.png", "b.png"], {"a.png": stand_in.FAIL, "b.png": stand_in.FAIL})
    assert run_in(tmp_path / "in", tmp_path / "out").failed == 2
    make_images(tmp_path / "in", ["a.png", "b.png"])
    assert run_in(tmp_path / "in", tmp_path / "out", params=load_params(None, {"contour.degree": 2})).done == 2
    with pytest.raises(UsageError, match="other parameters"):
        run_in(tmp_path / "in", tmp_path / "out")


def test_every_file_a_job_depends_on_makes_it_stale(images: Path, tmp_path: Path) -> None:
    plan = make_plan([str(images)], str(tmp_path / "out"))
    evidence = [tmp_path / f"{job.index}.npy" for job in plan.jobs]
    plan = replace(plan, jobs=tuple(replace(job, evidence=str(evidence[job.index])) for job in plan.jobs))
    setup = Setup(params=load_params(), segmenter=stand_in.NAME, files={"model": str(tmp_path / "model")})
    again = partial(run_plan, plan, setup, executor="inprocess")
    (tmp_path / "model").write_bytes(b"trees")
    for path in evidence:
        np.save(path, np.full((12, 16), 0.5, np.float32))
    assert (again().done, again().unchanged) == (6, 6)
    np.save(evidence[2], np.full((12, 16), 0.25, np.float32))
    evidence[1].unlink()
    summary = again()
    assert (summary.unchanged, summary.done, summary.failed) == (4, 1, 1)
    (tmp_path / "model").write_bytes(b"other trees")
    with pytest.raises(UsageError, match="the file of model has changed"):
        again()


def test_a_preview_says_what_the_run_does(images: Path, out: Path) -> None:
    setup = Setup(params=load_params(), segmenter=stand_in.NAME, products=ALL)

    def seen(params=setup.params, overwrite: bool = False) -> list[str]:
        plan = make_plan([str(images)], str(out), products=ALL)
        return [one.status for one in preview(plan, Setup(params=params, products=ALL), Options(overwrite=overwrite))]

    assert seen() == ["to do"] * 6
    assert not out.exists()
    run_in(images, out, products=ALL)
    (out / "overlays" / "b.png").write_bytes(b"")
    (images / "c.png").write_bytes(b"")
    assert seen() == ["unchanged", "to do", "failed", "unchanged", "unchanged", "unchanged"]
    other = load_params(None, {"contour.degree": 2})
    with pytest.raises(UsageError, match=r"contour\.degree was 3, is 2"):
        seen(other)
    assert seen(other, overwrite=True)[0] == "to do"
    with OutputLock(str(out)), pytest.raises(UsageError, match="another ffseg run"):
        seen()


def test_pipes_in_the_place_of_outputs_are_not_replaced(images: Path, out: Path) -> None:
    run_in(images, out)
    for name in ("masks/a.png", "contours/b.svg"):
        (out / name).unlink()
        os.mkfifo(out / name)
    summary = run_in(images, out)
    assert (summary.unchanged, summary.failed) == (4, 2)
    assert "is a named pipe and is not replaced" in table(out / "timings.csv")[0]["error"]


def test_previews_of_bad_records_say_the_same(images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It passed over a state folder without permissions, and said that all is to be done."""
    run_in(images, tmp_path / "out")
    lock, real = str(tmp_path / "out" / ".ffseg" / "lock"), os.open

    def locked(path: str, *arguments: int, **options: int) -> int:
        if path == lock:
            raise PermissionError(errno.EACCES, "Permission denied")
        return real(path, *arguments, **options)

    monkeypatch.setattr(os, "open", locked)
    plan = make_plan([str(images)], str(tmp_path / "out"))
    said = r"lock cannot be written \(Permission denied\); check the folder"
    with pytest.raises(OutputError, match=said):
        run_in(images, tmp_path / "out")
    with pytest.raises(OutputError, match=said):
        list(preview(plan, Setup(params=load_params()), Options()))


def test_a_preview_looks_at_the_headers_of_what_is_to_do(images: Path, tmp_path: Path) -> None:
    """It said "to do", and ended with 0, of a text file called a.png; the run ended with 3."""
    (images / "a.png").write_text("no image at all")
    plan = make_plan([str(images)], str(tmp_path / "out"))
    found = {one.job.source.name: one for one in preview(plan, Setup(params=load_params()), Options())}
    assert {one.status for name, one in found.items() if name != "a.png"} == {"to do"}
    assert found["a.png"].status == "failed"
    assert found["a.png"].error.startswith("not-an-image: the content looks like a text file")
    large = list(preview(plan, Setup(params=load_params(), max_pixels=100), Options()))
    assert {one.error.partition(":")[0] for one in large} == {"not-an-image", "too-many-pixels"}


@pytest.mark.parametrize("name", ["timings.csv", "run.json", "coco.json"])
def test_pipes_in_the_place_of_tables_are_not_replaced(name: str, images: Path, out: Path) -> None:
    out.mkdir()
    os.mkfifo(out / name)
    with pytest.raises(UsageError, match="no run made it"):
        run_in(images, out, products=ALL)
    summary = run_in(images, out, products=ALL, overwrite=True)
    assert (summary.done, summary.failed, summary.problems) == (
        len(NAMES), 0, [f"{out / name} is a named pipe and is not replaced; choose another name"],
    )  # fmt: skip
    assert (out / name).is_fifo()


def test_what_failed_and_is_gone_leaves_the_tables(images: Path, tmp_path: Path) -> None:
    """The row of a link to nothing stayed for ever."""
    (images / "z.png").symlink_to("nothing")
    (images / "text.png").write_text("no image")
    run_in(images, tmp_path / "out")
    assert [row for row in rows(tmp_path / "out") if row not in NAMES] == ["text.png", "z.png"]
    (images / "z.png").unlink()
    run_in([images / NAMES[0]], tmp_path / "out")
    assert [row for row in rows(tmp_path / "out") if row not in NAMES] == ["text.png"]


def test_duplicate_names_are_all_named_and_suffixes_can_be_kept(tmp_path: Path) -> None:
    make_images(tmp_path / "in", ["a.png", "a.jpg", "b.png", "b.jpg", "b.bmp", "c.png"])
    with pytest.raises(UsageError) as caught:
        run_in(tmp_path / "in", tmp_path / "out")
    assert all(f"in/{name}" in str(caught.value) for name in ("a.png", "a.jpg", "b.png", "b.jpg", "b.bmp"))
    assert "--keep-suffix" in str(caught.value)
    assert run_in(tmp_path / "in", tmp_path / "out", keep_suffix=True).done == 6
    assert "masks/b.bmp.png" in snapshot(tmp_path / "out")
    assert run_in(tmp_path / "in", tmp_path / "other", exclude=["*.jpg", "b.b*"]).done == 3


def test_fewer_processes_than_asked_do_the_work(images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    left, real = [1], processes.launch

    def scarce():
        if left[0] == 0:
            raise OSError(24, "Too many open files")
        left[0] -= 1
        return real()

    monkeypatch.setattr(processes, "launch", scarce)
    observer = Silent()
    assert run_batch(images, tmp_path / "out", observer=observer, num_workers=4).done == 6
    assert [note for note in observer.notes if "only 1 worker" in note] == observer.notes
    with pytest.raises(UsageError, match="no worker process can be started"):
        run_batch(images, tmp_path / "none", num_workers=4)


def test_names_that_are_no_utf8_are_readable_in_coco(tmp_path: Path) -> None:
    name = os.fsdecode(b"b\xff.png")
    make_images(tmp_path / "in", ["a\\b.png", name])
    run_in(tmp_path / "in", tmp_path / "out", products=Products(exports=("coco", "geojson")))
    document = (tmp_path / "out" / "coco.json").read_bytes()
    assert [image["file_name"] for image in json.loads(document)["images"]] == ["a\\b.png", "b\\xff.png"]
    document.decode("utf-8")
    assert b"\\ud" not in document


def test_long_names_are_refused_where_an_export_does_not_fit(tmp_path: Path) -> None:
    make_images(tmp_path / "in", ["n" * 247 + ".png", "m" * 249 + ".png"])
    run_in(tmp_path / "in", tmp_path / "out", products=Products(exports=("geojson",)))
    errors = {row["image"][0]: row["error"][:8] for row in table(tmp_path / "out" / "timings.csv")}
    assert errors == {"n": "", "m": "bad-name"}
    run_in(tmp_path / "in", tmp_path / "plain")
    assert [row["error"] for row in table(tmp_path / "plain" / "timings.csv")] == ["", ""]
