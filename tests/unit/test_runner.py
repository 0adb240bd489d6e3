"""A run: whole or absent, once, in any order, and one bad image costs nobody else anything."""

import errno
import json
import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import stand_in
from batches import Silent, images_fixture, make_images, run_batch, snapshot, table
from commands import Command
from PIL import Image

from ffseg.batch.outputs.table import Products
from ffseg.batch.plan.sources import InputImage, Job
from ffseg.batch.record.tables import TIMING_COLUMNS
from ffseg.batch.workers import work
from ffseg.batch.workers.messages import Failed, Setup, Task
from ffseg.errors import UsageError, WorkerLostError
from ffseg.parameter_files import load_params

NAMES = [f"s{index % 3}/image{index}.png" for index in range(12)]


images = images_fixture(NAMES)


def test_outputs_and_table_mirror_the_input(images: Path, tmp_path: Path) -> None:
    summary = run_batch(images, tmp_path / "out", products=Products(overlay=True))
    assert (summary.total, summary.done, summary.failed) == (12, 12, 0)
    kinds = (("masks", ".png"), ("contours", ".svg"), ("overlays", ".png"))
    expected = {f"{kind}/{name.removesuffix('.png')}{end}" for name in NAMES for kind, end in kinds}
    assert snapshot(tmp_path / "out").keys() == expected
    rows = table(tmp_path / "out" / "timings.csv")
    assert tuple(rows[0])[: len(TIMING_COLUMNS)] == TIMING_COLUMNS
    assert [row["image"] for row in rows] == sorted(NAMES, key=lambda name: (name[:2], int(name[8:-4])))
    mask = np.asarray(Image.open(tmp_path / "out" / "masks" / NAMES[0]))
    np.testing.assert_array_equal(mask == 255, np.asarray(Image.open(images / NAMES[0])) > 127)
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["counts"] == {"total": 12, "done": 12, "unchanged": 0, "failed": 0, "stale": 0}
    assert record["parameters"]["contour"]["degree"] == 3


def test_second_run_does_only_what_is_missing_or_stale(images: Path, out: Path) -> None:
    run_batch(images, out)
    before, rows = snapshot(out), table(out / "timings.csv")
    assert (run_batch(images, out).unchanged, table(out / "timings.csv")) == (12, rows)
    (out / "masks" / NAMES[0]).unlink()
    (out / "contours" / NAMES[1]).with_suffix(".svg").write_bytes(b"<svg")
    make_images(images, ["s0/new.png"])
    shutil.copy(images / NAMES[3], images / NAMES[4])
    summary = run_batch(images, out)
    assert (summary.unchanged, summary.done) == (9, 4)
    after = snapshot(out)
    assert after[f"masks/{NAMES[0]}"] == before[f"masks/{NAMES[0]}"]
    assert after[f"masks/{NAMES[4]}"] == before[f"masks/{NAMES[3]}"]


def test_touched_image_of_the_same_content_is_done(images: Path, tmp_path: Path) -> None:
    run_batch(images, tmp_path / "out")
    os.utime(images / NAMES[0], (1, 1))
    assert run_batch(images, tmp_path / "out").unchanged == 12


def test_other_version_does_all_again(images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run_batch(images, tmp_path / "out")
    monkeypatch.setattr("ffseg.batch.values.__version__", "99")
    assert run_batch(images, tmp_path / "out").done == 12


def test_other_parameters_are_refused_by_name_unless_overwritten(images: Path, tmp_path: Path) -> None:
    run_batch(images, tmp_path / "out")
    other = load_params(None, {"contour.degree": 2})
    before = snapshot(tmp_path / "out")
    with pytest.raises(UsageError, match=r"contour\.degree was 3, is 2"):
        run_batch(images, tmp_path / "out", params=other)
    assert snapshot(tmp_path / "out") == before
    assert run_batch(images, tmp_path / "out", params=other, overwrite=True).done == 12


def test_changed_mask_file_counts_as_other_parameters(images: Path, tmp_path: Path) -> None:
    mask = tmp_path / "domain.png"
    Image.fromarray(np.full((12, 16), 255, np.uint8)).save(mask)
    params = load_params(None, {"domain.mask": str(mask)})
    run_batch(images, tmp_path / "out", params=params)
    Image.fromarray(np.eye(12, 16, dtype=np.uint8)).save(mask)
    with pytest.raises(UsageError, match=r"domain\.mask has changed"):
        run_batch(images, tmp_path / "out", params=params)


def test_unreadable_mask_of_the_parameters_stops_before_the_first_image(images: Path, tmp_path: Path) -> None:
    (tmp_path / "domain.png").write_bytes(b"not an image")
    params = load_params(None, {"domain.mask": str(tmp_path / "domain.png")})
    with pytest.raises(UsageError, match=r"domain\.mask.*text file"):
        run_batch(images, tmp_path / "out", params=params)
    assert snapshot(tmp_path / "out") == {}


@pytest.mark.parametrize("name", [f"masks/{NAMES[0]}", "timings.csv", "run.json"])
def test_files_no_run_made_are_not_replaced(name: str, images: Path, out: Path) -> None:
    (out / name).parent.mkdir(parents=True)
    (out / name).write_bytes(b"mine")
    with pytest.raises(UsageError, match="no run made it"):
        run_batch(images, out)
    assert (out / name).read_bytes() == b"mine"
    assert snapshot(out).keys() <= {name}
    assert run_batch(images, out, overwrite=True).done == 12


@pytest.mark.parametrize("name", ["masks/s1/image1.png", "coco.json", "yolo.yaml", "timings.parquet"])
def test_files_no_run_made_are_not_replaced_beside_those_one_made(name: str, images: Path, out: Path) -> None:
    """A folder with a journal was taken for the run's own, whatever lay in it."""
    run_batch(images / "s0", out)
    (out / name).parent.mkdir(exist_ok=True)
    (out / name).write_bytes(b"mine")
    asked = {"products": Products(exports=("coco", "yolo")), "parquet": True}
    with pytest.raises(UsageError, match=f"{name} exists and no run made it"):
        run_batch(images, out, **asked)
    assert (out / name).read_bytes() == b"mine"
    (out / name).unlink()
    run_batch(images, out, **asked)
    assert run_batch(images, out, **asked).unchanged == 12


@pytest.mark.parametrize("spoil", [("{", "x"), ('"format":2', '"format":1'), ("\n", " ")])
def test_a_journal_that_cannot_be_read_is_not_taken_for_none(spoil: tuple[str, str], images: Path, out: Path) -> None:
    """All was made anew in its place, even with other parameters."""
    run_batch(images, out)
    before, journal = snapshot(out), out / ".ffseg" / "journal.jsonl"
    text = journal.read_text()
    journal.write_text(text.replace(*spoil, 1))
    assert journal.read_text() != text
    with pytest.raises(UsageError, match="nothing says how the outputs were made"):
        run_batch(images, out, params=load_params(None, {"edges.sigma": 6}))
    journal.unlink()
    with pytest.raises(UsageError, match="no run made it"):
        run_batch(images, out)
    assert (snapshot(out), run_batch(images, out, overwrite=True).done) == (before, 12)


def test_an_image_that_fails_half_written_leaves_nothing(images: Path, tmp_path: Path) -> None:
    """What it left would be in the way of the next run."""
    pipe = tmp_path / "out" / "contours" / NAMES[0].replace(".png", ".svg")
    pipe.parent.mkdir(parents=True)
    os.mkfifo(pipe)
    summary = run_batch(images, tmp_path / "out", overwrite=True)
    assert (summary.done, summary.failed) == (11, 1)
    assert not (tmp_path / "out" / "masks" / NAMES[0]).exists()
    pipe.unlink()
    assert run_batch(images, tmp_path / "out").done == 1


@pytest.mark.parametrize("workers", [1, 3])
def test_crash_hang_memory_and_defects_cost_only_their_image(workers: int, tmp_path: Path, out: Path) -> None:
    levels = {NAMES[2]: stand_in.CRASH, NAMES[3]: stand_in.HANG, NAMES[5]: stand_in.EAT,
              NAMES[6]: stand_in.FAIL, NAMES[7]: stand_in.DEFECT, NAMES[8]: stand_in.CRASH}  # fmt: skip
    make_images(tmp_path / "in", NAMES, levels)
    # The images that work take milliseconds: the limit is one that even a very busy machine keeps.
    summary = run_batch(tmp_path / "in", out, num_workers=workers, timeout=4, memory_bytes=1 << 30)
    failed = {row["image"]: row["error"] for row in table(out / "timings.csv") if row["status"] == "failed"}
    assert {name: error.split(":")[0] for name, error in failed.items()} == {
        NAMES[2]: "crash", NAMES[3]: "timeout", NAMES[5]: "out-of-memory", NAMES[6]: "segmentation",
        NAMES[7]: "internal", NAMES[8]: "crash",
    }  # fmt: skip
    assert (summary.done, summary.failed) == (6, 6)
    assert "ZeroDivisionError" in (out / ".ffseg" / "errors.log").read_text()
    assert "SIGSEGV" in failed[NAMES[2]]


def test_opencv_without_memory_is_out_of_memory(images: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its error is no MemoryError: the row said "internal" and showed the source line of OpenCV."""

    def starved(*_: object) -> None:
        error = cv2.error("(-4:Insufficient memory)")
        error.code = cv2.Error.StsNoMem
        raise error

    monkeypatch.setattr(work, "read_picture", starved)
    task = Task(Job(0, InputImage(str(images / NAMES[0]), NAMES[0]), "a"), "", ("masks/a.png", "contours/a.svg"))
    reply = work.Workbench(Setup(params=load_params())).reply(task)
    assert isinstance(reply, Failed)
    assert reply.reason == "out-of-memory"


def test_worker_that_dies_early_ends_the_run(images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand_in, "NAME", "stand_in:absent")
    with pytest.raises(WorkerLostError, match="absent"):
        run_batch(images, tmp_path / "out")


def test_stopped_run_writes_what_it_has_and_the_next_one_goes_on(images: Path, tmp_path: Path) -> None:
    summary = run_batch(images, tmp_path / "out", observer=Silent(last=4))
    assert summary.signal == 15
    assert 4 <= summary.done < 12
    assert len(table(tmp_path / "out" / "timings.csv")) == summary.done
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "interrupted"
    rest = run_batch(images, tmp_path / "out")
    assert (rest.unchanged, rest.done) == (summary.done, 12 - summary.done)
    run_batch(images, tmp_path / "straight")
    assert snapshot(tmp_path / "out") == snapshot(tmp_path / "straight")


@pytest.mark.parametrize("workers", [1, 4])
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO])
def test_output_that_cannot_be_written_fails_its_image_alone_and_names_the_path(
    code: int, workers: int, images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = os.replace

    def fail(source: str, target: str) -> None:
        if target.endswith("masks/s1/image4.png"):
            raise OSError(code, os.strerror(code))
        real(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", fail)
        summary = run_batch(images, tmp_path / "out", num_workers=workers)
    row = next(row for row in table(tmp_path / "out" / "timings.csv") if row["image"] == "s1/image4.png")
    assert (summary.done, summary.failed) == (11, 1)
    assert row["error"].startswith("output: ")
    assert "masks/s1/image4.png" in row["error"]
    assert not list((tmp_path / "out").rglob("*.tmp"))


def test_truth_adds_the_overlap_and_a_truth_of_other_size_fails_its_image(images: Path, tmp_path: Path) -> None:
    pytest.importorskip("ffseg.metrics")
    run_batch(images, tmp_path / "first")
    truth = tmp_path / "truth"
    shutil.copytree(tmp_path / "first" / "masks", truth)
    Image.fromarray(np.zeros((5, 5), np.uint8)).save(truth / NAMES[0])
    (truth / NAMES[1]).unlink()
    summary = run_batch(images, tmp_path / "out", truth=str(truth))
    rows = {row["image"]: row for row in table(tmp_path / "out" / "timings.csv")}
    assert summary.failed == 1
    assert rows[NAMES[0]]["error"].startswith("truth: ")
    assert (rows[NAMES[1]]["iou"], {rows[name]["iou"] for name in NAMES[2:]}) == ("", {"1.0"})


@pytest.mark.parametrize("gone", [True, False], ids=["removed", "not-among-other-truths"])
def test_no_overlap_is_kept_of_other_truths(gone: bool, images: Path, tmp_path: Path, ffseg_command: Command) -> None:
    """The table and the summary once disagreed, and one column held overlaps with masks of two folders."""
    command = ("run", images, "--out", tmp_path / "out", "--json", "--truth")
    ffseg_command(*command[:5], code=0)
    truth = tmp_path / "truth"
    shutil.copytree(tmp_path / "out" / "masks", truth)
    assert json.loads(ffseg_command(*command, truth).stdout)["mean_iou"] == 1
    if gone:
        (truth / NAMES[0]).unlink()
    else:
        shutil.copytree(truth, tmp_path / "others", ignore=shutil.ignore_patterns(Path(NAMES[0]).name))
    done = json.loads(ffseg_command(*command, truth if gone else tmp_path / "others").stdout)
    told = {row["image"]: row.get("iou") for row in done["images"]}
    assert done["counts"]["unchanged"] == len(NAMES)
    assert {name for name, overlap in told.items() if overlap is None} == {NAMES[0]}
    assert {row["image"] for row in table(tmp_path / "out" / "timings.csv") if row["iou"] == ""} == {NAMES[0]}
