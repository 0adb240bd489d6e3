"""Domains by the names of their images: one mask an image, or one for all images of a folder, as of one camera."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator

from ffseg.batch.plan.beside import Beside
from ffseg.batch.plan.discover import Source
from ffseg.errors import UsageError
from ffseg.io.files import printable


def find_domains(sources: Iterable[Source], folder: str) -> dict[str, str]:
    """Mask of each image: of its own relative name with any suffix, else of the nearest folder round it.

    For ``left/day1/a.jpg`` the first there is of ``left/day1/a.png``, ``left/day1.png``, ``left.png``.

    Raises
    ------
    UsageError
        If the folder does not exist, or an image has no mask in it.
    """
    beside = Beside("domain.masks", folder)
    found = {}
    for source in sources:
        path = beside.file_of(source, _names(source.name))
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
