"""Domains by the names of their images: one mask an image, or one for all images of a folder, as of one camera."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator

from ffseg.batch.discover import SUFFIXES, Source
from ffseg.errors import UsageError
from ffseg.formats.files import printable


def find_domains(sources: Iterable[Source], folder: str) -> dict[str, str]:
    """Mask of each image: of its own relative name with any suffix, else of the nearest folder round it.

    For ``left/day1/a.jpg`` the first there is of ``left/day1/a.png``, ``left/day1.png``, ``left.png``.

    Raises
    ------
    UsageError
        If the folder does not exist, or an image has no mask in it.
    """
    if not os.path.isdir(folder):
        raise UsageError(f"domain.masks: there is no folder {printable(folder)}; check the name")
    listings: dict[str, dict[str, str]] = {}
    found = {}
    for source in sources:
        paths = (_mask(name, folder, listings) for name in _names(source.name))
        path = next((path for path in paths if path and not _same(path, source.path)), "")
        if not path:
            raise UsageError(
                f"domain.masks: {printable(source.name)} has no mask of its name or of its folder's in "
                f"{printable(folder)} (NAME.png or FOLDER.png)"
            )
        found[source.name] = path
    return found


def _names(name: str) -> Iterator[str]:
    """The name without its suffix, then the folders it lies in, the innermost first."""
    yield os.path.splitext(name)[0]
    while "/" in name:
        name = name.rsplit("/", 1)[0]
        yield name


def _mask(name: str, folder: str, listings: dict[str, dict[str, str]]) -> str:
    place, stem = os.path.split(name)
    if place not in listings:
        listings[place] = _by_stem(os.path.join(folder, place))
    return listings[place].get(stem, "")


def _by_stem(folder: str) -> dict[str, str]:
    try:
        names = sorted(os.listdir(folder), reverse=True)
    except OSError:
        return {}
    parts = (os.path.splitext(name) for name in names)
    return {stem: os.path.join(folder, stem + end) for stem, end in parts if end.lower() in SUFFIXES}


def _same(path: str, image: str) -> bool:
    return os.path.realpath(path) == os.path.realpath(image)
