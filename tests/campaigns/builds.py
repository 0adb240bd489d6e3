"""The native core built otherwise: without optimisation, in plain C++, and as one unit with warnings as errors.

``python -m tests.campaigns.builds --work DIR [--only debug|plain|lto]``

The first build checks indices and runs the tests of the native code: what an optimiser hides, such as two definitions
of one name, shows there. The second leaves out what only some compilers know, as MSVC does, and must give the bytes of the
installed core. The third lets the compiler see all sources at once, which compares their definitions. Objects are kept
in DIR.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

from tests.campaigns import harness
from tests.campaigns.compiling import ALWAYS, ROOT, WARNINGS, Build, tests_with

DEBUG = Build((*ALWAYS, *WARNINGS, "-O0", "-g1", "-D_GLIBCXX_ASSERTIONS"))
PLAIN = Build((*ALWAYS, "-pedantic-errors", "-O2", "-DFFSEG_PLAIN"))
LTO = Build(
    (*ALWAYS, *WARNINGS, "-O1", "-flto"),  # definitions are compared at any level
    ("-O1", "-flto=auto", "-Wodr", "-Wlto-type-mismatch", "-Werror"),
)
NATIVE_TESTS = tuple(
    f"tests/unit/test_{name}.py"
    for name in (
        "freeform_evolution", "freeform_steps", "interest", "levelset", "metrics", "raster", "snake", "edges", "paper",
    )
)  # fmt: skip
"""The tests that call every room of the core."""
SAME_BYTES = """
import hashlib
import ffseg
from ffseg.samples.scenes import SCENES
digest = hashlib.blake2b()
settings = [{"method": name} for name in ("freeform", "snake", "levelset", "paper")]
settings += [{"edges.source": "prior"}, {"region.weight": 1.0}, *({"contour.degree": degree} for degree in (1, 2, 4, 5, 6))]
for draw in SCENES.values():
    for one in settings:
        result = ffseg.segment(draw().image, ffseg.load_params(None, one))
        digest.update(result.mask.tobytes() + b"".join(c.control_points.tobytes() for c in result.contours))
print(digest.hexdigest())
"""
"""Prints one number for what every method makes of the drawn scenes."""


def debug(work: Path) -> int:
    """Build without optimisation and run the native tests with that module; the exit code of pytest."""
    return subprocess.run(
        tests_with(*NATIVE_TESTS), cwd=ROOT, env=_with(DEBUG.module(work / "debug")), check=False
    ).returncode


def plain(work: Path) -> int:
    """Build without extensions of a compiler; 1 when a method gives other bytes than with them."""
    env = _with(PLAIN.module(work / "plain"))
    found = [
        subprocess.run([sys.executable, "-c", lead + SAME_BYTES], cwd=ROOT, env=env, check=True, capture_output=True)
        for lead in ("", "from tests.campaigns import other_core\n")
    ]
    return int(found[0].stdout != found[1].stdout)


def _with(core: Path) -> dict[str, str]:
    """Environment in which the plugin ``other_core`` puts a module in the place of the installed one."""
    return {**os.environ, "FFSEG_OTHER_CORE": str(core)}


def lto(work: Path) -> int:
    """Build and link as one unit; a warning is an error."""
    LTO.module(work / "lto")
    return 0


BUILDS = {"debug": debug, "plain": plain, "lto": lto}


def main(work: harness.Work, only: str | None = None) -> int:
    """Make the builds; 1 when one of them fails."""
    failed = 0
    for name in [only] if only else BUILDS:
        begin = time.monotonic()
        code = BUILDS[name](work)
        harness.say(f"{name}: exit code {code}, {time.monotonic() - begin:.0f} s")
        failed |= code != 0
    return int(failed)


if __name__ == "__main__":
    harness.as_command(main)
