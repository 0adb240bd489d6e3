"""The native core compiled under ASan and UBSan by the plain C++ compiler: as a program that fuzzes it, and as a module."""

from __future__ import annotations

import hashlib
import os
import shlex
import shutil
import subprocess
import sysconfig
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CORE = ROOT / "ffseg" / "native"
DRIVER = Path(__file__).resolve().parent / "native"
SANITIZERS = "-fsanitize=address,undefined,float-cast-overflow"
"""Casts of numbers that do not fit are undefined, but not part of ``undefined`` in every compiler."""
FLAGS = (
    "-std=c++17", "-O1", "-g1", "-fPIC", "-fvisibility=hidden", "-fno-omit-frame-pointer", SANITIZERS,
    "-fno-sanitize-recover=all", "-D_GLIBCXX_ASSERTIONS", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math",
)  # fmt: skip
"""As the core is built, but with the sanitizers: a finding ends the process."""
ENVIRONMENT = {
    "ASAN_OPTIONS": "handle_abort=1:malloc_context_size=4:quarantine_size_mb=16:detect_leaks={leaks}"
    ":allocator_may_return_null=1",
    "UBSAN_OPTIONS": "print_stacktrace=1",
}


class NoSanitizersError(RuntimeError):
    """There is no compiler here that builds with the sanitizers."""


def compiler() -> list[str]:
    """Command of the C++ compiler: that of the environment variable ``CXX``, or ``c++``.

    Raises
    ------
    NoSanitizersError
    """
    command = shlex.split(os.environ.get("CXX", "c++"))
    if shutil.which(command[0]) is None:
        raise NoSanitizersError(f"there is no C++ compiler {command[0]}; name one in CXX")
    probe = subprocess.run(
        [*command, *FLAGS, "-x", "c++", "-", "-o", os.devnull],
        input=b"int main() {}\n", capture_output=True, check=False,
    )  # fmt: skip
    if probe.returncode != 0:
        raise NoSanitizersError(f"{command[0]} cannot build with {SANITIZERS}: {probe.stderr.decode()[-200:]}")
    return command


def environment(leaks: bool) -> dict[str, str]:
    """Environment of a process under the sanitizers."""
    return {**os.environ, **{name: text.format(leaks=int(leaks)) for name, text in ENVIRONMENT.items()}}


def build_driver(work: Path) -> Path:
    """Compile the program that fuzzes the core without Python."""
    driver = _compiled(work, sorted(DRIVER.glob("*.cpp")), (f"-I{CORE}", f"-I{DRIVER}"))
    return _linked(work / "fuzz", [*_core(work), *driver])


def build_module(work: Path) -> Path:
    """Compile the core as the Python module ``_core``."""
    import nanobind

    source = Path(nanobind.source_dir())
    options = (
        f"-I{CORE}", f"-isystem{nanobind.include_dir()}", f"-isystem{sysconfig.get_path('include')}",
        f"-isystem{source.parent / 'ext' / 'robin_map' / 'include'}", "-fno-strict-aliasing",
    )  # fmt: skip
    bindings = _compiled(work, [*sorted(CORE.rglob("bind*.cpp")), source / "nb_combined.cpp"], options)
    return _linked(work / "_core.so", [*_core(work), *bindings], "-shared")


def libraries() -> str:
    """Libraries to load before Python when it loads the module."""
    names = ("libasan.so", "libubsan.so")
    found = [
        subprocess.run([*compiler(), f"-print-file-name={name}"], capture_output=True, text=True, check=True)
        for name in names
    ]
    return " ".join(done.stdout.strip() for done in found)


def _core(work: Path) -> list[Path]:
    sources = (path for path in CORE.rglob("*.cpp") if not path.name.startswith("bind"))
    return _compiled(work, sorted(sources), (f"-I{CORE}",))


def _compiled(work: Path, sources: Sequence[Path], options: Iterable[str]) -> list[Path]:
    """Objects of sources; those of the same content, headers and flags are taken from an earlier build."""
    work.mkdir(parents=True, exist_ok=True)
    command = [*compiler(), *FLAGS, *options]
    common = hashlib.sha256(shlex.join(command).encode())
    for folder in (CORE, DRIVER):
        for header in sorted(folder.rglob("*.hpp")) if f"-I{folder}" in command else ():
            common.update(header.read_bytes())

    def one(source: Path) -> Path:
        digest = common.copy()
        digest.update(source.read_bytes())
        made = work / f"{source.stem}-{digest.hexdigest()[:16]}.o"
        if not made.exists():
            half = made.with_suffix(".tmp")
            done = subprocess.run(
                [*command, "-c", str(source), "-o", str(half)], capture_output=True, text=True, check=False
            )
            if done.returncode != 0:
                raise RuntimeError(f"{source} does not compile: {done.stderr[-2000:]}")
            half.replace(made)
        return made

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    with ThreadPoolExecutor(cores) as pool:
        return list(pool.map(one, sources))


def _linked(target: Path, objects: Iterable[Path], *options: str) -> Path:
    subprocess.run([*compiler(), SANITIZERS, *options, *map(str, objects), "-o", str(target)], check=True)
    return target
