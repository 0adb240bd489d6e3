"""True masks by the names of their images."""

from __future__ import annotations

import os
from collections.abc import Iterable

from ffseg.batch.discover import Source
from ffseg.batch.inputs.beside import Beside
from ffseg.errors import UsageError
from ffseg.formats.files import printable


def find_truths(sources: Iterable[Source], folder: str) -> dict[str, str]:
    """True mask of each image that has one: the same relative name with any suffix, or with ``_truth`` before it.

    Raises
    ------
    UsageError
        If the folder does not exist, or no image has a true mask in it.
    """
    beside = Beside("--truth", folder)
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
