"""True masks by the names of their images."""

from __future__ import annotations

import os
from collections.abc import Iterable

from ffseg.batch.discover import SUFFIXES, Source
from ffseg.errors import UsageError
from ffseg.formats.files import printable


def find_truths(sources: Iterable[Source], folder: str) -> dict[str, str]:
    """True mask of each image that has one: the same relative name with any suffix, or with ``_truth`` before it.

    Raises
    ------
    UsageError
        If the folder does not exist, or no image has a true mask in it.
    """
    if not os.path.isdir(folder):
        raise UsageError(f"--truth: there is no folder {printable(folder)}; check the name")
    listings: dict[str, dict[str, str]] = {}
    truths = {}
    for source in sources:
        place, name = os.path.split(source.name)
        if place not in listings:
            listings[place] = _masks_by_stem(os.path.join(folder, place))
        stem = os.path.splitext(name)[0]
        path = listings[place].get(f"{stem}_truth") or listings[place].get(stem, "")
        if path and os.path.realpath(path) != os.path.realpath(source.path):
            truths[source.name] = path
    if not truths:
        raise UsageError(
            f"--truth: no image has a mask of its name in {printable(folder)} (NAME.png or NAME_truth.png)"
        )
    return truths


def _masks_by_stem(folder: str) -> dict[str, str]:
    try:
        names = sorted(os.listdir(folder), reverse=True)
    except OSError:
        return {}
    stems = (os.path.splitext(name) for name in names)
    return {stem: os.path.join(folder, stem + suffix) for stem, suffix in stems if suffix.lower() in SUFFIXES}
