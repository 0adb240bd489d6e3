"""R11: hostile parameter files end with exit code 2, the place, little time, little memory and no traceback."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from hostile_yaml import HOSTILE

CPU_MS = 200
"""Bound of R11, on top of what an empty ``ffseg --version`` takes; processor time, so that load does not count."""
MEMORY_KB = 100_000
"""Bound of R11 for the whole process."""


def finished(arguments: list[str], errors: Path) -> tuple[int, float, int]:
    """Run ffseg; return exit code, processor milliseconds and peak memory in kB."""
    command = [sys.executable, "-m", "ffseg", *arguments]
    output = [(os.POSIX_SPAWN_OPEN, 2, str(errors), os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)]
    process = os.posix_spawn(sys.executable, command, os.environ, file_actions=output)
    _, status, usage = os.wait4(process, 0)
    scale = 1024 if sys.platform == "darwin" else 1
    return os.waitstatus_to_exitcode(status), (usage.ru_utime + usage.ru_stime) * 1e3, usage.ru_maxrss // scale


@pytest.fixture(scope="module")
def start_ms(tmp_path_factory: pytest.TempPathFactory) -> float:
    errors = tmp_path_factory.mktemp("start") / "stderr"
    return min(finished(["config", "check", "default"], errors)[1] for _ in range(3))


def test_there_are_at_least_forty() -> None:
    assert len(HOSTILE) >= 40


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_file_is_refused_in_time(name: str, start_ms: float, tmp_path: Path) -> None:
    content, line = HOSTILE[name]
    file = tmp_path / f"{name}.yaml"
    file.write_bytes(content)
    code, cpu_ms, memory_kb = finished(["config", "check", str(file)], tmp_path / "stderr")
    said = (tmp_path / "stderr").read_text("utf-8")
    assert code == 2
    assert said.startswith(f"ffseg: error: {file}:{line}: " if line else f"ffseg: error: {file}: ")
    assert "Traceback" not in said
    assert said.replace("\n", "").isprintable()
    assert cpu_ms - start_ms <= CPU_MS
    assert memory_kb <= MEMORY_KB
