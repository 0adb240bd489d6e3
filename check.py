"""Run every check of the project: lint, format, types, import floors, C++ builds, tests, and a clean install.

``python check.py`` needs ``pip install -e '.[test]'``; ``--no-install`` leaves the clean install out. ``--oldest`` and
``--newest`` instead run the tests with the oldest or the newest dependencies that ``pyproject.toml`` allows, in a new
environment of the Python that runs this file; what follows goes to pytest: ``python3.13 check.py --newest tests/unit``.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
import venv
from pathlib import Path

from tests import documented_blocks as documented

ROOT = Path(__file__).resolve().parent
SCRIPTS = Path(sys.executable).parent
CPP = [
    str(path)
    for folder in ("ffseg/native", "tests/campaigns/native")
    for path in sorted((ROOT / folder).rglob("*.[ch]pp"))
]
CLANG_FORMAT = "import clang_format; clang_format.clang_format()"
CHECKS = {
    "ruff": [sys.executable, "-m", "ruff", "check", "--output-format=concise"],
    "format": [sys.executable, "-m", "ruff", "format", "--check"],
    "C++ format": [sys.executable, "-c", CLANG_FORMAT, "--dry-run", "-Werror", *CPP],
    "types": [sys.executable, "-m", "mypy"],
    "import floors": [str(SCRIPTS / "lint-imports"), "--no-logo"],
    "C++ builds": [sys.executable, "-m", "tests.campaigns.builds", "--work", "build/checks"],
    "tests": [sys.executable, "-m", "pytest", "-n", "2", "-q"],
}
"""Name and command of each check, run in the project's folder."""
IN_SOURCES = "import ffseg; print(ffseg.segment(ffseg.read_image('samples/toy.png')))"
"""What must use the installation also in this folder, where ``import ffseg`` finds the sources first."""
DEVELOPMENT = ("test", "docs")
"""Extras of those who work on ffseg: their tools may be of any version."""
TEST_ONLY = ("pytest", "hypothesis", "shapely", "ruff", "mypy")


def main() -> int:
    """Run all checks, also after one has failed; 0 when all pass."""
    parser = argparse.ArgumentParser(description="Run every check of the project.")
    parser.add_argument("--no-install", action="store_true", help="leave out the smoke test of a clean install")
    parser.add_argument("--oldest", action="store_true", help="only the tests, with the oldest dependencies allowed")
    parser.add_argument("--newest", action="store_true", help="only the tests, with the newest dependencies allowed")
    parser.add_argument("pytest", nargs="*", help="what pytest is to run with these")
    options = parser.parse_args()
    if options.oldest or options.newest:
        sets = [name for name in ("oldest", "newest") if getattr(options, name)]
        return 0 if all(_with_dependencies(name, options.pytest) for name in sets) else 1
    results = {name: _timed(name, command) for name, command in CHECKS.items()}
    if not options.no_install:
        results["clean install"] = _clean_install()
    for name, passed in results.items():
        print(f"{'passed' if passed else 'FAILED'}  {name}")
    return 0 if all(results.values()) else 1


def _timed(name: str, command: list[str], folder: Path = ROOT, environment: dict[str, str] | None = None) -> bool:
    """Run one command; True when it ends with 0."""
    print(f"== {name}", flush=True)
    begin = time.monotonic()
    code = subprocess.run(command, cwd=folder, check=False, env={**os.environ, **(environment or {})}).returncode
    print(f"== {name}: exit code {code}, {time.monotonic() - begin:.0f} s", flush=True)
    return code == 0


def oldest() -> list[str]:
    """Constraints that hold every package ffseg runs with, and of its extras, at the first minor version allowed."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"], *(line for name in extras if name not in DEVELOPMENT for line in extras[name])]
    found = [re.match(r"([\w-]+)(?:\[\w+\])?>=(\d+)(?:\.(\d+))?", line) for line in wanted]
    return [f"{one[1]}=={one[2]}.{one[3] or 0}.*" for one in found if one]


def _with_dependencies(which: str, arguments: list[str]) -> bool:
    """Run the tests in a new environment with the oldest or the newest dependencies."""
    with tempfile.TemporaryDirectory(prefix=f"ffseg-{which}-") as temporary:
        folder = Path(temporary)
        venv.create(folder / "venv", with_pip=True)
        scripts = folder / "venv" / SCRIPTS.name
        python = str(scripts / Path(sys.executable).name)
        constraints = folder / "constraints.txt"
        constraints.write_text("".join(f"{line}\n" for line in (oldest() if which == "oldest" else [])))
        install = ["install", "--quiet", "--upgrade", "--constraint", str(constraints), "-e", f"{ROOT}[test]"]
        passed = _timed(f"{which} dependencies", [python, "-m", "pip", *install])
        subprocess.run([python, "-m", "pip", "list"], check=False)
        environment = {"PATH": f"{scripts}{os.pathsep}{os.environ['PATH']}"}
        tests = [python, "-m", "pytest", "-n", "2", "-q", *arguments]
        return passed and _timed(f"tests with the {which} dependencies", tests, environment=environment)


def _clean_install() -> bool:
    """Install without the test packages into a new environment and run the command line on the samples."""
    with tempfile.TemporaryDirectory(prefix="ffseg-check-") as temporary:
        folder = Path(temporary)
        venv.create(folder / "venv", with_pip=True)
        scripts = folder / "venv" / SCRIPTS.name
        python = str(scripts / Path(sys.executable).name)
        if not _timed("install", [python, "-m", "pip", "install", "--quiet", str(ROOT)], folder):
            return False
        found = f"import importlib.util as u; print([n for n in {TEST_ONLY} if u.find_spec(n)])"
        present = subprocess.run([python, "-c", found], cwd=folder, check=True, capture_output=True, text=True).stdout
        print(f"test packages in the clean install: {present.strip()}")
        tried = [_timed(" ".join(use), use, folder) for use in _uses(scripts / "ffseg")]
        tried.append(_timed("python in the sources", [python, "-c", IN_SOURCES]))
        quick = [str(scripts / "ffseg"), "bench", "--quick", "--suite", "startup", "--out", str(folder / "bench")]
        tried.append(_timed("bench in the sources", quick))
        return present.strip() == "[]" and all(tried) and _documented(scripts, folder)


def _documented(scripts: Path, folder: Path) -> bool:
    """Run the commands and the Python code of every page with that installation: in zsh, as the tests run them in bash."""
    shell = "zsh" if shutil.which("zsh") else "bash"
    passed = True
    for page in documented.pages():
        place = folder / f"{page.parent.name}-{page.stem}"
        environment = documented.prepare(place, page, scripts)
        wrong = [
            text for block in documented.blocks(page) if (text := documented.run(block, shell, place, environment))
        ]
        print(f"== {page.name} in {shell}: {'; '.join(wrong) or 'every block runs'}", flush=True)
        passed = passed and not wrong
    return passed


def _uses(ffseg: Path) -> list[list[str]]:
    """What a user does first."""
    samples = ROOT / "samples"
    return [
        [str(ffseg), "--help"],
        [str(ffseg), "config", "check", "default", "toy-full"],
        [str(ffseg), "run", str(samples), "--out", "out", "--truth", str(samples / "truth")],
    ]


if __name__ == "__main__":
    sys.exit(main())
