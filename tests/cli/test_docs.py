"""The commands and the Python code in the documentation are run, page by page, each in a folder of its own."""

import re
import shutil
import sys
from pathlib import Path

import documented_blocks as documented
import pytest

PAGES = documented.pages()


@pytest.mark.parametrize("page", PAGES, ids=[page.name for page in PAGES])
def test_blocks_run(page: Path, tmp_path: Path) -> None:
    """In bash; zsh too has its turn in the clean install of ``check.py``."""
    environment = documented.prepare(tmp_path, page, Path(sys.executable).parent)
    for block in documented.blocks(page):
        assert documented.run(block, "bash", tmp_path, environment) == ""


def test_every_command_shown_is_run_or_says_why_not() -> None:
    for page in documented.PAGES:
        text = page.read_text("utf-8")
        if page.name in ("commands.md", "python.md"):
            continue  # made from help texts and docstrings
        plain = re.findall(r"^```\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
        assert [block for block in plain if re.match(r"(\$ )?(ffseg|python|pip)\b", block)] == [], page.name


@pytest.mark.parametrize("shell", documented.SHELLS)
def test_a_block_that_fails_is_noticed(shell: str, tmp_path: Path) -> None:
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    assert "exit code" in documented.run(documented.Block("sh", "false\ntrue\n", None), shell, tmp_path, {})
    assert "something else" in documented.run(documented.Block("sh", "echo a\n", "b"), shell, tmp_path, {})
    assert documented.run(documented.Block("sh", "echo 12 s\n", "3 s"), shell, tmp_path, {}) == ""
    unquoted = documented.run(documented.Block("sh", "echo key=[1,2] # it\n", None), shell, tmp_path, {})
    assert ("exit code" in unquoted) == (shell == "zsh")
