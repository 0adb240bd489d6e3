"""What people read: ruled and coloured on a terminal, plain text everywhere else."""

import io
import os
import pty
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from ffseg.cli import console
from ffseg.cli.reporting import ProgressBar

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
RED = "\x1b[1;31m"


def on_a_terminal(*arguments: str | Path, term: str = "xterm") -> tuple[int, str]:
    """Exit code of a command run on a terminal of its own, and all it wrote there."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.environ.update(TERM=term, COLUMNS="100")
        os.environ.pop("NO_COLOR", None)
        os.execv(sys.executable, [sys.executable, "-m", "ffseg", *map(str, arguments)])  # noqa: S606 - this Python
    said = b""
    while True:
        try:
            piece = os.read(terminal, 4096)
        except OSError:  # how Linux tells that the other end is closed
            break
        if not piece:
            break
        said += piece
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), said.decode("utf-8")


def test_an_error_begins_red_on_a_terminal() -> None:
    code, said = on_a_terminal("config", "show", "nowhere.yaml")
    assert code == 2
    assert f"{RED}ffseg: error: \x1b[0mnowhere.yaml" in said
    assert RED not in on_a_terminal("config", "show", "nowhere.yaml", term="dumb")[1]


def test_tables_are_ruled_on_a_terminal(tmp_path: Path) -> None:
    code, said = on_a_terminal(
        "compare", SAMPLES / "toy.png", "--out", tmp_path / "out", "--methods", "freeform,cv_edges"
    )
    assert code == 0
    assert "──" in said
    assert "freeform (FF)" in said
    assert "every image: " in said


def test_names_from_outside_are_escaped_on_a_terminal(tmp_path: Path) -> None:
    code, said = on_a_terminal("run", tmp_path / "a\x1b[31mb[bold].png", "--out", tmp_path / "out")
    assert code == 2
    assert "\x1b[31mb" not in said
    assert "b[bold].png" in said  # neither a control sequence nor markup of the library


def test_columns_elsewhere(capsys: pytest.CaptureFixture[str]) -> None:
    console.table(["method", "ms"], [["freeform", "1.5"], ["a", "100.0"]])
    console.summary([("images", "3"), ("ms", "1")])
    console.markdown("# A\n\n| b |")
    lines = "method       ms\nfreeform    1.5\na         100.0\nimages  3\nms      1\n# A\n\n| b |\n"
    assert capsys.readouterr() == (lines, "")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_notes_are_counted_in_the_bar_and_listed_below_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each tore the bar: 38 lines in a run of 300."""
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    progress = ProgressBar(3, bar=True, verbose=False)
    for status, told in (("ok", "a note"), ("failed", "internal: x\ny"), ("ok", "")):
        progress.finished(cast(Any, SimpleNamespace(source=SimpleNamespace(display_path="a.png"))), status, told)
    assert "a.png" not in screen.getvalue()
    progress.close()
    progress.close()
    bar, below = screen.getvalue().rsplit("\r", 1)[-1].split("\n", 1)
    assert "1 failed, 1 with notes" in bar
    assert below == "ffseg: a.png: a note\nffseg: a.png: internal: x y\n"
