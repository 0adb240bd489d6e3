"""`ffseg run` as users start it: exit codes, sentences, effects on disk, and the promises R1-R10 and R12 in short form."""

import errno
import json
import os
import resource
import signal
import subprocess
from pathlib import Path
from typing import Any

import bad_images
import numpy as np
import pytest
from batches import table
from commands import Command
from PIL import Image

from tests.campaigns import bad_files, faults, full_disk, harness, killed, many, same_bytes, signals

SMALL = ("--set", harness.CONFIG)


@pytest.fixture
def blobs(tmp_path: Path) -> Path:
    harness.draw_blobs(tmp_path / "in", 6)
    return tmp_path / "in"


def test_run_writes_what_the_contract_names(blobs: Path, out: Path, ffseg_process: Command) -> None:
    done = ffseg_process("run", blobs, "--out", out, "--overlay", "--json", *SMALL)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["counts"] == {"total": 6, "done": 6, "unchanged": 0, "failed": 0, "stale": 0}
    assert [row["image"] for row in document["images"]] == [f"i{index}.png" for index in range(6)]
    found = sorted(str(path.relative_to(out)) for path in out.rglob("*.*") if path.is_file())
    names = [f"{kind}/i{i}{end}" for i in range(6) for kind, end in (*harness.KINDS, ("overlays", ".png"))]
    assert found == sorted([*names, ".ffseg/journal.jsonl", "run.json", "timings.csv"])


def test_r1_every_bad_file_is_a_row_with_a_known_reason(tmp_path: Path) -> None:
    source, out = tmp_path / "in", tmp_path / "out"
    cases = bad_images.all_cases()
    for case in cases:
        place = source / case.name.replace(".", "_")
        place.mkdir(parents=True)
        (place / case.name).write_bytes(case.data)
    ended = harness.run("run", source, "--out", out, "--set", "init.radius=8", "--jobs", "2")
    assert ended.code == 3
    assert "Traceback" not in ended.stderr
    rows = {row["image"].rsplit("/", 1)[1]: row for row in table(out / "timings.csv")}
    assert set(rows) == {case.name for case in cases}
    for case in cases:
        reason = rows[case.name]["error"].split(":")[0]
        assert reason in case.reasons if case.pixels is None else reason in ("", "segmentation"), (case.name, reason)


def test_r2_each_bomb_alone_is_refused_in_50_ms_and_100_mb(tmp_path: Path) -> None:
    for case in bad_images.bombs():
        (tmp_path / case.name).write_bytes(case.data)
    figures = bad_files.Figures()
    for path in sorted(tmp_path.iterdir()):
        bad_files.read_alone(path, figures)
    assert (figures.wrong, figures.read) == ([], 0)
    assert figures.largest_mb[0] < 100, figures.largest_mb
    assert figures.slowest_ms[0] < 50 * 10, figures.slowest_ms  # of processor time; the long form holds the 50 ms


def test_r3_pipes_loops_and_odd_names_cost_only_their_row(blobs: Path, tmp_path: Path) -> None:
    os.mkfifo(blobs / "pipe.png")
    (blobs / "loop.png").symlink_to(blobs / "loop.png")
    (blobs / "gone.png").symlink_to(blobs / "nowhere")
    (blobs / "zero.png").symlink_to("/dev/zero")
    image = (blobs / "i0.png").read_bytes()
    not_utf8, longest, too_long = os.fsdecode(b"\xff\xfe.png"), "n" * 251 + ".png", "x" * 252 + ".gf"
    for name in ("a\nb.png", "\U0001f600.png", "-rf.png", not_utf8, longest, too_long):
        (blobs / name).write_bytes(image)
    ended = harness.run("run", blobs, blobs / too_long, "--out", tmp_path / "out", *SMALL)
    assert (ended.code, "\n".join(ended.stderr.splitlines()) + "\n") == (3, ended.stderr)
    rows = table(tmp_path / "out" / "timings.csv")
    assert {row["image"]: row["error"].split(":")[0] for row in rows if row["error"]} == {
        "pipe.png": "not-a-file", "loop.png": "link-loop", "gone.png": "missing", "zero.png": "not-a-file",
        too_long: "bad-name",
    }  # fmt: skip
    done = {row["image"] for row in rows if row["status"] == "ok"}
    assert {"a\\u000ab.png", "\U0001f600.png", "'-rf.png", "\\xff\\xfe.png", longest} <= done
    assert (tmp_path / "out" / "masks" / not_utf8).exists()


def test_r4_killed_runs_resume_to_the_same_bytes(tmp_path: Path) -> None:
    figures = killed.campaign(tmp_path, kills=4, jobs=2, images=60)
    assert (figures.partial, figures.resumed_differ, figures.left_over, figures.orphans) == (0, 0, 0, 0)
    assert figures.most_redone <= 2


@pytest.mark.parametrize("how", [{"jobs": 2, "pack": True}, {"jobs": 1, "film": True}], ids=["packed", "film"])
def test_r4_killed_packed_runs_and_films_resume_to_the_same_bytes(how: dict[str, Any], tmp_path: Path) -> None:
    figures = killed.campaign(tmp_path, kills=2, images=60, **how)
    assert (figures.partial, figures.resumed_differ, figures.left_over, figures.orphans) == (0, 0, 0, 0)


CALLS = [("open", 5, False), ("write", 4, False), ("fsync", 3, False), ("rename", 4, False)]


@pytest.mark.parametrize(("call", "number", "pack"), [*CALLS, ("write", 6, True), ("rename", 4, True)])
def test_r5_failing_calls_keep_outputs_and_name_the_path(call: str, number: int, pack: bool, tmp_path: Path) -> None:
    if os.uname().sysname != "Linux":
        pytest.skip("the faulty calls are put in with LD_PRELOAD")
    figures = faults.campaign(tmp_path, "ENOSPC", images=1, call=call, number=number, pack=pack)
    assert (figures.wrong, figures.runs) == ([], 1)


@pytest.mark.parametrize("pack", [False, True])
def test_r6_small_disks_leave_whole_files_only(pack: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mount = ["unshare", "-rm", "mount", "-t", "tmpfs", "tmpfs", tmp_path]
    if os.uname().sysname != "Linux" or subprocess.run(mount, check=False).returncode != 0:
        pytest.skip("a tmpfs cannot be mounted in a namespace here")
    monkeypatch.setattr(full_disk, "DISKS_KB", (16, 96))
    monkeypatch.setattr(full_disk, "FILE_LIMITS", (1,))
    figures = full_disk.campaign(tmp_path, pack=pack)
    assert figures.wrong == []
    assert figures.exit_codes[2] >= 1
    assert figures.exit_codes[3] >= 1


def test_r6_file_size_limit_fails_rows_by_name_and_leaves_no_temporary(blobs: Path, tmp_path: Path) -> None:
    faint = np.random.default_rng(0).integers(90, 93, (900, 1200, 3), dtype=np.uint8)  # no edge, but hard to pack
    Image.fromarray(faint).save(blobs / "large.png")

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 17, 1 << 17))

    command = harness.command("run", blobs, "--out", tmp_path / "out", "--overlay", *SMALL)
    done = subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=limit)
    rows = {row["image"]: row["error"] for row in table(tmp_path / "out" / "timings.csv")}
    assert done.returncode == 3
    assert rows.pop("large.png").startswith("output: ")
    assert set(rows.values()) == {""}
    assert os.strerror(errno.EFBIG) in done.stderr
    assert harness.temporaries(tmp_path / "out") == []


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_r7_signals_end_the_run_whatever_its_images_do_without_orphans(number: int, code: int, tmp_path: Path) -> None:
    endless = harness.endless(tmp_path)
    with (tmp_path / "said").open("wb") as said:
        process = harness.start(*endless, stderr=said)
    harness.until_written(tmp_path / "out")
    second = harness.run(*endless, env=harness.TESTS)
    assert harness.kill(process, number) == code
    assert harness.group_is_gone(process)
    assert (tmp_path / "said").read_text("utf-8").endswith("ffseg: interrupted; run it again to go on\n")
    assert second.code == 2
    assert "another ffseg run" in second.stderr
    assert harness.temporaries(tmp_path / "out") == []
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "interrupted"


def test_r7_and_r8_stops_and_deaths_at_random_moments(tmp_path: Path) -> None:
    figures = signals.campaign(tmp_path, stops=2, deaths=2, images=120)
    assert figures.wrong == []
    assert (figures.stops, figures.deaths) == (2, 2)


def test_r9_long_form_compares_every_variant(tmp_path: Path) -> None:
    figures = same_bytes.campaign(tmp_path, images=4)
    assert (figures.differ, figures.files) == ([], 3 * 4)
    assert figures.variants == len(same_bytes.VARIANTS)


def test_r10_memory_of_a_run_stays(tmp_path: Path) -> None:
    figures = many.campaign(tmp_path, images=500, jobs=1, first=150)
    assert figures.code == 0
    assert figures.early_mb > 20
    assert figures.late_mb > 20
    # Pools still fill while the first hundreds are done: one image of 48x64 kept each time would be 9 kB, 3 MB in all.
    # The long form holds 5 % after 500.
    assert figures.growth <= 0.10


def test_r12_names_are_escaped_on_the_terminal_and_in_the_table(blobs: Path, tmp_path: Path) -> None:
    for name in ("\x1b[31mred.png", "=cmd.png", "\u202egnp.png"):
        (blobs / name).write_bytes(b"not an image")
    ended = harness.run("run", blobs, "--out", tmp_path / "out", *SMALL)
    text = (tmp_path / "out" / "timings.csv").read_text(encoding="utf-8")
    assert ended.code == 3
    for hostile in ("\x1b", "\u202e"):
        assert hostile not in ended.stderr + text
    assert "\n'=cmd.png,failed," in text
