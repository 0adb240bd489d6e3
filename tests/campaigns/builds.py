"""The native core built otherwise: without optimisation and with checked indices, and as one unit with warnings as errors.

``python tests/campaigns/builds.py --work DIR [--only debug|lto]``

The first build runs the tests of the native code: what an optimiser hides, such as two definitions of one name, shows
there. The second lets the compiler see all sources at once, which compares their definitions. Objects are kept in DIR.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import harness
from compiling import ALWAYS, ROOT, WARNINGS, Build

DEBUG = Build((*ALWAYS, *WARNINGS, "-O0", "-g1", "-D_GLIBCXX_ASSERTIONS"))
LTO = Build(
    (*ALWAYS, *WARNINGS, "-O1", "-flto"),  # definitions are compared at any level
    ("-O1", "-flto=auto", "-Wodr", "-Wlto-type-mismatch", "-Werror"),
)
NATIVE_TESTS = (
    "tests/unit/test_core_regressions.py", "tests/unit/test_freeform_evolution.py", "tests/unit/test_freeform_steps.py",
    "tests/unit/test_interest.py",
    "tests/unit/test_levelset.py", "tests/unit/test_metrics.py", "tests/unit/test_raster.py", "tests/unit/test_snake.py",
    "tests/property/test_edges_twin.py", "tests/property/test_levelset_twin.py", "tests/property/test_paper_twin.py",
    "tests/property/test_raster_properties.py", "tests/property/test_snake_twin.py",
)  # fmt: skip
"""The tests that call every room of the core."""


def debug(work: Path) -> int:
    """Build without optimisation and run the native tests with that module; the exit code of pytest."""
    core = DEBUG.module(work / "debug")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "other_core", "-p", "no:cacheprovider", *NATIVE_TESTS]
    paths = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    env = {**os.environ, "FFSEG_OTHER_CORE": str(core), "PYTHONPATH": paths}
    return subprocess.run(command, cwd=ROOT, env=env, check=False).returncode


def lto(work: Path) -> int:
    """Build and link as one unit; a warning is an error."""
    LTO.module(work / "lto")
    return 0


BUILDS = {"debug": debug, "lto": lto}


def main() -> int:
    """Make the builds; 1 when one of them fails."""
    arguments = harness.parser(__doc__)
    arguments.add_argument("--only", choices=tuple(BUILDS))
    given = arguments.parse_args()
    failed = 0
    for name in [given.only] if given.only else BUILDS:
        begin = time.monotonic()
        code = BUILDS[name](given.work)
        harness.say(f"{name}: exit code {code}, {time.monotonic() - begin:.0f} s")
        failed |= code != 0
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
