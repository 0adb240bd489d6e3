"""The page on extending does what it says."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_an_output_and_an_executor_of_ones_own(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n# (\w+\.py)\n(.*?)```", text, re.DOTALL)
    assert [name for name, _ in blocks] == ["areas.py", "backwards.py", "own.py"]
    for name, code in blocks:
        assert len(code.splitlines()) <= 40, "an extension fits one small file"
        (tmp_path / name).write_text(code, encoding="utf-8")
    command = [sys.executable, "own.py", ROOT / "samples" / "toy.png", "out"]
    for word in ("ok", "unchanged"):
        done = subprocess.run(command, check=True, cwd=tmp_path, capture_output=True, text=True)
        assert done.stdout.split() == ["toy.png", word]
    (line,) = (tmp_path / "out" / "areas.jsonl").read_text().splitlines()
    assert json.loads(line) == json.loads((tmp_path / "out" / "areas" / "toy.json").read_text())
    assert json.loads(line)[0] > 0
