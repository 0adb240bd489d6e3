"""``ffseg samples``: write the images the project draws itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ffseg.cli import console
from ffseg.cli.checks import folder as named


def samples(
    folder: Annotated[Path, typer.Argument(metavar="DIR", parser=named, help="Folder to write into; made if absent.")],
    pairs: Annotated[
        int, typer.Option(min=0, max=1000, metavar="N", help="Pairs of a camera under a mirror: pair, pair-2, ...")
    ] = 1,
    driven: Annotated[
        bool, typer.Option("--drive", help="Also a drive of 40 images round a room, with camera and poses.")
    ] = False,
) -> None:
    """Write sample images, their truths, and pairs with camera and poses; the same bytes every time."""
    from ffseg.samples.write import write_samples

    for path in write_samples(folder, pairs, driven=driven):
        console.data(console.escape(str(path)))
