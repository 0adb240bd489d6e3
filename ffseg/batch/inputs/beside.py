"""Files that belong to images by their names: the same relative name in another folder, with a suffix of its own."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable

from ffseg.batch.discover import SUFFIXES, Source
from ffseg.errors import UsageError
from ffseg.formats.files import printable


class Beside:
    """A folder of such files.

    Parameters
    ----------
    option : str
        Names the folder in messages.
    folder : str
    suffixes : collection of str
        In lower case. Of files that differ in nothing else, the first by name counts.

    Raises
    ------
    UsageError
        If the folder does not exist.
    """

    def __init__(self, option: str, folder: str, suffixes: Collection[str] = SUFFIXES) -> None:
        if not os.path.isdir(folder):
            raise UsageError(f"{option}: there is no folder {printable(folder)}; check the name")
        self._folder, self._suffixes = folder, suffixes
        self._listings: dict[str, dict[str, str]] = {}

    def file_of(self, source: Source, stems: Iterable[str]) -> str:
        """Path of the first file there is, other than the image itself, with one of these names without suffix; or empty."""
        own = os.path.realpath(source.path)
        paths = (self._path(stem) for stem in stems)
        return next((path for path in paths if path and os.path.realpath(path) != own), "")

    def _path(self, stem: str) -> str:
        place, name = os.path.split(stem)
        if place not in self._listings:
            self._listings[place] = self._by_stem(os.path.join(self._folder, place))
        return self._listings[place].get(name, "")

    def _by_stem(self, folder: str) -> dict[str, str]:
        try:
            names = sorted(os.listdir(folder), reverse=True)
        except OSError:
            return {}
        parts = (os.path.splitext(name) for name in names)
        return {stem: os.path.join(folder, stem + end) for stem, end in parts if end.lower() in self._suffixes}
