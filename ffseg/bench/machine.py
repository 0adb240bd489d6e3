"""What a run was measured on: versions, processor, load."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from ffseg import __version__
from ffseg.image.reference import opencv_version

PACKAGES = ("typer", "matplotlib", "scikit-image", "SimpleITK", "scikit-fmm")


def machine() -> dict[str, object]:
    """Processor, cores, system and load, nothing that names the machine or its user."""
    return {
        "processor": _processor(),
        "architecture": platform.machine(),
        "cores": os.cpu_count(),
        "system": platform.system(),
        "load": [round(value, 2) for value in os.getloadavg()] if hasattr(os, "getloadavg") else [],
    }


def versions() -> dict[str, str]:
    """Versions of ffseg, Python and what takes part in the measuring; packages that are absent are left out."""
    found = {
        "ffseg": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "opencv": opencv_version(),
    }
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor())
