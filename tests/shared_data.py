"""The optional folder of real images: ``FFSEG_DATA``, or ``../shared/data`` beside the repository."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


def shared_data(name: str) -> Path:
    """A folder of the real images; the test is skipped, with its reason, where it is absent."""
    root = os.environ.get("FFSEG_DATA") or Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(root) / name
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent; set FFSEG_DATA to the folder that holds {name}")
    return folder
