"""Generated files: pages, presets and the native stub say what the code does."""

import ast
import importlib.util
import inspect
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import typer

from ffseg.native import _core
from ffseg.parameter_text import schema_file, to_markdown, to_yaml
from ffseg.parameters import Parameters
from ffseg.peer_parameters import PeerParameters
from tests import constants, contracts

ROOT = Path(__file__).resolve().parents[2]
STUB = ROOT / "ffseg" / "native" / "_core.pyi"
MADE_BELOW = "<!-- made from the sources by pytest --update-golden -->"
Golden = Callable[[Path, str], None]


PRESET = "# yaml-language-server: $schema=schema.json\n# Every key with its default.\n\n"
PEERS = "# Parameters of the peers, for `ffseg compare --peers FILE`.\n\n"
GENERATED: dict[str, Callable[[], str]] = {
    "configs/default.yaml": lambda: PRESET + to_yaml(Parameters()),
    "configs/peers.yaml": lambda: PEERS + to_yaml(PeerParameters()),
    "configs/schema.json": schema_file,
    "docs/parameters.md": to_markdown,
}


@pytest.mark.parametrize("path", GENERATED)
def test_files_made_of_the_parameters(path: str, golden: Golden) -> None:
    golden(ROOT / path, GENERATED[path]())


def test_page_of_the_pipeline_lists_the_constants(golden: Golden) -> None:
    page = ROOT / "docs" / "pipeline.md"
    head, mark, _ = page.read_text("utf-8").partition(MADE_BELOW)
    assert mark, f"{page.name} must hold the line {MADE_BELOW}"
    golden(page, f"{head}{mark}\n\n{constants.table()}")


def test_page_of_formats_lists_what_scripts_may_rely_on_and_loses_no_name(golden: Golden, tmp_path: Path) -> None:
    page = ROOT / "docs" / "formats.md"
    head, mark, before = page.read_text("utf-8").partition(contracts.MADE_BELOW)
    lists = contracts.page(tmp_path)
    lost = [name for name in re.findall(r"`[^`]+`", before) if name not in lists]
    remedy = "bring them back, or take them off the page by hand and say so in CHANGELOG.md"
    assert lost == [], f"promised names are gone: {remedy}"
    golden(page, f"{head}{mark}\n\n{lists}")


def help_of(*command: str) -> str:
    """What ``ffseg COMMAND --help`` prints on a terminal of 80 columns."""
    arguments = [sys.executable, "-m", "ffseg", *command, "--help"]
    environment = {**os.environ, "COLUMNS": "80", "TERMINAL_WIDTH": "80", "NO_COLOR": "1"}
    done = subprocess.run(arguments, check=True, capture_output=True, text=True, encoding="utf-8", env=environment)
    return done.stdout.strip()


def pages_under(*command: str) -> list[str]:
    text = help_of(*command)
    title = " ".join(("ffseg", *command))
    below = re.findall(r"^  ([\w-]+)(?:  |$)", text.partition("\nCommands:\n")[2], flags=re.MULTILINE)
    sections = [f"## {title}\n\n```\n{text}\n```"]
    return sections + [section for name in below for section in pages_under(*command, name)]


OLDER = tuple(map(int, typer.__version__.split(".")[:2])) < (0, 28)


@pytest.mark.skipif(OLDER, reason="an older Typer brackets arguments in other places")
def test_command_page(golden: Golden) -> None:
    head = "# Commands\n\nMade from `--help` by `pytest --update-golden`."
    golden(ROOT / "docs" / "commands.md", "\n\n".join([head, *pages_under()]) + "\n")


def names_in(module: ast.Module) -> set[str]:
    """Functions, classes and members a stub declares."""
    found = set()
    for node in module.body:
        if isinstance(node, ast.FunctionDef):
            found.add(node.name)
        elif isinstance(node, ast.ClassDef):
            members = (item.name for item in node.body if isinstance(item, ast.FunctionDef))
            found |= {node.name, *(f"{node.name}.{name}" for name in members if not name.startswith("__"))}
    return found


def test_native_stub_names_what_the_module_holds(update_golden: bool) -> None:
    if update_golden:
        if importlib.util.find_spec("nanobind") is None:
            pytest.skip("nanobind is needed to write the stub")
        command = [sys.executable, "-m", "nanobind.stubgen", "-q", "-m", "ffseg.native._core", "-o", str(STUB)]
        subprocess.run(command, check=True)
    there = {name for name in dir(_core) if not name.startswith("_")}
    for name in list(there):
        if inspect.isclass(getattr(_core, name)):
            there |= {f"{name}.{member}" for member in dir(getattr(_core, name)) if not member.startswith("_")}
    assert names_in(ast.parse(STUB.read_text("utf-8"))) == there, "write it anew with pytest --update-golden"
