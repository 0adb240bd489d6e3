"""``ffseg domain``: the camera's own parts, found in its images, as a mask for ``domain.mask`` or ``domain.masks``."""

from __future__ import annotations

import json
import os
import shlex
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ffseg.cli import console
from ffseg.cli.checks import folder as named
from ffseg.cli.checks import output_file, refuse_others
from ffseg.cli.options import AsJsonOrSentences, Inputs
from ffseg.errors import UsageError

if TYPE_CHECKING:
    from ffseg.batch.cameras import OwnImage


def domain(
    inputs: Inputs,
    out: Annotated[
        Path,
        typer.Option(metavar="FILE|DIR", help="A .png mask of all images, or a folder: one for each folder."),
    ],
    sample: Annotated[
        int, typer.Option(min=5, max=200, metavar="N", help="Images of a camera looked at, evenly spaced.")
    ] = 24,
    as_json: AsJsonOrSentences = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress; the findings only.")] = False,
) -> None:
    """Find what stays in its place while a camera moves: its own mount, a bonnet, the dark round a mirror.

    Writes masks that are 0 there and 255 elsewhere, for --set domain.mask=FILE or --set domain.masks=DIR of the other
    commands. Look at them: they are found, not known. Exit code: 0 done; 2 nothing was written; 3 an image cannot be
    read, or a folder shows no camera that moves: it is named, and the other masks are written.
    """
    from ffseg.batch.cameras import cameras, names_a_mask, write_own_image
    from ffseg.batch.plan.discover import discover

    single = names_a_mask(os.fspath(out))
    _require_output(out, single=single)
    found: list[OwnImage] = []
    planned = cameras(discover(inputs), os.fspath(out))
    refuse_others([(camera.out, "mask") for camera in planned], "choose another name for --out")
    for number, camera in enumerate(planned, 1):
        if not quiet:
            seen = min(sample, len(camera.images))
            console.message(f"ffseg: mask {number} of {len(planned)}: reading {seen} of {len(camera.images)} images")
        found.append(write_own_image(camera, sample))
        for problem in found[-1].problems:
            console.message(f"ffseg: {problem}")
    written = [one for one in found if one.out]
    if as_json:
        console.data(json.dumps({"out": os.fspath(out), "masks": [asdict(one) for one in found]}, indent=2))
    elif written:
        use = "it with --set domain.mask" if single else "them with --set domain.masks"
        console.data("\n".join([*map(_sentence, written), f"use {use}={shlex.quote(os.fspath(out))}"]))
    if not written:
        raise typer.Exit(2)
    if any(one.problems for one in found):
        raise typer.Exit(console.FAILED_IMAGES)


def _require_output(out: Path, *, single: bool) -> None:
    """Refuse a mask or a folder of masks that could not be written."""
    from ffseg.batch.plan.sources import SUFFIXES

    if single:
        output_file("--out", out)
        return
    if out.suffix.lower() in SUFFIXES and not out.is_dir():
        raise UsageError(f"--out {out}: masks are PNG files; name it .png, or name a folder")
    named(os.fspath(out))


def _sentence(found: OwnImage) -> str:
    seen = f"{found.looked} of {found.images} images" if found.looked < found.images else f"{found.images} images"
    if not found.own:
        return f"{found.out}: nothing stays in its place in {seen}; 255 everywhere"
    return f"{found.out}: {100 * found.own:.1f} % stays in its place in {seen}, and is 0"
