"""``ffseg samples``: write the images the project draws itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ffseg.cli import console


def samples(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to write into; made if absent.")],
) -> None:
    """Write the sample images and their truths; the same bytes every time."""
    from ffseg.samples.write import write_samples

    for path in write_samples(folder):
        console.data(console.escape(str(path)))
