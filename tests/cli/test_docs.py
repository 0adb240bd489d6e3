"""The commands and the Python code in the documentation are run, page by page, each in a folder of its own."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "docs" / "tutorial.md"]
_BLOCK = re.compile(
    r"(<!-- not run: [^\n]+ -->\n)?^```(sh|python)\n(.*?)^```$(?:\n+```output\n(.*?)^```$)?", re.DOTALL | re.MULTILINE
)
"""A block, the mark that it cannot be run here, and what it prints."""


def blocks(page: Path) -> list[tuple[str, str, str | None]]:
    """Language, code and printed output of the blocks that are to be run."""
    found = _BLOCK.findall(page.read_text("utf-8"))
    return [(language, code, output or None) for mark, language, code, output in found if not mark]


def worth_comparing(text: str) -> list[str]:
    """Words of an output, with every number taken for the same: times and versions differ."""
    return re.sub(r"\d+(\.\d+)*", "0", text).split()


@pytest.mark.parametrize("page", PAGES, ids=[page.name for page in PAGES])
def test_blocks_run(page: Path, tmp_path: Path) -> None:
    photos = tmp_path / "photos"
    photos.mkdir()
    for name in ("simple.png", "complex.png"):
        shutil.copyfile(ROOT / "samples" / name, photos / name)
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    assert blocks(page)
    for language, code, output in blocks(page):
        command = ["sh", "-e", "-c", code] if language == "sh" else [sys.executable, "-c", code]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == 0, f"{code}\n{done.stdout}{done.stderr}"
        if output is not None:
            assert worth_comparing(done.stdout) == worth_comparing(output), code
