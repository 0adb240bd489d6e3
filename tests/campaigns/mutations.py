"""Which small faults the tests nearest to them notice: the flip, pruning, splitting, the filter, movement and settling of the
free form, the structural test and motion.

``python -m tests.campaigns.mutations --work DIR [--only native|structural|motion] [--numbers 1,2,...]``

Faults of the core are compiled together, each behind a switch, so that one build serves all; those of Python go into a
copy of the package, one after the other. A fault is noticed when a test fails, or takes longer than a minute.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import compiling
import harness
from mutants import MOTION, NATIVE, STRUCTURAL, Mutant

ROOT = compiling.ROOT
LIMIT = 60
"""Seconds beyond those that the tests take without a fault."""
SWITCH = """#pragma once
#include <array>
#include <cstdlib>
#include <sstream>
#include <string>
struct Mutants {
    std::array<bool, 256> on{};
    Mutants() {
        const char* given = std::getenv("FFSEG_MUTANT");
        std::istringstream numbers(given == nullptr ? "" : given);
        for (std::string number; std::getline(numbers, number, ',');) on[static_cast<unsigned char>(std::stoi(number))] = true;
    }
};
inline const Mutants kMutants;
inline bool is_on(int number) { return kMutants.on[static_cast<unsigned>(number)]; }
"""
STALE = "stale: its text no longer stands in the code once"
NEAREST = {
    "native": (
        "tests/unit/test_freeform_flips.py", "tests/unit/test_freeform_repairs.py", "tests/unit/test_freeform_steps.py",
        "tests/unit/test_samples.py", "tests/unit/test_freeform_components.py",
        "tests/unit/test_region_pressure.py", "tests/unit/test_corridors.py",
    ),
    "structural": ("tests/unit/test_structural_rules.py",),
    "motion": ("tests/unit/test_camera_motion.py", "tests/unit/test_ground_fit.py"),
}  # fmt: skip
"""Tests of each group, quickest first."""


def switched(text: str, mutants: Sequence[tuple[int, Mutant]]) -> str:
    """A source with the faults of a file behind their switches; those that are stale are left out."""
    places = []
    for number, mutant in mutants:
        if text.count(mutant.old) == 1:
            places.append((text.index(mutant.old), number, mutant))
    for at, number, mutant in sorted(places, key=lambda place: -place[0]):
        test = f"is_on({number})"
        if mutant.old.startswith(("if", "for", "return")) or (mutant.old.endswith(";") and "<=" not in mutant.old):
            made = f"if ({test}) {{ {mutant.new} }} else {{ {mutant.old} }}"
        else:
            end = ";" if mutant.old.endswith(";") else ""
            made = f"({test} ? ({mutant.new.rstrip(';')}) : ({mutant.old.rstrip(';')})){end}"
        text = text[:at] + made + text[at + len(mutant.old) :]
    return text


def is_stale(mutant: Mutant) -> bool:
    """Whether the code has changed, so that the text of a fault no longer stands there once."""
    return (ROOT / "ffseg" / mutant.file).read_text("utf-8").count(mutant.old) != 1


def native_core(work: Path, mutants: Sequence[Mutant] = tuple(NATIVE)) -> Path:
    """The core with all faults; those whose numbers ``FFSEG_MUTANT`` lists, from 1 on, are switched on."""
    tree = work / "native"
    shutil.rmtree(tree, ignore_errors=True)
    shutil.copytree(compiling.CORE, tree, ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    (tree / "mutant.hpp").write_text(SWITCH, encoding="utf-8")
    numbered = list(enumerate(mutants, 1))
    for file in sorted({mutant.file for mutant in mutants}):
        path = tree / file.removeprefix("native/")
        path.write_text(switched(path.read_text("utf-8"), [(n, m) for n, m in numbered if m.file == file]), "utf-8")
    original, compiling.CORE = compiling.CORE, tree
    try:
        build = compiling.Build((*compiling.ALWAYS, "-O1", "-w", "-include", str(tree / "mutant.hpp")))
        return build.module(work / "objects")
    finally:
        compiling.CORE = original


def python_tree(work: Path, mutants: Sequence[Mutant]) -> Path:
    """A copy of the package, the files of these faults as they are."""
    tree = work / "tree"
    if not tree.is_dir():
        shutil.copytree(ROOT / "ffseg", tree / "ffseg", ignore=shutil.ignore_patterns("*.so", "__pycache__"))
        shutil.copytree(ROOT / "configs", tree / "configs")
    for file in {mutant.file for mutant in mutants}:
        shutil.copyfile(ROOT / "ffseg" / file, tree / "ffseg" / file)
    return tree


def put_in(tree: Path, mutant: Mutant) -> None:
    """Write the file of a fault with the fault."""
    text = (ROOT / "ffseg" / mutant.file).read_text("utf-8")
    (tree / "ffseg" / mutant.file).write_text(text.replace(mutant.old, mutant.new), "utf-8")


def tested(group: str, env: dict[str, str], limit: float | None) -> tuple[str, float]:
    """The name of the first test that fails, or nothing; and the seconds it took."""
    command = [sys.executable, "-m", "pytest", "-qx", "-p", "other_core", "-p", "no:cacheprovider", "-p", "no:randomly"]
    paths = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    begin = time.monotonic()
    try:
        done = subprocess.run(
            [*command, *NEAREST[group]], cwd=ROOT, capture_output=True, text=True, timeout=limit, check=False,
            env={**os.environ, **env, "PYTHONPATH": paths},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "takes for ever", time.monotonic() - begin
    seconds = time.monotonic() - begin
    if done.returncode == 0:
        return "", seconds
    lines = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return (lines[0].split(" - ")[0].split("::")[-1] if lines else f"exit code {done.returncode}"), seconds


def campaign(work: Path, group: str, numbers: Sequence[int] = ()) -> Iterator[tuple[int, Mutant, str]]:
    """Each fault of a group, or those of these numbers, with the test that noticed it, or nothing."""
    work.mkdir(parents=True, exist_ok=True)
    mutants = {"native": NATIVE, "structural": STRUCTURAL, "motion": MOTION}[group]
    if group == "native":
        env = {"FFSEG_OTHER_CORE": str(native_core(work)), "FFSEG_MUTANT": "0"}
    else:
        shutil.rmtree(work / "tree", ignore_errors=True)
        env = {"FFSEG_OTHER_TREE": str(python_tree(work, mutants))}
    failed, seconds = tested(group, env, None)
    assert failed == "", f"without a fault {failed} fails"
    for number, mutant in enumerate(mutants, 1):
        if numbers and number not in numbers:
            continue
        if is_stale(mutant):
            yield number, mutant, STALE
        elif group == "native":
            env["FFSEG_MUTANT"] = str(number)
            yield number, mutant, tested(group, env, 2 * seconds + LIMIT)[0]
        else:
            put_in(python_tree(work, mutants), mutant)
            yield number, mutant, tested(group, env, 2 * seconds + LIMIT)[0]


def main() -> int:
    """Run the campaign; 1 when a fault that can be noticed was not, or the code has left one behind."""
    arguments = harness.parser(__doc__)
    arguments.add_argument("--only", choices=tuple(NEAREST))
    arguments.add_argument("--numbers", default="", help="of faults in their group, with commas; all without")
    given = arguments.parse_args()
    numbers = [int(number) for number in given.numbers.split(",") if number]
    counts = {"noticed": 0, "survived": 0, "without effect": 0, "stale": 0}
    for group in [given.only] if given.only else NEAREST:
        for number, mutant, test in campaign(given.work, group, numbers):
            word = (
                "stale" if test == STALE else "noticed" if test else "without effect" if mutant.effect else "survived"
            )
            counts[word] += 1
            harness.say(f"{number:3} {word}: {mutant.name}  [{test or mutant.effect}]")
    harness.say(", ".join(f"{count} {word}" for word, count in counts.items()))
    return int(counts["survived"] + counts["stale"] > 0)


if __name__ == "__main__":
    sys.exit(main())
