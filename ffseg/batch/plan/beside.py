"""Files matched to images by their names, from another folder or tar file: true masks, evidence maps, domains."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from functools import cached_property
from operator import attrgetter

from ffseg.batch.plan.archives import is_archive, members
from ffseg.batch.plan.reading import display_path
from ffseg.batch.plan.sources import SUFFIXES, InputImage
from ffseg.errors import UsageError
from ffseg.io.files import printable

ARRAY_SUFFIX = ".npy"
"""Of maps that are no images."""


class SiblingFiles:
    """A folder of such files, or a tar file made of one.

    Parameters
    ----------
    option : str
        Names the folder in messages.
    sources : sequence of Source
        The images.
    suffixes : collection of str
        In lower case.
    packed : bool
        Whether it may be a tar file.

    Raises
    ------
    UsageError
        If the folder does not exist, or the tar file cannot be read in place.
    """

    def __init__(
        self,
        option: str,
        folder: str,
        sources: Sequence[InputImage],
        suffixes: Collection[str] = SUFFIXES,
        *,
        packed: bool = False,
    ) -> None:
        self.option, self.folder, self.sources, self._suffixes = option, folder, sources, suffixes
        self._listings: dict[str, dict[str, list[str]]] = {}
        self._packed = packed and is_archive(folder) and os.path.isfile(folder)
        if self._packed:
            for source in sorted(members(folder, suffixes), key=attrgetter("name")):
                place, name = os.path.split(os.path.splitext(source.name)[0])
                self._listings.setdefault(place, {}).setdefault(name, []).append(source.content)
        elif not os.path.isdir(folder):
            what = "folder or tar file" if packed else "folder"
            raise UsageError(f"{option}: there is no {what} {printable(folder)}; check the name")

    def file_of(self, source: InputImage, stems: Iterable[str]) -> str:
        """Path of the file there is, other than the image itself, with one of these names without suffix; or empty.

        Of a member in a tar file what `read_input` takes.

        Raises
        ------
        UsageError
            If there are several that are no images of the run themselves.
        """
        own = os.path.realpath(source.content)
        found = [path for stem in stems for path in self._paths(stem) if os.path.realpath(path) != own]
        if len(found) > 1:
            others = [path for path in found if os.path.realpath(path) not in self._images]
            if len(others) > 1:
                names = " and ".join(printable(os.path.basename(display_path(path))) for path in others[:2])
                where = f"{printable(self.folder)} holds {names}"
                raise UsageError(
                    f"{self.option}: {where}, each of which could belong to {printable(source.name)}; leave one"
                )
            found = others or found
        return found[0] if found else ""

    @cached_property
    def _images(self) -> set[str]:
        return {os.path.realpath(one.content) for one in self.sources}

    def _paths(self, stem: str) -> list[str]:
        place, name = os.path.split(stem)
        if place not in self._listings:
            self._listings[place] = {} if self._packed else self._by_stem(os.path.join(self.folder, place))
        return self._listings[place].get(name, [])

    def _by_stem(self, folder: str) -> dict[str, list[str]]:
        found: dict[str, list[str]] = {}
        with suppress(OSError):
            for name in sorted(os.listdir(folder)):
                stem, end = os.path.splitext(name)
                if end.lower() in self._suffixes:
                    found.setdefault(stem, []).append(os.path.join(folder, name))
        return found


def find_truths(sources: Sequence[InputImage], folder: str) -> dict[str, str]:
    """True mask of each image that has one: the same relative name with any suffix, or with ``_truth`` before it.

    In a folder or a tar file; what is given is for `read_input`.

    Raises
    ------
    UsageError
        If there is no such folder or tar file, no image has a true mask in it, or one has two.
    """
    beside = SiblingFiles("--truth", folder, sources, packed=True)
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
    _require_one_mask_of_two(sources, truths)
    return truths


def _require_one_mask_of_two(sources: Sequence[InputImage], truths: dict[str, str]) -> None:
    """Refuse ``a.jpg`` and ``a.png`` side by side, each of which could be the mask of the other."""
    inputs = {os.path.realpath(one.content): one for one in sources}
    for one in sources:
        other = inputs.get(os.path.realpath(truths.get(one.name, "")))
        if other is not None and os.path.splitext(one.name)[0] == os.path.splitext(other.name)[0]:
            raise UsageError(
                f"--truth: {printable(other.name)} and {printable(one.name)} could each be the mask of the other; put the masks "
                "into a folder of their own, or call them NAME_truth.png"
            )


def find_evidence(sources: Sequence[InputImage], folder: str) -> dict[str, str]:
    """Map of each image: the same relative name with the suffix of an image or ``.npy``, in a folder or a tar file.

    Raises
    ------
    UsageError
        If there is no such folder or tar file, or an image has no map in it.
    """
    beside = SiblingFiles("--evidence", folder, sources, {*SUFFIXES, ARRAY_SUFFIX}, packed=True)
    missing = "has no map of its name in {} (NAME.png, NAME.tiff or NAME.npy)"
    return _of_each(beside, lambda name: (os.path.splitext(name)[0],), missing)


def find_domains(sources: Sequence[InputImage], folder: str) -> dict[str, str]:
    """Mask of each image: of its own relative name with any suffix, else of the nearest folder round it.

    For ``left/day1/a.jpg`` the first there is of ``left/day1/a.png``, ``left/day1.png``, ``left.png``.

    Raises
    ------
    UsageError
        If the folder does not exist, or an image has no mask in it.
    """
    missing = "has no mask of its name or of its folder's in {} (NAME.png or FOLDER.png)"
    return _of_each(SiblingFiles("domain.masks", folder, sources), _own_or_folders, missing)


def _of_each(beside: SiblingFiles, stems: Callable[[str], Iterable[str]], missing: str) -> dict[str, str]:
    found = {
        source.name: next(filter(None, (beside.file_of(source, [stem]) for stem in stems(source.name))), "")
        for source in beside.sources
    }
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
