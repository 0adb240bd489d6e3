"""Where the real images are that tests and campaigns use where they are at hand."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def data_folder() -> Path:
    """The folder that the environment variable FFSEG_DATA names; unset or empty, the one beside the project."""
    return Path(os.environ.get("FFSEG_DATA") or ROOT.parent / "shared" / "data")
