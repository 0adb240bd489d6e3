"""The journal keeps whole lines only, and the lock dies with its process."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ffseg.batch.journal import Journal, Record, read_header
from ffseg.batch.lock import OutputLock
from ffseg.errors import OutputError, UsageError

NAMES = ["a.png", os.fsdecode(b"\xff.png"), "c\n.png"]


def _record(name: str, content: str = "1") -> Record:
    return Record(name, "ok", "0.1", content, {"masks/a.png": "d"}, {"status": "ok", "error": ""})


def _journal(out: Path, *, keep: bool = True) -> Journal:
    (out / ".ffseg").mkdir(exist_ok=True)
    return Journal(str(out), {"parameters": {"x": 1}}, NAMES, keep=keep)


def test_records_come_back_in_a_later_run(tmp_path: Path) -> None:
    first = _journal(tmp_path)
    for index, name in enumerate(NAMES):
        first.add(index, _record(name))
    first.add(0, _record(NAMES[0], "2"))
    first.close()
    second = _journal(tmp_path)
    assert [second.get(index) for index in range(3)] == [_record(NAMES[0], "2"), _record(NAMES[1]), _record(NAMES[2])]
    second.close()
    header = read_header(str(tmp_path))
    assert header is not None
    assert header["parameters"] == {"x": 1}


def test_records_are_dropped_when_all_is_done_again(tmp_path: Path) -> None:
    first = _journal(tmp_path)
    first.add(0, _record(NAMES[0]))
    first.close()
    second = _journal(tmp_path, keep=False)
    assert second.get(0) is None
    second.close()


def test_every_cut_of_the_file_keeps_the_whole_lines(tmp_path: Path) -> None:
    journal = _journal(tmp_path)
    journal.add(0, _record(NAMES[0]))
    journal.add(1, _record(NAMES[1]))
    journal.close()
    path = tmp_path / ".ffseg" / "journal.jsonl"
    data = path.read_bytes()
    ends = [index + 1 for index, byte in enumerate(data) if byte == ord("\n")]
    for length in range(len(data) + 1):
        path.write_bytes(data[:length])
        journal = _journal(tmp_path)
        found = [journal.get(index) is not None for index in range(3)]
        journal.close()
        assert found == [length >= ends[1], length >= ends[2], False], length


def test_full_disk_leaves_whole_lines_and_keeps_the_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = _journal(tmp_path)
    journal.add(0, _record(NAMES[0]))
    real = os.write
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", lambda descriptor, data: real(descriptor, data[:20]))
        with pytest.raises(OutputError, match="journal"):
            journal.add(1, _record(NAMES[1]))
    journal.add(2, _record(NAMES[2]))
    assert [journal.get(index) for index in range(3)] == [_record(name) for name in NAMES]
    journal.close()
    again = _journal(tmp_path)
    assert [again.get(index) is not None for index in range(3)] == [True, False, True]
    again.close()


def test_failing_write_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = _journal(tmp_path)

    def fail(*_: object) -> int:
        raise OSError(errno.EIO, "Input/output error")

    with monkeypatch.context() as patch:
        patch.setattr(os, "write", fail)
        with pytest.raises(OutputError, match="Input/output error"):
            journal.add(0, _record(NAMES[0]))
    journal.close()


HOLD = """
import sys, time
from ffseg.batch.lock import OutputLock
with OutputLock(sys.argv[1]):
    print("held", flush=True)
    time.sleep(60)
"""


def test_lock_is_held_by_one_process_and_dies_with_it(tmp_path: Path) -> None:
    holder = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE)
    assert holder.stdout is not None
    assert holder.stdout.readline() == b"held\n"
    with pytest.raises(UsageError, match="another ffseg run"), OutputLock(str(tmp_path)):
        pass
    holder.kill()
    holder.wait()
    holder.stdout.close()
    with OutputLock(str(tmp_path)):
        pass
