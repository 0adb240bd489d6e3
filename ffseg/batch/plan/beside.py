"""Files that belong to images by their names: the same relative name in another folder or tar file, with a suffix of its own."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable

from ffseg.batch.plan.archives import is_archive, members
from ffseg.batch.plan.discover import SUFFIXES, Source
from ffseg.errors import UsageError
from ffseg.io.files import printable


class Beside:
    """A folder of such files, or a tar file made of one.

    Parameters
    ----------
    option : str
        Names the folder in messages.
    folder : str
    suffixes : collection of str
        In lower case. Of files that differ in nothing else, the first by name counts.
    packed : bool
        Whether it may be a tar file.

    Raises
    ------
    UsageError
        If the folder does not exist, or the tar file cannot be read in place.
    """

    def __init__(self, option: str, folder: str, suffixes: Collection[str] = SUFFIXES, *, packed: bool = False) -> None:
        self._folder, self._suffixes = folder, suffixes
        self._listings: dict[str, dict[str, str]] = {}
        self._packed = packed and is_archive(folder) and os.path.isfile(folder)
        if self._packed:
            for source in sorted(members(folder, suffixes), key=_name, reverse=True):
                place, name = os.path.split(os.path.splitext(source.name)[0])
                self._listings.setdefault(place, {})[name] = source.content
        elif not os.path.isdir(folder):
            what = "folder or tar file" if packed else "folder"
            raise UsageError(f"{option}: there is no {what} {printable(folder)}; check the name")

    def file_of(self, source: Source, stems: Iterable[str]) -> str:
        """Path of the first file there is, other than the image itself, with one of these names without suffix; or empty.

        Of a member in a tar file what `read_input` takes.
        """
        own = os.path.realpath(source.content)
        paths = (self._path(stem) for stem in stems)
        return next((path for path in paths if path and os.path.realpath(path) != own), "")

    def _path(self, stem: str) -> str:
        place, name = os.path.split(stem)
        if place not in self._listings:
            self._listings[place] = {} if self._packed else self._by_stem(os.path.join(self._folder, place))
        return self._listings[place].get(name, "")

    def _by_stem(self, folder: str) -> dict[str, str]:
        try:
            names = sorted(os.listdir(folder), reverse=True)
        except OSError:
            return {}
        parts = (os.path.splitext(name) for name in names)
        return {stem: os.path.join(folder, stem + end) for stem, end in parts if end.lower() in self._suffixes}


def _name(source: Source) -> str:
    return source.name
