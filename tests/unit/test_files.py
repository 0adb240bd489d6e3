"""The atomic writer: whole or absent, the earlier file kept, the path named, no temporary left."""

import errno
import os
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from ffseg.errors import OutputError
from ffseg.io.files import printable, write_all_atomic, write_bytes_atomic

CALLS = ("open", "write", "fsync", "close", "replace")


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_writes_and_replaces(tmp_path: Path) -> None:
    for data in (b"one", b"two"):
        write_bytes_atomic(tmp_path / "a.bin", data)
        assert contents(tmp_path) == {"a.bin": data}


@pytest.mark.parametrize("link", [False, True])
def test_a_pipe_is_not_replaced(link: bool, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("pipe")
    target = tmp_path / ("link" if link else "pipe")
    with pytest.raises(OutputError, match="is a named pipe and is not replaced; choose another name"):
        write_all_atomic([(str(tmp_path / "a.bin"), b"one"), (str(target), b"two")])
    assert stat.S_ISFIFO(target.stat().st_mode)
    assert sorted(os.listdir(tmp_path)) == ["link", "pipe"]


def _failing(call: str, code: int) -> Callable[..., int]:
    real = getattr(os, call)

    def fail(*arguments: object, **options: object) -> int:
        if call == "close":
            real(*arguments, **options)
        raise OSError(code, os.strerror(code))

    return fail


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO, errno.EACCES])
@pytest.mark.parametrize("call", CALLS)
def test_failing_calls_keep_old_files(call: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_bytes_atomic(tmp_path / "a.bin", b"good")
    with monkeypatch.context() as patch:
        patch.setattr(os, call, _failing(call, code))
        with pytest.raises(OutputError, match=r"a\.bin"):
            write_bytes_atomic(tmp_path / "a.bin", b"newer")
    assert contents(tmp_path) == {"a.bin": b"good"}


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("failing", ["a.bin", "b.bin", "c.bin"])
@pytest.mark.parametrize("call", ["write", "fsync", "close"])
def test_a_group_is_named_once_all_is_on_disk(call: str, failing: str, code: int, tmp_path: Path, monkeypatch) -> None:
    names = ["a.bin", "b.bin", "c.bin"]
    write_all_atomic([(str(tmp_path / name), b"good") for name in names])
    real, real_write = getattr(os, call), os.write
    doomed: list[int] = []

    def write(descriptor: int, data: memoryview) -> int:
        if bytes(data) == failing.encode():
            doomed.append(descriptor)
        return fail(descriptor, data) if call == "write" else real_write(descriptor, data)

    def fail(descriptor: int, *arguments: object) -> int:
        if doomed == [descriptor]:
            doomed.clear()
            real(descriptor, *arguments)
            raise OSError(code, os.strerror(code))
        return real(descriptor, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(os, call, fail)
        patch.setattr(os, "write", write)
        with pytest.raises(OutputError, match=f"{failing}.*{os.strerror(code)}"):
            write_all_atomic([(str(tmp_path / name), name.encode()) for name in names])
    assert contents(tmp_path) == dict.fromkeys(names, b"good")
    write_all_atomic([(str(tmp_path / name), name.encode()) for name in names])
    assert contents(tmp_path) == {name: name.encode() for name in names}


def test_group_is_written_where_the_system_takes_no_hint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "posix_fadvise", _failing("posix_fadvise", errno.EINVAL))
    write_all_atomic([(str(tmp_path / name), name.encode()) for name in "abc"])
    assert contents(tmp_path) == {name: name.encode() for name in "abc"}


def test_group_without_files_is_written(tmp_path: Path) -> None:
    write_all_atomic([])
    assert os.listdir(tmp_path) == []


def test_short_writes_are_continued(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = os.write
    monkeypatch.setattr(os, "write", lambda fd, data: real(fd, bytes(data)[:7]))
    write_bytes_atomic(tmp_path / "a.bin", bytes(range(100)))
    monkeypatch.undo()
    assert contents(tmp_path) == {"a.bin": bytes(range(100))}


def test_name_that_fills_the_limit_can_be_written(tmp_path: Path) -> None:
    write_bytes_atomic(tmp_path / ("n" * 255), b"x")
    assert contents(tmp_path) == {"n" * 255: b"x"}


SHOWN = {
    "plain name.png": "plain name.png",
    "a\nb": "a\\u000ab",
    "back\\slash": "back\\\\slash",
    "caf\u00e9": "caf\u00e9",
    os.fsdecode(b"\xff.png"): "\\xff.png",
    "\u202egnp.exe": "\\u202egnp.exe",
    "\x1b[31m": "\\u001b[31m",
}


@pytest.mark.parametrize(("name", "shown"), SHOWN.items())
def test_printable(name: str, shown: str) -> None:
    assert (printable(name), printable(name).encode("utf-8").decode()) == (shown, shown)


@pytest.mark.parametrize(
    ("code", "remedy"),
    [(errno.ENOSPC, "free some space"), (errno.EMFILE, "ulimit -n"), (errno.EACCES, "check the folder")],
)
def test_the_remedy_is_of_the_reason(code: int, remedy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "open", _failing("open", code))
    with pytest.raises(OutputError, match=remedy):
        write_bytes_atomic(tmp_path / "a.bin", b"one")
