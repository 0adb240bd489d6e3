"""Shards: even and stable parts, merged byte for byte into what one run writes, and everything that is amiss named."""

import json
import os
import shutil
import tempfile
import tracemalloc
from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path

import batches
import pytest
import stand_in
from batches import Silent, images_fixture, make_images, run_batch, table, tree
from commands import Command
from hypothesis import given
from hypothesis import strategies as st

from ffseg.batch.outputs.table import Products
from ffseg.batch.plan.jobs import make_plan
from ffseg.batch.plan.sources import order_key
from ffseg.batch.record.journal import last_records
from ffseg.batch.shards.assign import Shard, number_of, read_shard, shard_plan
from ffseg.batch.shards.merge import last_lines, merge_shards
from ffseg.batch.values import Record, record_line
from ffseg.errors import UsageError
from ffseg.parameter_files import load_params

NAMES = [f"{index % 7}/i{index}.png" for index in range(40)]
ALL = Products(True, ("coco", "geojson"))


images = images_fixture(NAMES, {NAMES[3]: stand_in.FAIL, NAMES[8]: stand_in.DEFECT})


run_shard = partial(batches.run_shard, products=ALL)


@pytest.mark.parametrize(("count", "executor"), [(8, "inprocess"), (3, "processes")])
def test_the_merged_tree_is_that_of_one_run(count: int, executor: str, images: Path, tmp_path: Path) -> None:
    run_batch(images, tmp_path / "one", products=ALL, executor="inprocess")
    for number in sorted(range(1, count + 1), key=lambda number: number * 5 % 8):
        run_shard(images, tmp_path / "parts", f"{number}/{count}", executor=executor)
    merged = merge_shards(str(tmp_path / "parts"))
    assert (merged.problems, merged.counts) == ([], {"total": 40, "ok": 38, "failed": 2})
    one, parts = tree(tmp_path / "one"), tree(tmp_path / "parts")
    defect = {name: content.replace(f".ffseg/shards/{number_of(NAMES[8], count)}-of-{count}".encode(), b".ffseg")
              for name, content in parts.items()}  # fmt: skip
    assert defect == one
    again = run_batch(images, tmp_path / "parts", products=ALL, executor="inprocess")
    assert (again.unchanged, again.failed) == (38, 2), "the folder goes on as if one run had made it"


def test_merging_twice_and_after_more_changes_nothing_else(images: Path, out: Path) -> None:
    run_shard(images, out, "1/2")
    first = merge_shards(str(out))
    assert first.problems == ["shard 2/2 never ran; run it with --shard 2/2"]
    assert json.loads((out / "run.json").read_text())["status"] == "incomplete"
    assert len(table(out / "timings.csv")) == first.counts["total"] < 40
    run_shard(images, out, "2/2")
    run_shard(images, out, "2/2")
    assert merge_shards(str(out)).counts["total"] == 40
    before = tree(out)
    assert (merge_shards(str(out)).counts["total"], tree(out)) == (40, before)


def test_a_file_for_all_images_that_lacks_some_says_so(images: Path, tmp_path: Path) -> None:
    out, seen = tmp_path / "out", Silent()
    run_shard(images, out, "1/2")
    run_shard(images, out, "2/2", products=Products())
    has = len(json.loads((out / ".ffseg" / "shards" / "1-of-2" / "coco.json").read_text())["images"])
    wanted = f"coco.json has {has} of 38 images; run the others again with --export coco"
    assert merge_shards(str(out)).problems == [wanted]
    assert json.loads((out / "run.json").read_text())["status"] == "incomplete"
    run_batch(images, out, executor="inprocess", observer=seen)
    assert wanted in seen.notes
    run_batch(images, out, products=ALL, executor="inprocess", observer=seen)
    assert len(seen.notes) == 1


def test_outputs_that_are_gone_are_named_until_their_shard_has_run_again(images: Path, out: Path) -> None:
    """Those of a part that was not copied: the table said ok for each."""
    for part in ("1/2", "2/2"):
        run_shard(images, out, part)
    lost = f"masks/{NAMES[1]}"
    (out / lost).unlink()
    assert merge_shards(str(out)).problems == [f"{lost} is gone; run its shard again"]
    run_shard(images, out, f"{number_of(NAMES[1], 2)}/2")
    assert merge_shards(str(out)).problems == []
    shutil.rmtree(out / "masks")
    assert len(merge_shards(str(out)).problems) == 20


@pytest.mark.parametrize("text", ["[" * 100_000, "[1]", "{", None], ids=["deep", "list", "cut", "pipe"])
def test_a_shard_whose_end_cannot_be_read_did_not_finish(text: str | None, images: Path, out: Path) -> None:
    for part in ("1/2", "2/2"):
        run_shard(images, out, part)
    end = out / ".ffseg" / "shards" / "2-of-2" / "run.json"
    end.unlink()
    os.mkfifo(end) if text is None else end.write_text(text)
    assert merge_shards(str(out)).problems == ["shard 2/2 did not finish; run it again with --shard 2/2"]


def test_shards_that_do_not_belong_together_are_refused_by_name(images: Path, out: Path) -> None:
    with pytest.raises(UsageError, match="holds no shards"):
        merge_shards(str(out))
    run_shard(images, out, "1/2")
    run_shard(images, out, "2/2", load_params(None, {"contour.degree": 2}))
    said = r"shard 2/2 .*other parameters than shard 1/2 \(contour\.degree was 3, is 2\)"
    with pytest.raises(UsageError, match=said):
        merge_shards(str(out))
    run_shard(images, out, "2/2", overwrite=True)
    assert merge_shards(str(out)).problems == []
    make_images(images, ["new.png"])
    run_shard(images, out, f"{number_of('new.png', 2)}/2")
    (problem,) = merge_shards(str(out)).problems
    assert "different images (" in problem
    run_shard(images, out, "1/3")
    with pytest.raises(UsageError, match="in 2 and 3 parts"):
        merge_shards(str(out))


def test_what_resuming_calls_stale_a_merge_names(images: Path, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patched:
        patched.setattr("ffseg.batch.record.keeper.__version__", "0.0.9")
        run_shard(images, out, "1/2")
    run_shard(images, out, "2/2")
    merge = merge_shards(str(out))
    old = sum(record.version == "0.0.9" for record in last_records(str(out / ".ffseg")).values())
    assert old > 1
    assert [text.partition(",")[0] for text in merge.problems] == [f"{old} images were made by ffseg 0.0.9"]
    run_shard(images, out, "1/2")
    name = next(job.source.name for job in make_plan([str(images)], str(out)).jobs)
    content = (images / name).read_bytes()
    (images / name).unlink()
    for run, rows in ((False, 40), (True, 39)):  # only the shard knows the disk that the image is gone from
        for part in ("1/2", "2/2") if run else ():
            run_shard(images, out, part)
        merge = merge_shards(str(out))
        told = json.loads((out / "run.json").read_text())
        assert (told["counts"]["stale"], [entry["image"] for entry in told["stale"]]) == (1, [name])
        assert (merge.problems, merge.num_stale, merge.counts["total"]) == ([], 1, rows)
        assert (len(table(out / "timings.csv")), name in (out / "coco.json").read_text()) == (rows, not run)
    (images / name).write_bytes(content)
    run_batch(images, out, products=ALL, executor="inprocess")
    assert merge_shards(str(out)).counts["total"] == 40, "the shard has not heard that it came back"


def test_shards_of_other_images_and_copied_folders_are_named(images: Path, tmp_path: Path, out: Path) -> None:
    make_images(tmp_path / "others", [f"{name}x.png" for name in NAMES])
    run_shard(images, out, "1/2")
    run_shard(tmp_path / "others", out, "2/2")
    (problem,) = merge_shards(str(out)).problems
    assert "different images (40 by shard 1/2, 40 by shard 2/2)" in problem
    shards = out / ".ffseg" / "shards"
    shutil.rmtree(shards / "2-of-2")
    shutil.copytree(shards / "1-of-2", shards / "2-of-2")
    assert merge_shards(str(out)).problems == ["the folder of shard 2/2 is another's (1-of-2); run it with --shard 2/2"]


def test_one_shard_leaves_the_others_alone(images: Path, out: Path) -> None:
    run_shard(images, out, "1/2")
    mine = out / "masks" / "0" / ".ffseg-1-abc-1.tmp"
    mine.parent.mkdir(parents=True, exist_ok=True)
    mine.write_bytes(b"another shard is writing this")
    run_shard(images, out, "2/2")
    assert mine.exists()
    merge_shards(str(out))
    assert not mine.exists()


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "/", "1/0", "a/b", "1/2/3", "-1/2", "1/100001", " 1/2"])
def test_parts_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(UsageError, match="--shard.*n up to 100000;"):
        read_shard(text)


def test_every_image_belongs_to_one_shard_and_stays_there() -> None:
    names = [f"{index}.png" for index in range(20_000)]
    for count in (1, 2, 7):
        parts = Counter(number_of(name, count) for name in names)
        assert set(parts) == set(range(1, count + 1))
        # 20,000 draws: a share leaves its mean by five standard deviations less than once in a million
        assert max(abs(part - 20_000 / count) for part in parts.values()) <= 5 * (20_000 / count) ** 0.5
    plan = make_plan([__file__], "out")
    (job,) = plan.jobs
    jobs = tuple(replace(job, index=k, source=replace(job.source, name=name)) for k, name in enumerate(names[:100]))
    parts = [shard_plan(replace(plan, jobs=jobs), Shard(number, 3)).jobs for number in (1, 2, 3)]
    assert sorted(job.source.name for part in parts for job in part) == sorted(names[:100])
    assert all([job.index for job in part] == list(range(len(part))) for part in parts)


@given(st.lists(st.tuples(st.binary(max_size=2), st.integers(0, 1), st.binary(max_size=30))))
def test_of_each_key_the_last_lines_are_given_in_order(lines: list[tuple[bytes, int, bytes]]) -> None:
    last = {(key, rank): line for key, rank, line in lines}
    wanted = [(last.get((key, 0), b""), last.get((key, 1), b"")) for key in sorted({key for key, _ in last})]
    with tempfile.TemporaryDirectory() as folder:
        assert (list(last_lines(lines, folder)), os.listdir(folder)) == (wanted, [])


HEAD = {"format": 2, "settings": "s", "files": {"camera": ""}, "parameters": {}}
ROW = {"status": "ok", "error": "", "width": 800, "total_ms": 12.5, "method": "freeform"}


def journal_of(out: Path, count: int, shards: int = 2) -> None:
    """Journals of so many made-up images."""
    for number in range(1, shards + 1):
        folder = out / ".ffseg" / "shards" / f"{number}-of-{shards}"
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "journal.jsonl").open("wb") as file:
            file.write(json.dumps(HEAD).encode() + b"\n")
            for index in range(number, count + 1, shards):
                name = f"{index % 100}/{index}.png"
                row = {**ROW, "area_px": index}
                file.write(record_line(Record(name, "ok", "0.1", "s", "c", {}, row, order=order_key(0, name))))
        (folder / "run.json").write_text(json.dumps({"status": "finished", "whole": count}))


def test_the_memory_of_a_merge_does_not_grow_with_its_rows(tmp_path: Path) -> None:
    peaks = []
    for count in (1_000, 4_000):
        out = tmp_path / str(count)
        journal_of(out, count)
        tracemalloc.start()
        assert merge_shards(str(out)).counts["total"] == count
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        rows = [row["image"] for row in table(out / "timings.csv")]
        assert rows == sorted(rows, key=lambda name: order_key(0, name))
    # the records of 3,000 rows more have 1 MB; SQLite's pages, of a fixed number, are not Python's
    assert peaks[1] < peaks[0] + 150_000


def test_a_table_can_be_parquet_too(images: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    run_batch(images, tmp_path / "out", parquet=True, executor="inprocess")
    found = parquet.read_table(tmp_path / "out" / "timings.parquet").to_pylist()
    rows = table(tmp_path / "out" / "timings.csv")
    assert [{key: "" if cell is None else str(cell) for key, cell in row.items()} for row in found] == rows
    seen = Silent()
    run_batch(images, tmp_path / "out", executor="inprocess", observer=seen)
    assert parquet.read_table(tmp_path / "out" / "timings.parquet").to_pylist() == found
    assert seen.notes == ["timings.parquet shows an earlier state; ask for it to have it made anew"], "two failed again"


def test_the_command_names_a_shard_that_never_ran(images: Path, tmp_path: Path, ffseg_command: Command) -> None:
    ffseg_command("run", images, "--out", "parts", "--shard", "1/2", cwd=tmp_path, code=0)
    assert "shard 2/2 never ran" in ffseg_command("merge", "parts", cwd=tmp_path, code=3).stderr
