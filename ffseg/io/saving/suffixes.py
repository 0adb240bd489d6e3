"""Which output the suffix of a file name asks for."""

from __future__ import annotations

import os
from collections.abc import Sequence

from ffseg.errors import OutputError

SUFFIXES = {
    ".png": "mask",
    ".svg": "svg",
    ".geojson": "geojson",
    ".json": "coco",
    ".jpg": "overlay",
    ".jpeg": "overlay",
    ".webp": "overlay",
}
"""Kind of a file by its suffix."""


def kind_of(path: str, kinds: Sequence[str] = ()) -> str:
    """Kind of output a file name asks for.

    Raises
    ------
    OutputError
        If the suffix stands for none, or not for one of `kinds`.
    """
    suffix = os.path.splitext(path)[1].lower()
    known = {end: kind for end, kind in SUFFIXES.items() if not kinds or kind in kinds}
    if kinds and "overlay" in kinds:  # whose format is not taken for the mask's where nothing else is meant
        known = {".png": "overlay"} | known
    if suffix not in known:
        named = ", ".join(f"{end} ({kind})" for end, kind in known.items())
        wrong = f"the suffix {suffix} stands for no output" if suffix else "there is no suffix"
        raise OutputError(f"{path or 'the name of the output is empty'}: {wrong}; write one of {named}")
    return known[suffix]
