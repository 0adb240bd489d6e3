"""Packed outputs: the bytes of a file each, in tar files that are the same however the work was shared out."""

import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tarfile
from functools import partial
from itertools import product
from pathlib import Path

import batches
import numpy as np
import pytest
import stand_in
from batches import Silent, images_fixture, make_images, run_batch, table, tree
from commands import Command
from runs import data_of

from ffseg.batch.executors.base import Options
from ffseg.batch.outputs.table import Products
from ffseg.batch.plan.jobs import make_plan
from ffseg.batch.preview import preview
from ffseg.batch.record.journal import last_records, state_folder
from ffseg.batch.record.ordered import OrderedPacks
from ffseg.batch.report.write import write_report
from ffseg.batch.shards.assign import Shard, shard_plan
from ffseg.batch.shards.merge import merge_shards
from ffseg.batch.tar.members import output_bytes
from ffseg.batch.tar.writer import PackWriter, head, head_size
from ffseg.batch.workers.messages import Setup
from ffseg.errors import OutputError, UsageError
from ffseg.parameter_files import load_params
from tests.masks import write_image

NAMES = [f"{index % 3}/i{index}.png" for index in range(14)]
INPROCESS = "inprocess"
EXPORTS = ("coco", "geojson")
FILES = Products(True, EXPORTS)
PACKED = Products(True, EXPORTS, pack=True)
KINDS = ("masks", "contours", "overlays", "coco", "geojson")


@pytest.fixture(autouse=True)
def _quick_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is tested is the order of what is done: a process that is killed leaves its pages to the system."""
    monkeypatch.setattr(os, "fsync", lambda _: None)


images = images_fixture(NAMES, {NAMES[3]: stand_in.FAIL})


run_shard = partial(batches.run_shard, products=PACKED)
run_packed = partial(run_batch, products=PACKED, executor=INPROCESS)


def tars(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in out.glob("*.tar")}


def straight(images: Path, out: Path) -> dict[str, bytes]:
    """The tar files of a run that nothing interrupts."""
    run_packed(images, out)
    return tars(out)


def unpacked(out: Path, into: Path) -> Path:
    """The output folder as another program unpacks it."""
    shutil.copytree(out, into, ignore=shutil.ignore_patterns("*.tar", ".ffseg"))
    for path in out.glob("*.tar"):
        done = subprocess.run(["tar", "-xf", path, "-C", into], check=True, capture_output=True, text=True)
        assert done.stderr == ""
    return into


def packs(out: Path) -> list[str]:
    return sorted(str(path.relative_to(out)) for path in out.rglob("packs/*"))


@pytest.mark.parametrize("jobs", [1, 2])
def test_unpacked_they_are_what_a_run_without_writes(jobs: int, images: Path, tmp_path: Path) -> None:
    run_batch(images, tmp_path / "files", products=FILES, executor=INPROCESS)
    summary = run_batch(images, tmp_path / "out", products=PACKED, num_workers=jobs)
    assert (summary.done, summary.failed, summary.problems) == (13, 1, [])
    assert (sorted(tars(tmp_path / "out")), packs(tmp_path / "out")) == (sorted(f"{kind}.tar" for kind in KINDS), [])
    assert not list((tmp_path / "out").glob("masks/**"))
    assert tree(unpacked(tmp_path / "out", tmp_path / "again")) == tree(tmp_path / "files")
    with tarfile.open(tmp_path / "out" / "masks.tar") as archive:
        rows = [row["image"] for row in table(tmp_path / "out" / "timings.csv") if row["status"] == "ok"]
        assert archive.getnames() == [f"masks/{name}" for name in rows], "in the order of the tables"


def test_the_bytes_do_not_depend_on_how_the_work_was_shared_out(images: Path, tmp_path: Path) -> None:
    expected = straight(images, tmp_path / "one")
    run_batch(images, tmp_path / "two", products=PACKED, num_workers=2)
    assert tars(tmp_path / "two") == expected
    for count in (1, 2, 3):
        out = tmp_path / f"in {count}"
        for number in range(count, 0, -1):
            run_shard(images, out, f"{number}/{count}")
            assert tars(out) == {}
        assert (merge_shards(str(out)).problems, tars(out)) == ([], expected)
        assert (out / "coco.json").read_bytes() == (tmp_path / "one" / "coco.json").read_bytes()
        assert packs(out) == []


def test_what_lies_on_a_disk_that_is_away_keeps_its_members(images: Path, tmp_path: Path, out: Path) -> None:
    """The tar files lost them, and nothing named the images."""
    make_images(tmp_path / "others", ["x.png"])
    run_packed(images, out)
    images.rename(tmp_path / "away")
    assert run_packed(tmp_path / "others", out).stale == len(NAMES) - 1
    with tarfile.open(out / "masks.tar") as archive:
        assert len(archive.getnames()) == len(NAMES)


def test_a_second_run_does_what_is_missing_or_stale(images: Path, tmp_path: Path, out: Path) -> None:
    run_packed(images, out)
    before = {path.name: path.stat().st_mtime_ns for path in out.glob("*.tar")}
    again = run_batch(images, out, products=PACKED, num_workers=2)
    assert (again.done, again.unchanged) == (0, 13)
    assert {path.name: path.stat().st_mtime_ns for path in out.glob("*.tar")} == before, "nothing is written again"
    make_images(images, [NAMES[0]], {NAMES[0]: 9})
    (images / NAMES[3]).unlink()
    make_images(images, ["later.png"])
    changed = run_packed(images, out)
    assert (changed.done, changed.unchanged) == (2, 12)
    assert tars(out) == straight(images, tmp_path / "fresh")


@pytest.mark.parametrize("damage", ["changed", "header", "cut"])
def test_damaged_tar_files_are_made_again(damage: str, images: Path, out: Path) -> None:
    run_packed(images, out)
    expected, path = tars(out), out / "masks.tar"
    with tarfile.open(path) as archive:
        place = archive.getmembers()[7].offset_data
    data = bytearray(path.read_bytes())
    data[place - 400 if damage == "header" else place + 3] ^= 1
    path.write_bytes(data[: place + 3] if damage == "cut" else data)
    again = run_packed(images, out)
    assert (again.done, tars(out)) == ({"changed": 1, "header": 1, "cut": 6}[damage], expected)


KILLED = """
import os, sys
sys.path[:0] = {path!r}
os.fsync = lambda _: None
from pathlib import Path
from test_packing import run_packed, run_shard
import {module} as module
owner = {owner}
real, left = getattr(owner, {name!r}), [{count}]
def dying(*arguments, **options):
    left[0] -= 1
    if not left[0] and {before}:
        os.kill(os.getpid(), 9)
    found = real(*arguments, **options)
    if not left[0]:
        os.kill(os.getpid(), 9)
    return found
setattr(owner, {name!r}, dying)
images, out = Path(sys.argv[1]), Path(sys.argv[2])
if {shard!r}:
    run_shard(images, out, {shard!r})
else:
    run_packed(images, out)
"""


def kill(images: Path, out: Path, where: tuple[str, str, str], count: int, *, before: bool, shard: str = "") -> None:
    """Run until something is called for the so-manieth time, and kill the run just before or after that."""
    module, owner, name = where
    path = [str(Path(__file__).parent), str(Path(__file__).parents[1])]
    code = KILLED.format(path=path, module=module, owner=owner, name=name, count=count, before=before, shard=shard)
    killed = subprocess.run([sys.executable, "-c", code, images, out], check=False, capture_output=True, timeout=600)
    assert killed.returncode == -signal.SIGKILL, killed.stderr.decode()


APPEND = ("ffseg.batch.tar.writer", "module.PackWriter", "append")
ADD = ("ffseg.batch.record.journal", "module.Journal", "add")
REPLACE = ("os", "module", "replace")
COMPLETE = ("ffseg.batch.record.ordered", "module.OrderedPacks", "complete")


@pytest.mark.parametrize(
    ("where", "count", "before", "redone"),
    [
        (APPEND, 4, False, 11),  # the second image fails: two are done
        (ADD, 4, False, 10),
        (COMPLETE, 1, True, 0),
        (REPLACE, 4, False, 0),  # one of five has its name
    ],
)
def test_a_killed_run_goes_on(
    where: tuple[str, str, str], count: int, before: bool, redone: int, images: Path, tmp_path: Path, out: Path
) -> None:
    kill(images, out, where, count, before=before)
    for path in out.glob("*.tar"):
        subprocess.run(["tar", "-tf", path], check=True, capture_output=True)
    rest = run_packed(images, out)
    assert (rest.done, tars(out)) == (redone, straight(images, tmp_path / "one"))
    assert packs(out) == []


def test_a_tail_that_was_not_finished_is_nobodys(images: Path, tmp_path: Path, out: Path) -> None:
    kill(images, out, ADD, 6, before=False)
    (pack,) = packs(out)
    subprocess.run(["tar", "-tf", out / pack], check=True, capture_output=True)
    known = last_records(str(out / ".ffseg"))
    members = {Path(name).with_suffix(".geojson"): record.members for name, record in known.items() if record.members}
    last = max(written[f"geojson/{name}"][1] for name, written in members.items())
    os.truncate(out / pack, last + 5)
    assert run_packed(images, out).done == 13 - 5 + 1, "the one that was cut is done again"
    assert tars(out) == straight(images, tmp_path / "one")


def test_killed_shards_and_merges_go_on(images: Path, tmp_path: Path, out: Path) -> None:
    run_packed(images, tmp_path / "one")
    kill(images, out, ADD, 3, before=False, shard="2/2")
    run_shard(images, out, "1/2")
    early = merge_shards(str(out))
    assert early.problems == ["shard 2/2 did not finish; run it again with --shard 2/2"]
    some = tars(out)
    assert 0 < len(some["masks.tar"]) < len(tars(tmp_path / "one")["masks.tar"])
    run_shard(images, out, "2/2")
    assert (tars(out), merge_shards(str(out)).problems) == (some, [])
    assert tars(out) == tars(tmp_path / "one")
    plan = shard_plan(make_plan([str(images)], str(out), products=PACKED), Shard(1, 2))
    setup = Setup(params=load_params(), segmenter=stand_in.NAME, products=PACKED)
    seen = [one.status for one in preview(plan, setup, Options())]
    assert len(seen) > 2 >= seen.count("to do") + 1, "what a merge has moved is found; one image fails"
    run_shard(images, out, "1/2")
    assert json.loads((out / ".ffseg" / "shards" / "1-of-2" / "run.json").read_text())["counts"]["done"] == 0
    make_images(images, [NAMES[0]], {NAMES[0]: 9})
    for number in (1, 2):
        run_shard(images, out, f"{number}/2")
    assert merge_shards(str(out)).problems == []
    run_packed(images, tmp_path / "two")
    assert tars(out) == tars(tmp_path / "two") != tars(tmp_path / "one")
    whole = run_packed(images, out)
    assert (whole.done, whole.unchanged) == (0, 13)
    assert (merge_shards(str(out)).problems, tars(out)) == ([], tars(tmp_path / "two"))


def test_a_run_over_other_images_finds_what_a_merge_has_moved(images: Path, tmp_path: Path, out: Path) -> None:
    make_images(tmp_path / "others", ["x.png"])
    for folder, part in product((images, tmp_path / "others"), ("1/2", "2/2")):
        run_shard(folder, out, part)
        merge_shards(str(out))
    records = [one for number in (1, 2) for one in last_records(state_folder(str(out), f"{number}-of-2")).values()]
    assert (len(records), {one.stale for one in records}) == (len(NAMES) + 1, {""})


def test_an_output_that_is_lost_is_named_by_the_merge(images: Path, tmp_path: Path, out: Path) -> None:
    for number in (1, 2):
        run_shard(images, out, f"{number}/2")
    (pack,) = [name for name in packs(out) if "1-of-2" in name]
    os.truncate(out / pack, (out / pack).stat().st_size // 2)
    problems = merge_shards(str(out)).problems
    assert problems
    assert all("is not what was written; run its shard again" in problem for problem in problems)
    run_shard(images, out, "1/2")
    assert (merge_shards(str(out)).problems, tars(out)) == ([], straight(images, tmp_path / "one"))


def test_files_and_members_are_not_mixed(images: Path, tmp_path: Path, out: Path) -> None:
    run_packed(images, out)
    with pytest.raises(UsageError, match="holds outputs in tar files; add --pack tar"):
        run_batch(images, out, products=FILES, executor=INPROCESS)
    run_batch(images, out, products=FILES, overwrite=True, executor=INPROCESS)
    assert tars(out) == {}
    run_batch(images, tmp_path / "files", products=FILES, executor=INPROCESS)
    assert tree(out) == tree(tmp_path / "files")
    with pytest.raises(UsageError, match="holds outputs in files of their own; leave out --pack"):
        run_packed(images, out)
    run_batch(images, out, products=PACKED, overwrite=True, executor=INPROCESS)
    assert not [path for path in out.rglob("masks/**/*") if path.is_file()]
    run_shard(images, tmp_path / "parts", "1/2")
    run_shard(images, tmp_path / "parts", "2/2", products=FILES)
    with pytest.raises(UsageError, match="one was run with --pack"):
        merge_shards(str(tmp_path / "parts"))
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "masks.tar").write_bytes(b"mine")
    with pytest.raises(UsageError, match="no run made it"):
        run_batch(images, tmp_path / "other", products=PACKED, executor=INPROCESS)


def test_a_packed_output_is_an_input(images: Path, tmp_path: Path, out: Path) -> None:
    run_packed(images, out)
    assert run_batch(out / "masks.tar", tmp_path / "next", products=PACKED, executor=INPROCESS).done == 13
    with tarfile.open(tmp_path / "next" / "masks.tar") as archive:
        assert archive.getnames()[0] == "masks/masks/0/i0.png"
    with pytest.raises(UsageError, match="would replace an input"):
        run_batch(out / "masks.tar", out, products=PACKED, executor=INPROCESS, overwrite=True)


@pytest.mark.parametrize(
    "name", ["a.png", "ä" * 40, "d/" * 60 + "x" * 130, "n\udcff.png", "x" * 99, "x" * 100, "x" * 101]
)
def test_names_of_any_bytes_and_length(name: str, tmp_path: Path) -> None:
    top = head(name, 3)
    assert len(top) == head_size(name)
    data = top + b"abc" + bytes(509) + bytes(1024)
    with tarfile.open(fileobj=io.BytesIO(data), encoding="utf-8", errors="surrogateescape") as archive:
        (member,) = archive.getmembers()
        assert (member.name, member.size, member.offset_data) == (name, 3, len(top))
    (tmp_path / "a.tar").write_bytes(data)
    listing = ["tar", "-tf", tmp_path / "a.tar", "--quoting-style=literal"]
    assert subprocess.run(listing, check=True, capture_output=True).stdout == os.fsencode(name) + b"\n"


@pytest.mark.parametrize("call", ["open", "write", "fsync"])
def test_an_append_that_fails_is_not_seen(call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = PackWriter(str(tmp_path), "p.tar")
    places = {} if call == "open" else writer.append([("masks/a.png", b"first")])

    def full(*_: object) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, call, full)
        with pytest.raises(OutputError, match=r"p\.tar cannot be written \(No space left on device\); free some space"):
            writer.append([("masks/b.png", b"second")])
    places |= writer.append([("masks/c.png", b"third")])
    writer.close()
    found = {path: output_bytes(str(tmp_path), path, member) for path, member in places.items()}
    expected = {"masks/a.png": b"first", "masks/c.png": b"third"}
    assert found == {path: expected[path] for path in places}
    with tarfile.open(tmp_path / "p.tar") as archive:
        assert archive.getnames() == list(places)


def test_late_full_disks_cost_nothing(images: Path, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OutputError("masks.tar cannot be written (No space left on device); free some space")

    with monkeypatch.context() as patch:
        patch.setattr(OrderedPacks, "complete", full)
        summary = run_packed(images, out)
    assert "masks.tar cannot be written" in summary.problems[0]
    assert (tars(out), len(packs(out))) == ({}, 1)
    again = run_packed(images, out)
    assert (again.done, again.unchanged, again.problems) == (0, 13, [])
    assert tars(out) == straight(images, tmp_path / "one")


def test_a_run_that_is_stopped_has_its_outputs_still(images: Path, tmp_path: Path, out: Path) -> None:
    first = run_packed(images, out, observer=Silent(last=5))
    assert (first.signal, tars(out)) == (15, {})
    assert run_packed(images, out, observer=Silent(last=14)).signal == 15
    again = run_packed(images, out)
    assert (again.done, again.unchanged) == (0, 13)
    assert tars(out) == straight(images, tmp_path / "one")


def test_a_report_shows_what_is_packed(images: Path, tmp_path: Path) -> None:
    pages = {}
    for name, products in (("files", FILES), ("packed", PACKED)):
        run_batch(images, tmp_path / name, products=products, executor=INPROCESS)
        pages[name] = data_of(write_report(tmp_path / name))["images"]
    assert len(pages["files"]) == 14
    for file, member in zip(pages["files"], pages["packed"], strict=True):
        same = ("name", "contours", "thumbnail")
        assert [file.get(key) for key in same] == [member.get(key) for key in same]
        assert member["contours"] or member["rows"][0]["status"] == "failed"
        assert "mask" not in member["pictures"], "a page cannot link into a tar file"


@pytest.mark.parametrize("pack", [(), ("--pack", "tar")])
def test_an_empty_output_is_made_once(pack: tuple[str, ...], tmp_path: Path, ffseg_command: Command) -> None:
    write_image(tmp_path / "in" / "tiny.png", np.zeros((1, 1), np.uint8))
    run = ("run", tmp_path / "in", "--out", tmp_path / "out", "--export", "yolo", *pack, "--json")
    counts = [json.loads(ffseg_command(*run).stdout)["counts"] for _ in range(2)]
    assert [(one["done"], one["unchanged"]) for one in counts] == [(1, 0), (0, 1)]
    lost = "yolo.tar" if pack else "yolo/tiny.txt"
    (tmp_path / "out" / lost).unlink()
    assert json.loads(ffseg_command(*run).stdout)["counts"]["done"] == 1
    assert (tmp_path / "out" / lost).is_file()
