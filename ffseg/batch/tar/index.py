"""What a tar file holds, read for its report; one that is none holds nothing."""

from __future__ import annotations

import tarfile
from itertools import islice
from pathlib import Path
from typing import Any

from ffseg.batch.tar.members import Member


def listed(folder: Path, name: str, most: int) -> dict[str, Member]:
    """Places of the first so many regular members of a tar file in a folder, by name."""
    found: dict[str, Member] = {}
    if not (folder / name).is_file():
        return found
    try:
        with tarfile.open(folder / name, "r:", encoding="utf-8", errors="surrogateescape") as archive:
            kept: Any = archive
            for member in islice(archive, most):
                kept.members = []  # it would keep them all
                if member.isreg() and not member.issparse():
                    found[member.name] = (name, member.offset_data, member.size)
    except (tarfile.TarError, OSError, ValueError):
        return found
    return found
