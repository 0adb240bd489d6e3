"""Which small faults the tests nearest to them let pass: a condition turned round, a statement left out; in Python also a sign,
a comparison or a constant changed.

``python -m tests.campaigns.mutations --work DIR [--only native|structural|motion] [--most 60] [--seed 0]``

Of all places in the files of a group so many are drawn. Faults of the core are compiled together, each behind a switch, so that
one build serves all; those of Python go into a copy of the package, one after the other. A fault is noticed when a test fails,
or takes longer than a minute. Of those that survive some change nothing that could be noticed: they are there to be looked at.
"""

import ast
import os
import random
import re
import shutil
import subprocess
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.campaigns import compiling, harness

ROOT = compiling.ROOT
LIMIT = 60
"""Seconds beyond those that the tests take without a fault."""
GROUPS = {
    "native": (
        ("native/freeform/*/*.hpp", "native/freeform/*/*.cpp", "native/freeform/[c-z]*.?pp", "native/region/pressure.cpp"),
        ("freeform_flips", "freeform_evolution", "freeform_steps", "samples", "region_pressure", "corridors"),
    ),
    "structural": (
        ("freespace/structural.py", "freespace/corners.py", "freespace/outlines.py"),
        ("structural_rules",),
    ),
    "motion": (("camera/motion.py", "freespace/motion/ground.py"), ("camera_motion", "ground_fit")),
}  # fmt: skip
"""Files below ``ffseg/`` and tests of each group, quickest first."""
SWITCH = """#pragma once
#include <cstdlib>
#include <set>
#include <sstream>
struct Mutants {
    std::set<int> on;
    Mutants() {
        const char* given = std::getenv("FFSEG_MUTANT");
        std::istringstream numbers(given == nullptr ? "" : given);
        for (std::string number; std::getline(numbers, number, ',');) on.insert(std::stoi(number));
    }
};
inline const Mutants kMutants;
inline bool is_on(int number) { return !kMutants.on.empty() && kMutants.on.count(number) != 0; }
"""


@dataclass(frozen=True)
class Fault:
    """What stands in the place of some text of a file below ``ffseg/``."""

    file: str
    start: int
    old: str
    new: str

    def put_in(self, text: str) -> str:
        """The file's text with the fault."""
        return text[: self.start] + self.new + text[self.start + len(self.old) :]

    def __str__(self) -> str:
        line = source(self.file).count("\n", 0, self.start) + 1
        old, new = (" ".join(text.split())[:60] for text in (self.old, self.new))
        return f"{self.file}:{line}: {old} -> {new or 'left out'}"


def source(file: str) -> str:
    """Text of a file below ``ffseg/``."""
    return (ROOT / "ffseg" / file).read_text("utf-8")


def named(file: str, old: str, new: str) -> Fault:
    """A fault by its text, which must stand in the file once."""
    text = source(file)
    if text.count(old) != 1:
        raise ValueError(f"{file} holds {text.count(old)} times: {old}")
    return Fault(file, text.index(old), old, new)


_COMPARED = {"<": "<=", "<=": "<", ">": ">=", ">=": ">"}
_CONDITION = re.compile(r"\b(?:if|while) \((?=((?:[^()=]|[=!<>]=|\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\))*)\))")
_STATEMENT = re.compile(r"(?m)^ +([a-z_][\w.\[\]]*(?: [-+*/|&]?= [^;\n]*|(?<!static_assert)\([^;\n]*\));)$")


def faults_of_native(file: str) -> Iterator[Fault]:
    """Faults in a file of the core."""
    text = source(file)
    for pattern, new in ((_CONDITION, "!({})"), (_STATEMENT, "")):
        for found in pattern.finditer(text):
            yield Fault(file, found.start(1), found[1], new.format(found[1]))


def faults_of_python(file: str) -> Iterator[Fault]:
    """Faults in a module."""
    text = source(file)
    begins = [0, *(at.end() for at in re.finditer("\n", text))]

    def fault(node: ast.expr | ast.stmt, new: str) -> Fault:
        start = begins[node.lineno - 1] + node.col_offset
        return Fault(file, start, ast.get_source_segment(text, node) or "", new)

    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.If | ast.While | ast.IfExp):
            yield fault(node.test, f"(not ({ast.unparse(node.test)}))")
        elif isinstance(node, ast.AugAssign) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)):
            yield fault(node, "pass")
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            sign = "-" if isinstance(node.op, ast.Add) else "+"
            yield fault(node, f"({ast.unparse(node.left)} {sign} ({ast.unparse(node.right)}))")
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitAnd):
            yield fault(node, f"({ast.unparse(node.left)})")
        elif isinstance(node, ast.Compare) and len(node.ops) == 1:
            old = ast.unparse(node).removeprefix(ast.unparse(node.left)).split()[0]
            if old in _COMPARED:
                yield fault(node, f"({ast.unparse(node.left)} {_COMPARED[old]} {ast.unparse(node.comparators[0])})")
        elif isinstance(node, ast.Constant) and isinstance(node.value, float):
            yield fault(node, repr(1.2 * node.value))


def switched(text: str, faults: Sequence[tuple[int, Fault]]) -> str:
    """A source of the core with faults behind their switches; of two that overlap the later one is left out."""
    end = len(text)
    for number, fault in sorted(faults, key=lambda one: -one[1].start):
        if fault.start + len(fault.old) > end:
            continue
        end, test = fault.start, f"is_on({number})"
        if fault.old.endswith(";") or fault.old.startswith(("if ", "for ")):
            made = f"if ({test}) {{ {fault.new} }} else {{ {fault.old} }}"
        else:
            made = f"({test} ? ({fault.new}) : ({fault.old}))"
        text = text[: fault.start] + made + text[fault.start + len(fault.old) :]
    return text


def native_core(work: Path, faults: Sequence[Fault]) -> Path:
    """The core with all faults; those whose numbers ``FFSEG_MUTANT`` lists, from 1 on, are switched on."""
    tree = work / "native"
    shutil.rmtree(tree, ignore_errors=True)
    shutil.copytree(compiling.CORE, tree, ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    (tree / "mutant.hpp").write_text(SWITCH, encoding="utf-8")
    for file in {fault.file for fault in faults}:
        mine = [(number, fault) for number, fault in enumerate(faults, 1) if fault.file == file]
        (tree / file.removeprefix("native/")).write_text(switched(source(file), mine), "utf-8")
    original, compiling.CORE = compiling.CORE, tree
    try:
        build = compiling.Build((*compiling.ALWAYS, "-O1", "-w", "-include", str(tree / "mutant.hpp")))
        return build.module(work / "objects")
    finally:
        compiling.CORE = original


def python_tree(work: Path) -> Path:
    """A copy of the package."""
    tree = work / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    shutil.copytree(ROOT / "ffseg", tree / "ffseg", ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    shutil.copytree(ROOT / "configs", tree / "configs")
    return tree


def tested(names: Sequence[str], env: dict[str, str], limit: float | None) -> tuple[str, float]:
    """The name of the first test that fails, or nothing; and the seconds it took."""
    command = compiling.tests_with("-x", "-p", "no:randomly", *(f"tests/unit/test_{name}.py" for name in names))
    begin = time.monotonic()
    try:
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, timeout=limit, check=False, env={**os.environ, **env}
        )
    except subprocess.TimeoutExpired:
        return "takes for ever", time.monotonic() - begin
    lines = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    failed = lines[0].split(" - ")[0].split("::")[-1] if lines else f"exit code {done.returncode}"
    return failed if done.returncode else "", time.monotonic() - begin


def campaign(work: Path, group: str, most: int, seed: int) -> Iterator[tuple[Fault, str]]:
    """So many faults of a group, each with the test that noticed it, or nothing."""
    patterns, tests = GROUPS[group]
    files = [str(path.relative_to(ROOT / "ffseg")) for one in patterns for path in sorted((ROOT / "ffseg").glob(one))]
    find = faults_of_native if group == "native" else faults_of_python
    every = [fault for file in files for fault in find(file)]
    faults = random.Random(seed).sample(every, min(most, len(every)))  # noqa: S311 - places
    if group == "native":
        env = {"FFSEG_OTHER_CORE": str(native_core(work, faults))}
    else:
        tree = python_tree(work)
        env = {"FFSEG_OTHER_TREE": str(tree)}
    failed, seconds = tested(tests, env, None)
    assert failed == "", f"without a fault {failed} fails"
    for number, fault in enumerate(faults, 1):
        if group == "native":
            env["FFSEG_MUTANT"] = str(number)
        else:
            (tree / "ffseg" / fault.file).write_text(fault.put_in(source(fault.file)), "utf-8")
        yield fault, tested(tests, env, 2 * seconds + LIMIT)[0]
        if group != "native":
            shutil.copyfile(ROOT / "ffseg" / fault.file, tree / "ffseg" / fault.file)


def main(work: harness.Work, only: str | None = None, most: int = 60, seed: int = 0) -> int:
    """Run the campaign."""
    work.mkdir(parents=True, exist_ok=True)
    for group in [only] if only else GROUPS:
        noticed = []
        for fault, test in campaign(work, group, most, seed):
            noticed.append(test != "")
            harness.say(f"{'noticed' if test else 'SURVIVED'}: {fault}  [{test}]")
        harness.say(f"{group}: {sum(noticed)} of {len(noticed)} noticed")
    return 0


if __name__ == "__main__":
    harness.as_command(main)
