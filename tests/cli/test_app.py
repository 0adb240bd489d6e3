"""The command line shell: start-up, exit codes, errors in one line, completion."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from commands import Command

import ffseg
from ffseg import __version__
from ffseg.cli import app, console
from ffseg.errors import OutputError

HEAVY = ("numpy", "cv2", "yaml", "ffseg.native", "ffseg.parameters", "PIL", "pebble")
MAIN = "from ffseg.cli.app import main"
EMPTY = "import typer\nmain = typer.Typer()\n@main.command()\ndef f() -> None: ..."
MORE_LOADED = 0.15
"""Modules that --version loads beside those of an empty Typer program, in parts of their number."""


def loaded_by(*arguments: str, program: str = MAIN) -> set[str]:
    """Run main() in a fresh interpreter and return the names of all modules it loaded."""
    code = (
        f"import sys\nsys.argv = ['ffseg', *sys.argv[1:]]\n{program}\n"
        "try:\n    main()\nexcept SystemExit:\n    print('MODULES', *sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True)
    return set(done.stdout.rpartition("MODULES ")[2].split())


@pytest.mark.parametrize("arguments", [["--version"], ["--help"], ["nothing"]])
def test_help_and_version_load_nothing_heavy(arguments: list[str]) -> None:
    assert loaded_by(*arguments) & set(HEAVY) == set()


def test_a_run_leaves_what_is_heavy_to_its_workers(tmp_path: Path) -> None:
    toy = Path(__file__).parents[2] / "samples" / "toy.png"
    loaded = loaded_by("run", str(toy), "--out", str(tmp_path / "out"), "-q")
    assert (tmp_path / "out" / "masks" / "toy.png").is_file()
    assert loaded & {"numpy", "cv2", "yaml", "ffseg.native"} == set()


def test_import_ffseg_loads_nothing_heavy() -> None:
    code = "import sys, ffseg; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    ours = {name for name in done.stdout.split() if name.partition(".")[0] in {"ffseg", "typer", *HEAVY}}
    assert ours == {"ffseg"}


def test_every_public_name_can_be_had() -> None:
    assert {name: getattr(ffseg, name) for name in ffseg.__all__}.keys() == set(dir(ffseg))
    with pytest.raises(AttributeError, match="nothing"):
        ffseg.nothing  # noqa: B018 - the access is the test


def test_version_loads_little_more_than_an_empty_typer_program() -> None:
    """Time, which depends on what else runs, is measured by ``ffseg bench --suite startup``."""
    empty = loaded_by(program=EMPTY)
    more = loaded_by("--version") - empty
    assert "typer" in empty
    assert len(more) <= MORE_LOADED * len(empty), sorted(more)


def test_version_is_that_of_the_package(ffseg_command: Command) -> None:
    done = ffseg_command("--version")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"ffseg {__version__}\n", "")


@pytest.mark.parametrize("arguments", [["nothing"], ["--nothing"], ["config", "nothing"], ["samples"]])
def test_usage_errors_end_with_2(arguments: list[str], ffseg_command: Command) -> None:
    done = ffseg_command(*arguments, code=2)
    assert "Traceback" not in done.stderr
    assert "Usage:" in done.stderr + done.stdout


def raising(error: BaseException) -> Callable[..., None]:
    def fail(**_: object) -> None:
        raise error

    return fail


def exit_code(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> int:
    monkeypatch.setattr(app, "app", raising(error))
    with pytest.raises(SystemExit) as caught:
        app.main()
    return int(str(caught.value.code))


def test_our_errors_are_sentences_and_2(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_code(monkeypatch, OutputError("out: is read-only; choose another folder")) == 2
    assert capsys.readouterr() == ("", "ffseg: error: out: is read-only; choose another folder\n")


def test_the_unexpected_is_one_line_and_a_file(monkeypatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert exit_code(monkeypatch, ZeroDivisionError("two\nlines")) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith("ffseg: error: unexpected ZeroDivisionError: two lines; the traceback is in ")
    (file,) = tmp_path.iterdir()
    assert said.endswith(f"{file}\n")
    assert "ZeroDivisionError" in file.read_text("utf-8")


def test_an_interrupt_ends_with_130(monkeypatch: pytest.MonkeyPatch) -> None:
    assert exit_code(monkeypatch, KeyboardInterrupt()) == 130


def interrupted(module: str, *arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run ffseg with an interrupt while a module is looked for."""
    code = (
        "import os, signal, sys\nfrom ffseg import __main__\n"
        f"class Finder:\n    def find_spec(self, name, *_):\n        if name == {module!r}:\n"
        "            os.kill(os.getpid(), signal.SIGINT)\nsys.meta_path.insert(0, Finder())\n__main__.main()"
    )
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, check=False, text=True, cwd=cwd)


@pytest.mark.skipif(os.name == "nt", reason="no signals of this kind")
@pytest.mark.parametrize("command", ["--help", "run"])
def test_an_interrupt_while_modules_load_ends_without_a_traceback(command: str) -> None:
    done = interrupted("ffseg.cli.app", command)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


AT_WORK = {
    "learn . --truth . --out a.ffmodel": "ffseg.learning.gather",
    "tune . --truth . --out a.yaml": "ffseg.learning.gather",
    "domain . --out a.png": "ffseg.batch.cameras",
    "bench --out a": "ffseg.bench.session",
    "report .": "ffseg.batch.report.write",
    "samples a": "ffseg.samples.write",
    "merge .": "ffseg.batch.shards.merge",
    "segment a.png b.png": "ffseg.api",
}


@pytest.mark.skipif(os.name == "nt", reason="no signals of this kind")
@pytest.mark.parametrize(("arguments", "module"), AT_WORK.items())
def test_an_interrupt_at_work_says_what_is_kept(arguments: str, module: str, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes((Path(__file__).parents[2] / "samples" / "toy.png").read_bytes())
    done = interrupted(module, *arguments.split(), cwd=tmp_path)
    said = "ffseg: interrupted; no file is half written; run it again\n"
    assert (done.returncode, done.stdout, done.stderr) == (130, "", said)


def test_terminal_text_is_escaped() -> None:
    assert console.escape("a\x1b[2J\r\u202eb\udcff\n\té") == "a\\x1b[2J\\r\\u202eb\\udcff\n\té"
