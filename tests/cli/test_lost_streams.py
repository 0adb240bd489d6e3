"""A terminal, a reader or a disk behind a stream that goes away: the work and the exit code stay what they are."""

import os
import pty
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.campaigns import harness

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
ROOT = Path(__file__).resolve().parents[2]
FFSEG = f"{sys.executable} -m ffseg"
LOST = {
    "stderr full": "2>/dev/full",
    "stderr closed": "2>&-",
    "stdout full": ">/dev/full",
    "stdout closed": ">&-",
    "all closed": "<&- >&- 2>&-",
    "a reader of messages that leaves": "-v 2>&1 | head -1",
    "a reader of data that leaves": "--json | head -1",
}


def shell(text: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a pipe; its exit code is that of the first command."""
    command = ["bash", "-c", f"{text}; exit ${{PIPESTATUS[0]}}"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    (tmp_path / "photos").mkdir()
    for name in "abcd":
        shutil.copyfile(ROOT / "samples" / "toy.png", tmp_path / "photos" / f"{name}.png")
    (tmp_path / "photos" / "bad.png").write_bytes(b"")
    return tmp_path


@pytest.mark.parametrize("lost", LOST.values(), ids=LOST)
def test_a_lost_stream_changes_nothing(lost: str, photos: Path) -> None:
    done = shell(f"{FFSEG} run photos --out out {lost}", photos)
    assert done.returncode == 3, done.stderr  # of the empty file, as ever
    assert sorted(path.name for path in (photos / "out" / "masks").iterdir()) == [f"{name}.png" for name in "abcd"]
    assert (photos / "out" / "timings.csv").read_text("utf-8").count("\n") == 6
    assert "Traceback" not in done.stderr


def test_nothing_is_written_into_files_that_took_the_number_of_a_closed_stream(photos: Path) -> None:
    shell(f"{FFSEG} run photos --out out -v 2>&- >&-", photos)
    written = [path for path in (photos / "out").rglob("*") if path.is_file()]
    assert len(written) > 8
    for path in written:
        assert b"ffseg: " not in path.read_bytes(), path


def test_a_usage_error_stays_one(photos: Path) -> None:
    for lost in ("2>/dev/full", "2>&-", ">&- 2>&-"):
        assert shell(f"{FFSEG} run nowhere --out out {lost}", photos).returncode == 2
        assert shell(f"{FFSEG} nothing {lost}", photos).returncode == 2


def test_data_lost_on_a_full_disk_is_said(photos: Path) -> None:
    done = shell(f"{FFSEG} config show > /dev/full", photos)
    assert done.returncode == 0
    assert "stdout could not be written (No space left on device)" in done.stderr
    assert shell(f"{FFSEG} config show | head -1", photos).stderr == ""  # the reader has what it wanted


def test_data_that_a_closed_stdout_loses_is_said(photos: Path) -> None:
    """`segment` ended with 0 though its mask had gone nowhere."""
    for command, code in (("config list", 0), ("segment photos/a.png -", 3)):
        done = shell(f"{FFSEG} {command} >&-", photos)
        assert done.returncode == code
        assert "stdout could not be written (Bad file descriptor)" in done.stderr


def test_a_closed_stdin_is_an_empty_one(photos: Path) -> None:
    said = {"run - --out -": "holds no Y4M", "run --list - --out out": "names no image", "segment - a.png": "is empty"}
    for command, sentence in said.items():
        assert sentence in shell(f"{FFSEG} {command} <&- | cat", photos).stderr, command


def test_frames_that_go_nowhere_fail(photos: Path) -> None:
    for lost, why in ((">&-", "Bad file descriptor"), (">/dev/full", "No space left on device")):
        done = shell(f"{FFSEG} run - --raw 9x9:gray --out - < photos/a.png {lost}", photos)
        assert (done.returncode, f"stdout cannot be written ({why})" in done.stderr) == (3, True), done.stderr


def test_a_folder_that_has_been_removed_is_said(tmp_path: Path) -> None:
    done = shell(f"mkdir gone; cd gone; rmdir ../gone; {FFSEG} run {ROOT / 'samples'} --out out", tmp_path)
    said = "ffseg: error: the folder you are in has been removed; change to another\n"
    assert (done.returncode, done.stderr) == (2, said)


def test_a_terminal_that_goes_ends_the_run_in_order(tmp_path: Path) -> None:
    command, out = harness.command(*harness.endless(tmp_path)), tmp_path / "out"
    pid, terminal = pty.fork()
    if pid == 0:
        os.execve(sys.executable, command, harness.TESTS)  # noqa: S606 - this Python, in a terminal of its own
    harness.until_written(out)
    os.close(terminal)  # the system sends SIGHUP to everything in it, workers too
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 128 + signal.SIGHUP
    rows = (out / "timings.csv").read_text("utf-8").splitlines()[1:]
    assert len(rows) == 12
    assert all(",ok," in row for row in rows)
    assert '"interrupted"' in (out / "run.json").read_text("utf-8")
