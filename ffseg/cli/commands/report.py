"""``ffseg report``: a page to look at a run or a comparison."""

from __future__ import annotations

import glob
import os
from pathlib import Path
from typing import Annotated

import typer

from ffseg.cli import console
from ffseg.cli.checks import folder as named
from ffseg.cli.checks import number, refuse_others
from ffseg.errors import UsageError
from ffseg.io.files import printable


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", parser=named, help="Output folder of run or compare.")],
    images: Annotated[
        list[str] | None,
        typer.Option(metavar="INPUT", help="Where the input images are, if moved; may be repeated."),
    ] = None,
    embed: Annotated[
        float,
        typer.Option(metavar="MB", min=0, max=1000, callback=number, show_default=True, help="Thumbnails in the page."),
    ] = 20.0,
) -> None:
    """Write DIR/report.html: one page with every image, its contours, numbers and failures.

    The page needs no network and no server: open it in a browser. Sent alone it keeps its numbers, contours and
    thumbnails; the pictures beyond --embed, and those behind the thumbnails, are links into DIR.
    """
    from ffseg.batch.outputs.table import REPORT
    from ffseg.batch.report.write import write_report

    for text in images or ():  # those that run.json names may be gone
        if not (os.path.exists(text) or any(glob.iglob(text, recursive=True))):
            raise UsageError(f"--images: there is no file or folder {printable(text)}; check the name")
    refuse_others([(os.fspath(folder / REPORT), "report")], "move it")
    console.data(console.escape(str(write_report(folder, images or (), round(embed * 1e6)))))
