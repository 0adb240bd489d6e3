"""R13: the native core under ASan and UBSan with hostile contours, maps and parameters: no finding, no hang.

``python -m tests.campaigns.fuzz_native --work DIR --cases 1000000 [--border 20000] [--seed 0]``

Compiles the core and ``tests/campaigns/native`` into one program, which gives every part of the core inputs up to the
limits that its binding lets through, and runs that many cases in it. What the bindings refuse is tried through Python on
a sanitized module (``fuzz_border.py``). After a finding it goes on with the next case; ``--only NUMBER`` repeats one.
"""

import os
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from tests.campaigns import compiling, harness, sanitized
from tests.campaigns.compiling import ROOT

CHUNK = 50_000
"""Cases a process: memory is looked through for leaks at its end."""
MOST_FINDINGS = 20
TELLING = ("runtime error", "ERROR: ", "Assertion", "wrong result", "hang:", "leaked")
"""What the line of a finding holds that says what it is."""


@dataclass
class Count:
    cases: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    slowest_case: int = 0

    def add(self, cases: int, seconds: float, slowest: float, slowest_case: int) -> None:
        self.cases += cases
        self.seconds += seconds
        if slowest > self.slowest:
            self.slowest, self.slowest_case = slowest, slowest_case


@dataclass
class Figures:
    """What the fuzzing did; the cases of processes that a finding ended are not counted."""

    targets: dict[str, Count] = field(default_factory=dict)
    findings: list[str] = field(default_factory=list)
    wall_s: float = 0.0

    @property
    def cases(self) -> int:
        return sum(count.cases for count in self.targets.values())

    def __str__(self) -> str:
        seconds = sum(count.seconds for count in self.targets.values())
        lines = [
            f"{name:10} {count.cases:8} cases {count.seconds:8.1f} s, "
            f"slowest {count.slowest:.2f} s (case {count.slowest_case})"
            for name, count in self.targets.items()
        ]
        total = f"{self.cases} cases, {seconds:.0f} s of processor time, {self.wall_s:.0f} s in all"
        return "\n".join([*lines, total, f"{len(self.findings)} findings", *self.findings])


def campaign(
    work: Path, cases: int, seed: int = 0, first: int = 0, build: compiling.Build = sanitized.BUILD
) -> Figures:
    """Run native cases; a finding ends a process, and the next one goes on behind it."""
    driver, figures = sanitized.build_driver(work, build), Figures()
    begin, number, end = time.perf_counter(), first, first + cases
    while number < end and len(figures.findings) < MOST_FINDINGS:
        number = _chunk(driver, work / "case", (number, min(CHUNK, end - number), seed), figures)
    figures.wall_s = time.perf_counter() - begin
    return figures


def _chunk(driver: Path, mark: Path, what: tuple[int, int, int], figures: Figures) -> int:
    """Run the cases of one process and return the number to go on with."""
    first, cases, seed = what
    numbers = {"--first": first, "--cases": cases, "--seed": seed, "--mark": mark}
    command = [str(driver), *(str(part) for pair in numbers.items() for part in pair)]
    done = subprocess.run(
        command, capture_output=True, text=True, errors="replace", check=False, env=sanitized.environment(leaks=True)
    )
    for line in done.stdout.splitlines():
        name, count, seconds, slowest, slowest_case = line.split()
        figures.targets.setdefault(name, Count()).add(int(count), float(seconds), float(slowest), int(slowest_case))
    if done.returncode == 0:
        return first + cases
    at = int(mark.read_text())
    figures.findings.append(f"case {at}: {telling(done.stderr) or f'exit code {done.returncode}'}")
    mark.with_name(f"finding-{at}.txt").write_text(done.stderr, encoding="utf-8")
    return at + 1


def telling(words: str) -> str:
    """The line of a report that says what was found."""
    return next((line.strip() for line in words.splitlines() if any(part in line for part in TELLING)), "")


def border_command(work: Path, core: Path | str, *options: object) -> list[str]:
    module = "tests.campaigns.fuzz_border"
    return [sys.executable, "-m", module, "--work", str(work), "--core", str(core), *map(str, options)]


def at_the_border(work: Path, cases: int, seed: int, only: int | None = None) -> tuple[int, str]:
    """Run border cases through Python; the exit code and what was counted or found."""
    core = sanitized.BUILD.module(work)
    command = border_command(work, core, "--seed", seed, *(("--cases", cases) if only is None else ("--only", only)))
    env = {**sanitized.environment(leaks=False), "LD_PRELOAD": sanitized.libraries()}  # Python itself keeps memory
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False, env=env, cwd=ROOT)
    if done.returncode == 0:
        return 0, done.stdout.strip()
    (work / "border-finding.txt").write_text(done.stderr, encoding="utf-8")
    mark = (work / "border-case").read_text().strip()
    return done.returncode, f"border case {mark}: {telling(done.stderr) or done.stderr[-300:]}"


def main(
    work: harness.Work,
    cases: int = 1_000_000,
    border: int = 20_000,
    seed: int = 0,
    first: int = 0,
    only: int | None = None,
    border_only: int | None = None,
) -> int:
    """Build and run both parts; 1 after a finding."""
    work = work.resolve()
    first, cases = (only, 1) if only is not None else (first, cases)
    code = 0
    if border_only is None:
        figures = campaign(work, cases, seed, first)
        harness.say(f"native\n{figures}")
        code = 1 if figures.findings or figures.cases != cases else 0
    if border_only is not None or (border and only is None):
        begin = time.perf_counter()
        border_code, words = at_the_border(work, border, seed, border_only)
        harness.say(f"border\n{words}\n{time.perf_counter() - begin:.0f} s in all, exit code {border_code}")
        code = code or (1 if border_code else 0)
    harness.say("clean" if code == 0 else f"not clean: the reports are {os.fspath(work)}/*finding*.txt")
    return code


if __name__ == "__main__":
    harness.as_command(main)
