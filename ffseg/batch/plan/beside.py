"""Files that belong to images by their names, in another folder or tar file: true masks, maps of evidence, domains."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator

from ffseg.batch.plan.archives import is_archive, members
from ffseg.batch.plan.sources import SUFFIXES, Source
from ffseg.errors import UsageError
from ffseg.io.files import printable

ARRAY_SUFFIX = ".npy"
"""Of maps that are no images."""


class Beside:
    """A folder of such files, or a tar file made of one.

    Parameters
    ----------
    option : str
        Names the folder in messages.
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
        self.option, self.folder, self._suffixes = option, folder, suffixes
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
            self._listings[place] = {} if self._packed else self._by_stem(os.path.join(self.folder, place))
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


def find_truths(sources: Iterable[Source], folder: str) -> dict[str, str]:
    """True mask of each image that has one: the same relative name with any suffix, or with ``_truth`` before it.

    In a folder or a tar file; what is given is for `read_input`.

    Raises
    ------
    UsageError
        If there is no such folder or tar file, or no image has a true mask in it.
    """
    beside = Beside("--truth", folder, packed=True)
    truths = {}
    for source in sources:
        stem = os.path.splitext(source.name)[0]
        path = beside.file_of(source, (f"{stem}_truth", stem))
        if path:
            truths[source.name] = path
    if not truths:
        raise UsageError(
            f"--truth: no image has a mask of its name in {printable(folder)} (NAME.png or NAME_truth.png)"
        )
    return truths


def find_evidence(sources: Iterable[Source], folder: str) -> dict[str, str]:
    """Map of each image: the same relative name with the suffix of an image or ``.npy``, in a folder or a tar file.

    Raises
    ------
    UsageError
        If there is no such folder or tar file, or an image has no map in it.
    """
    beside = Beside("--evidence", folder, {*SUFFIXES, ARRAY_SUFFIX}, packed=True)
    missing = "has no map of its name in {} (NAME.png, NAME.tiff or NAME.npy)"
    return _of_each(sources, beside, lambda name: (os.path.splitext(name)[0],), missing)


def find_domains(sources: Iterable[Source], folder: str) -> dict[str, str]:
    """Mask of each image: of its own relative name with any suffix, else of the nearest folder round it.

    For ``left/day1/a.jpg`` the first there is of ``left/day1/a.png``, ``left/day1.png``, ``left.png``.

    Raises
    ------
    UsageError
        If the folder does not exist, or an image has no mask in it.
    """
    missing = "has no mask of its name or of its folder's in {} (NAME.png or FOLDER.png)"
    return _of_each(sources, Beside("domain.masks", folder), _own_or_folders, missing)


def _of_each(
    sources: Iterable[Source], beside: Beside, stems: Callable[[str], Iterable[str]], missing: str
) -> dict[str, str]:
    found = {source.name: beside.file_of(source, stems(source.name)) for source in sources}
    without = next((name for name, path in found.items() if not path), None)
    if without is not None:
        raise UsageError(f"{beside.option}: {printable(without)} {missing.format(printable(beside.folder))}")
    return found


def _own_or_folders(name: str) -> Iterator[str]:
    """The name without its suffix, then the folders it lies in, the innermost first."""
    yield os.path.splitext(name)[0]
    while "/" in name:
        name = name.rsplit("/", 1)[0]
        yield name
