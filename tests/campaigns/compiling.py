"""The native core compiled by the plain C++ compiler with any flags: as objects, and as the Python module."""

import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CORE = ROOT / "ffseg" / "native"
DRIVER = Path(__file__).resolve().parent / "native"
ALWAYS = ("-std=c++17", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math")
"""As the core is built, but for what a build is there to find."""
WARNINGS = ("-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Wno-sign-conversion", "-Werror")


def tests_with(*words: str) -> list[str]:
    """Command of tests with what ``other_core`` puts in the place of the installed core."""
    return [sys.executable, "-m", "pytest", "-q", "-p", "tests.campaigns.other_core", "-p", "no:cacheprovider", *words]


class NoCompilerError(RuntimeError):
    """There is no compiler here that takes the flags."""


def compiler() -> list[str]:
    """Command of the C++ compiler: that of the environment variable ``CXX``, or ``c++``.

    Raises
    ------
    NoCompilerError
    """
    command = shlex.split(os.environ.get("CXX", "c++"))
    if shutil.which(command[0]) is None:
        raise NoCompilerError(f"there is no C++ compiler {command[0]}; name one in CXX")
    return command


@dataclass(frozen=True)
class Build:
    """A way to build the core: flags of the compiler, and of the linker."""

    flags: tuple[str, ...]
    links: tuple[str, ...] = ()

    def check(self) -> None:
        """Raise ``NoCompilerError`` where the compiler does not take the flags."""
        command = [*compiler(), *self.flags, *self.links]
        source = b"int main() {}\n"
        done = subprocess.run(
            [*command, "-x", "c++", "-", "-o", os.devnull], input=source, capture_output=True, check=False
        )
        if done.returncode != 0:
            raise NoCompilerError(f"{shlex.join(command)} does not build: {done.stderr.decode()[-200:]}")

    def core(self, work: Path) -> list[Path]:
        sources = (path for path in CORE.rglob("*.cpp") if not path.name.startswith("bind"))
        return self.objects(work, sorted(sources), (f"-I{CORE}",))

    def module(self, work: Path) -> Path:
        import nanobind

        source = Path(nanobind.source_dir())
        options = (
            f"-I{CORE}", f"-isystem{nanobind.include_dir()}", f"-isystem{sysconfig.get_path('include')}",
            f"-isystem{source.parent / 'ext' / 'robin_map' / 'include'}", "-fno-strict-aliasing",
        )  # fmt: skip
        bindings = self.objects(work, sorted(CORE.rglob("bind*.cpp")), options)
        library = Build(tuple(flag for flag in self.flags if flag not in WARNINGS))  # not ours to mend
        parts = [*self.core(work), *bindings, *library.objects(work, [source / "nb_combined.cpp"], options)]
        return self.linked(work / "_core.so", parts, "-shared")

    def objects(self, work: Path, sources: Sequence[Path], options: Iterable[str]) -> list[Path]:
        """Objects of sources; those of the same content, headers and flags are taken from an earlier build."""
        work.mkdir(parents=True, exist_ok=True)
        command = [*compiler(), *self.flags, *options]
        common = hashlib.sha256(shlex.join(command).encode())
        for folder in (CORE, DRIVER):
            for header in sorted(folder.rglob("*.hpp")) if f"-I{folder}" in command else ():
                common.update(header.read_bytes())

        def one(source: Path) -> Path:
            digest = common.copy()
            digest.update(source.read_bytes())
            made = work / f"{source.stem}-{digest.hexdigest()[:16]}.o"
            if not made.exists():
                _compile(command, source, made)
            return made

        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
        with ThreadPoolExecutor(cores) as pool:
            return list(pool.map(one, sources))

    def linked(self, target: Path, objects: Iterable[Path], *options: str) -> Path:
        command = [*compiler(), *self.links, *options, *map(str, objects), "-o", str(target)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"{target.name} cannot be linked: {done.stderr[-2000:]}")
        return target


def _compile(command: list[str], source: Path, target: Path) -> None:
    half = target.with_suffix(".tmp")
    done = subprocess.run([*command, "-c", str(source), "-o", str(half)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{source} does not compile: {done.stderr[-2000:]}")
    half.replace(target)
