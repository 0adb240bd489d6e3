"""The native core compiled under ASan and UBSan by the plain C++ compiler: as a program that fuzzes it, and as a module."""

import os
import subprocess
from pathlib import Path

from tests.campaigns.compiling import ALWAYS, CORE, DRIVER, Build, compiler

SANITIZERS = "-fsanitize=address,undefined,float-cast-overflow"
"""Casts of numbers that do not fit are undefined, but not part of ``undefined`` in every compiler."""
FLAGS = (
    *ALWAYS, "-O1", "-g1", "-fno-omit-frame-pointer", SANITIZERS, "-fno-sanitize-recover=all", "-D_GLIBCXX_ASSERTIONS",
)  # fmt: skip
"""As the core is built, but with the sanitizers: a finding ends the process."""
BUILD = Build(FLAGS, (SANITIZERS,))
WHAT_ASAN_SEES = "-fno-sanitize=null,alignment,object-size"
"""Looked at before each use of a member: nearly half of the compiling. What is used through such a pointer ASan finds too."""
FOR_FEW = Build((*("-O0" if flag == "-O1" else flag for flag in FLAGS), WHAT_ASAN_SEES), BUILD.links)
"""Compiled in a third of the time and several times as slow: for so few cases that compiling is what takes long."""
ENVIRONMENT = {
    "ASAN_OPTIONS": "handle_abort=1:malloc_context_size=4:quarantine_size_mb=16:detect_leaks={leaks}"
    ":allocator_may_return_null=1",
    "UBSAN_OPTIONS": "print_stacktrace=1",
}


def environment(leaks: bool) -> dict[str, str]:
    return {**os.environ, **{name: text.format(leaks=int(leaks)) for name, text in ENVIRONMENT.items()}}


def build_driver(work: Path, build: Build = BUILD) -> Path:
    """Compile the program that fuzzes the core without Python."""
    build.check()
    driver = build.objects(work, sorted(DRIVER.glob("*.cpp")), (f"-I{CORE}", f"-I{DRIVER}"))
    return build.linked(work / "fuzz", [*build.core(work), *driver])


def libraries() -> str:
    """Libraries to load before Python when it loads the module."""
    names = ("libasan.so", "libubsan.so")
    found = [
        subprocess.run([*compiler(), f"-print-file-name={name}"], capture_output=True, text=True, check=True)
        for name in names
    ]
    return " ".join(done.stdout.strip() for done in found)
