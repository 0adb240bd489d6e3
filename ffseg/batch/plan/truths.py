"""True masks by the names of their images."""

from __future__ import annotations

import os
from collections.abc import Iterable

from ffseg.batch.plan.beside import Beside
from ffseg.batch.plan.discover import Source
from ffseg.errors import UsageError
from ffseg.io.files import printable


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
