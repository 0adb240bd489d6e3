"""Help ends with examples that work, lists show whole summaries, mistyped words are told the nearest, shells complete."""

import re
import sys
from pathlib import Path

import documented_blocks as documented
import pytest
from commands import Command

from ffseg.batch.outputs.table import EXPORTS
from ffseg.bench.session import SUITES
from ffseg.cli import completion
from ffseg.cli.app import COMMANDS
from ffseg.cli.commands import config
from ffseg.cli.examples import EXAMPLES

BELOW = [f"config {name}" for name in ("list", "show", "check", "schema")]
SLOW = ("bench", "pick")
DONE = "ffseg samples pictures"
"""What a reader's folder begins with."""
LEARN = "ffseg learn own --truth masks --out own.ffmodel"
"""Run as it stands by the tutorial; here without its figures, which take three quarters of it."""


@pytest.mark.parametrize("command", [*COMMANDS, *BELOW])
def test_every_help_ends_with_its_examples(command: str, ffseg_command: Command) -> None:
    shown = ffseg_command(*command.split(), "--help").stdout
    assert EXAMPLES[command]
    assert shown.partition("Examples:\n")[2].split("\n")[:-1] == [f"    {line}" for line in EXAMPLES[command]]


def test_the_examples_run(tmp_path: Path) -> None:
    page = documented.ROOT / "docs" / "examples"
    environment = documented.prepare(tmp_path, page, Path(sys.executable).parent)
    lines = [line for command, lines in EXAMPLES.items() if command not in SLOW for line in lines]
    assert lines.count(DONE) == 1
    for line in sorted({*lines} - {DONE}, key=lambda line: (not line.startswith("ffseg samples"), lines.index(line))):
        block = documented.Block("sh", f"{line} --quick" if line == LEARN else line, None)
        assert documented.run(block, "bash", tmp_path, environment) == ""
    assert LEARN in lines
    assert LEARN in (page.parent / "tutorial.md").read_text("utf-8")


def test_help_names_every_choice(ffseg_command: Command) -> None:
    for command, choices in (("bench", SUITES), ("run", EXPORTS)):
        words = re.findall(r"[a-z]+", ffseg_command(command, "--help").stdout)
        assert [choice for choice in choices if choice not in words] == []


@pytest.mark.parametrize("command", [(), ("config",)])
def test_lists_of_commands_show_whole_summaries(command: tuple[str, ...], ffseg_command: Command) -> None:
    listed = ffseg_command(*command, "--help").stdout.partition("Commands:\n")[2]
    assert "..." not in listed
    if command:
        assert " ".join((config.check.__doc__ or "").partition("\n\n")[0].split()) in " ".join(listed.split())


MISTYPED = {
    "command": (["rnu"], "there is no command 'rnu'; did you mean 'run'?"),
    "command of a group": (["config", "chek"], "there is no command 'chek'; did you mean 'check'?"),
    "a word near to none": (["zzz"], "there is no command 'zzz'; choose one of run, segment, compare, "),
    "option": (["run", "--ovrelay"], "--overlay"),
    "method": (["compare", "samples", "--out", "x", "--methods", "snak"], "did you mean 'snake'?"),
    "suite": (["bench", "--out", "x", "--suite", "pach"], "did you mean 'patches'?"),
    "export": (["run", "samples", "--out", "x", "--export", "cocoo"], "did you mean 'coco'?"),
    "preset": (["config", "show", "toy-ful"], "did you mean 'toy-full'?"),
    "key": (["config", "show", "--set", "contour.degre=2"], "did you mean 'contour.degree'?"),
}


@pytest.mark.parametrize(("arguments", "said"), MISTYPED.values(), ids=MISTYPED)
def test_mistypings_hear_the_nearest(arguments: list[str], said: str, tmp_path: Path, ffseg_command: Command) -> None:
    assert said in " ".join(ffseg_command(*arguments, cwd=tmp_path, code=2).stderr.split())


COMPLETED = {
    "ffseg con": ["config"],
    "ffseg run --config toy-f": ["toy-fixed", "toy-full"],
    "ffseg config show omni-i": ["omni-indoor"],
    "ffseg run --set contour.deg": ["contour.degree="],
    "ffseg run --set contour.ref": ["contour.refine="],
    "ffseg compare --methods freeform,sn": ["freeform,snake"],
    "ffseg run --export coco,": ["coco,labelme", "coco,geojson", "coco,yolo", "coco,svg", "coco,cutout"],
    "ffseg bench --suite pa": ["patches"],
    "ffseg segment --as ge": ["geojson"],
    "ffseg nosuch con": ["config"],  # which wrote a traceback
    "ffseg config nosuch sch": ["schema"],
}


@pytest.mark.parametrize(("words", "expected"), COMPLETED.items(), ids=COMPLETED)
def test_the_shell_completes(words: str, expected: list[str], ffseg_command: Command, monkeypatch) -> None:
    count = len(words.split()) - (not words.endswith(" "))
    for name, value in (("_FFSEG_COMPLETE", "complete_bash"), ("COMP_WORDS", words), ("COMP_CWORD", str(count))):
        monkeypatch.setenv(name, value)
    done = ffseg_command()
    assert (done.stdout.split(), done.stderr) == (expected, "")


def test_words_of_a_key_are_completed() -> None:
    assert completion.settings("contour.refine=") == ["contour.refine=true", "contour.refine=false"]
    assert completion.settings("edges.canny=a") == ["edges.canny=auto"]
    assert "method=snake" in completion.settings("method=")
    assert completion.settings("contour.degree=") == completion.settings("nothing=") == []


def test_completion_knows_all_suites_and_exports() -> None:
    assert (completion.suites(""), completion.exports("")) == (list(SUITES), list(EXPORTS))
