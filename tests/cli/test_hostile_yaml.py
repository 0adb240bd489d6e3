"""R11: hostile parameter files end with exit code 2, the place, little time, little memory and no traceback."""

import subprocess
import sys
from pathlib import Path

import pytest
from hostile_yaml import HOSTILE

CPU_MS = 200
"""Bound of R11, on top of what an empty ``ffseg --version`` takes; processor time, so that load does not count."""
MEMORY_KB = 100_000
"""Bound of R11 for the whole process."""
MOST_TRIES = 10
"""Processes that share a core also slow each other's processor time: the least of so many is what the file costs, each
but the first beside a start just before it."""


MEASURE = """
import os, sys
process = os.posix_spawn(sys.executable, [sys.executable, "-m", "ffseg", *sys.argv[1:]], os.environ)
status, usage = os.wait4(process, 0)[1:]
print("\\n", os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime, usage.ru_maxrss)
"""
"""A small process between: the peak memory of a child counts from that of the process that started it."""


def finished(*arguments: str) -> tuple[int, float, int, str]:
    """Run ffseg; return exit code, processor milliseconds, peak memory in kB, and stderr."""
    command = [sys.executable, "-c", MEASURE, *arguments]
    done = subprocess.run(command, check=True, capture_output=True, text=True, encoding="utf-8", timeout=600)
    code, seconds, memory = done.stdout.splitlines()[-1].split()
    return int(code), float(seconds) * 1e3, int(memory) // (1024 if sys.platform == "darwin" else 1), done.stderr


@pytest.fixture(scope="module")
def start_ms() -> float:
    return min(finished("config", "check", "default")[1] for _ in range(3))


def test_there_are_at_least_forty() -> None:
    assert len(HOSTILE) >= 40


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_file_is_refused_in_time(name: str, start_ms: float, tmp_path: Path) -> None:
    content, line = HOSTILE[name]
    file = tmp_path / f"{name}.yaml"
    file.write_bytes(content)
    for _ in range(MOST_TRIES):
        code, cpu_ms, memory_kb, said = finished("config", "check", str(file))
        if cpu_ms - start_ms <= CPU_MS:
            break
        start_ms = finished("config", "check", "default")[1]
    assert code == 2
    assert said.startswith(f"ffseg: error: {file}:{line}: " if line else f"ffseg: error: {file}: ")
    assert "Traceback" not in said
    assert said.replace("\n", "").isprintable()
    assert cpu_ms - start_ms <= CPU_MS
    assert memory_kb <= MEMORY_KB
