"""The journal keeps whole lines only, and the lock dies with its process."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ffseg.batch.plan.sources import order_key
from ffseg.batch.record.journal import Journal, read_header
from ffseg.batch.record.lock import OutputLock
from ffseg.batch.values import Record, json_line, record_line
from ffseg.errors import OutputError, UsageError

NAMES = ["a.png", os.fsdecode(b"\xff.png"), "c\n.png"]


def _record(name: str, content: str = "1") -> Record:
    return Record(
        name=name,
        status="ok",
        version="0.1",
        settings="s",
        content=content,
        outputs={"masks/a.png": ("d", (3, 4))},
        row={"status": "ok", "error": "", "width": 7, "note": None},
        extra=[{"component": 1}],
        files={"image": ("/in/a.png", "e", (5, 6))},
        order=order_key(0, name),
    )


def _journal(out: Path, *records: Record) -> Journal:
    (out / ".ffseg").mkdir(exist_ok=True)
    journal = Journal(str(out / ".ffseg"), {"parameters": {"x": 1}})
    for record in records:
        journal.add(record)
    return journal


def test_records_come_back_in_a_later_run(tmp_path: Path) -> None:
    _journal(tmp_path, *map(_record, NAMES), _record(NAMES[0], "2")).close()
    second = _journal(tmp_path)
    assert list(map(second.get, NAMES)) == [_record(NAMES[0], "2"), _record(NAMES[1]), _record(NAMES[2])]
    second.close()
    assert read_header(str(tmp_path / ".ffseg"))["parameters"] == {"x": 1}


def test_records_of_other_images_are_kept_until_they_are_dropped(tmp_path: Path) -> None:
    _journal(tmp_path, *map(_record, NAMES)).close()
    part = _journal(tmp_path)
    assert list(part.records(without=NAMES[1:2])) == [_record(NAMES[0]), _record(NAMES[2])]
    part.drop(_record(NAMES[0]))
    part.close()
    again = _journal(tmp_path)
    assert [again.get(name) is not None for name in NAMES] == [False, True, True]
    again.close()


_GOOD = record_line(_record("a.png"))


@pytest.mark.parametrize(
    "change",
    [
        {"more": 1},
        {"status": 3},
        {"status": "failed"},
        {"outputs": ["masks/a.png"]},
        {"outputs": {"masks/a.png": "d"}},
        {"outputs": {"masks/a.png": ["d", [1, 2.5]]}},
        {"outputs": {"masks/a.png": ["d", [1, True]]}},
        {"row": None},
        {"row": {"status": "ok"}},
        {"row": {"status": "ok", "error": "", "width": [1]}},
        {"extra": {"a": 1}},
        {"extra": [1]},
        {"files": {"image": ["a.png", "d"]}},
        {"name": None},
    ],
)
def test_records_of_another_shape_are_unknown(change: dict[str, object], tmp_path: Path) -> None:
    _journal(tmp_path).close()
    odd = {**json.loads(_GOOD), **change}
    with (tmp_path / ".ffseg" / "journal.jsonl").open("ab") as file:
        file.write(json_line({name: odd[name] for name in odd if odd[name] is not None}))
        file.write(b"[" * 100_000 + b"\n" + b"7\n" + b"\xff\xfe\n")
    journal = _journal(tmp_path)
    assert journal.get(NAMES[0]) is None
    journal.add(_record(NAMES[0]))
    assert journal.get(NAMES[0]) == _record(NAMES[0])
    journal.close()


@pytest.mark.parametrize("name", ["journal.jsonl", "lock"])
def test_a_pipe_in_the_place_of_a_file_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / ".ffseg").mkdir()
    os.mkfifo(tmp_path / ".ffseg" / name)
    with pytest.raises(UsageError, match=f"{name} is not a regular file"):
        _journal(tmp_path) if name.startswith("journal") else OutputLock(str(tmp_path)).__enter__()


@given(st.lists(st.text("a1²/0٣.\x01\x02", min_size=1), max_size=6))
def test_order_as_text_is_the_natural_order(names: list[str]) -> None:
    def pieces(name: str) -> list[list[tuple[bool, int, str]]]:
        parts = [enumerate(re.split("([0-9]+)", part)) for part in name.split("/")]
        return [[(bool(at % 2), int(text) if at % 2 else 0, text) for at, text in part] for part in parts]

    assert sorted(names, key=lambda name: order_key(0, name)) == sorted(names, key=pieces)
    assert len({order_key(0, name) for name in names}) == len(set(names))


def test_every_cut_of_the_file_keeps_the_whole_lines(tmp_path: Path) -> None:
    _journal(tmp_path, *map(_record, NAMES[:2])).close()
    path = tmp_path / ".ffseg" / "journal.jsonl"
    data = path.read_bytes()
    ends = [index + 1 for index, byte in enumerate(data) if byte == ord("\n")]
    for length in range(len(data) + 1):
        path.write_bytes(data[:length])
        journal = _journal(tmp_path)
        found = [journal.get(name) is not None for name in NAMES]
        journal.close()
        assert found == [length >= ends[1], length >= ends[2], False], length


def test_full_disk_leaves_whole_lines_and_keeps_the_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal, real = _journal(tmp_path, _record(NAMES[0])), os.write
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", lambda descriptor, data: real(descriptor, data[:20]))
        with pytest.raises(OutputError, match="journal"):
            journal.add(_record(NAMES[1]))
    journal.add(_record(NAMES[2]))
    assert list(map(journal.get, NAMES)) == [_record(name) for name in NAMES]
    journal.close()
    again = _journal(tmp_path)
    assert [again.get(name) is not None for name in NAMES] == [True, False, True]
    again.close()


HOLD = """
import sys, time
from ffseg.batch.record.lock import OutputLock
with OutputLock(sys.argv[1]):
    print("held", flush=True)
    time.sleep(60)
"""


def test_lock_is_held_by_one_process_and_dies_with_it(tmp_path: Path) -> None:
    holder = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE)
    assert holder.stdout.readline() == b"held\n"
    with pytest.raises(UsageError, match="another ffseg run"), OutputLock(str(tmp_path)):
        pass
    holder.kill()
    holder.wait()
    holder.stdout.close()
    with OutputLock(str(tmp_path)) as mine:
        with pytest.raises(UsageError, match="another ffseg run"), OutputLock(str(tmp_path)):
            pass  # not in one process either, and asking does not give it up
        busy = subprocess.run([sys.executable, "-c", HOLD, str(tmp_path)], capture_output=True, timeout=60, check=False)
        assert b"another ffseg run" in busy.stderr
    mine.__exit__()
    with OutputLock(str(tmp_path)):
        pass
