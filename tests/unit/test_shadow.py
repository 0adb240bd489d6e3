"""A folder with the sources, found before the installed package, gives way to it: only that has the compiled core."""

import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

import ffseg
from ffseg.native import _core

SOURCES = Path(ffseg.__file__).parent
CORE = Path(_core.__file__)
LIBRARIES = [str(Path(module.__file__).parent.parent) for module in (np, cv2)]


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A clone that is not built, and a place where the package is installed."""
    clone, site = tmp_path_factory.mktemp("clone"), tmp_path_factory.mktemp("site")
    for place in (clone, site):
        shutil.copytree(
            SOURCES, place / "ffseg", ignore=shutil.ignore_patterns("*.cpp", "*.hpp", "__pycache__", CORE.name)
        )
    shutil.copyfile(CORE, site / "ffseg" / "native" / CORE.name)
    return clone, site


def python(clone: Path, places: list[str], *command: str) -> subprocess.CompletedProcess[str]:
    """Run Python in the clone, as a user does: the working directory comes first, what is installed later."""
    environment = {"PYTHONPATH": ":".join(["", *places]), "PATH": "/usr/bin:/bin"}
    return subprocess.run(
        [sys.executable, "-S", *command], cwd=clone, env=environment, capture_output=True, text=True, check=False
    )


def test_python_in_the_clone_uses_the_installed_package(folders: tuple[Path, Path]) -> None:
    clone, site = folders
    code = "import numpy, ffseg; print(ffseg.__file__); from ffseg.native import _core; print(_core.__file__)"
    done = python(clone, [str(site), *LIBRARIES], "-c", code)
    assert done.returncode == 0, done.stderr
    assert all(line.startswith(str(site)) for line in done.stdout.split())


def test_python_m_in_the_clone_uses_the_installed_package(folders: tuple[Path, Path]) -> None:
    clone, site = folders
    done = python(clone, [str(site), *LIBRARIES], "-m", "ffseg.batch.workers.process")
    assert "No module named" not in done.stderr
    shown = python(clone, [str(site), *LIBRARIES], "-c", "import ffseg.errors; print(ffseg.errors.__file__)")
    assert shown.stdout.startswith(str(site))


def test_sources_alone_stay_what_they_are(folders: tuple[Path, Path]) -> None:
    clone, _ = folders
    done = python(clone, [], "-c", "import ffseg; print(ffseg.__file__, ffseg.__version__)")
    assert done.stdout.split() == [str(clone / "ffseg" / "__init__.py"), ffseg.__version__]
