"""``ffseg segment``: one image to one file or a few, also through pipes."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ffseg.cli import completion, console, options
from ffseg.cli.checks import ready_params, refuse_others
from ffseg.cli.completion import KINDS
from ffseg.errors import FfsegError, ImageReadError, OutputError, UsageError, is_out_of_memory

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ffseg.arrays import Image, Plane
    from ffseg.parameters import Levels

PIPE = "-"


def segment(  # noqa: PLR0913 - the options of the command
    context: typer.Context,
    image: Annotated[str, typer.Argument(metavar="IN", help="Image file or its address, or - for stdin.")],
    outputs: Annotated[
        list[str], typer.Argument(metavar="OUT...", help="Files to write; their suffix says what. - is stdout.")
    ],
    kind: Annotated[
        str | None,
        typer.Option(
            "--as",
            metavar="KIND",
            autocompletion=completion.kinds,
            help=f"{', '.join(KINDS)}; without it by the suffix, mask for -.",
        ),
    ] = None,
    config: options.Config = None,
    settings: options.Settings = None,
    allow_code: options.AllowCode = False,
    at: options.At = None,
    outside: options.Outside = None,
    boxes: options.Boxes = None,
    largest: options.Largest = None,
    min_area: options.MinArea = None,
    fill_holes: options.FillHoles = None,
    label: options.Label = None,
    evidence: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Map of what is inside: grey image, or .npy.")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace also files that are not known as ffseg's, perhaps photographs.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No word of how it went; errors only.")] = False,
) -> None:
    """Segment one image and write what the suffix of OUT asks for.

    NAME.png is the mask, NAME.svg the exact contours, NAME.geojson, NAME.json (COCO) and NAME.txt (YOLO) the regions,
    NAME.jpg or NAME.webp the image with the region drawn. A file that is there is replaced if it is a mask, or begins as
    ffseg writes such files. Exit code: 0 done; 2 nothing was run; 3 the image cannot be read or segmented, or an output
    cannot be written.
    """
    targets = [(path, _kind(path, kind)) for path in outputs]
    _require_other_names(image, targets)
    if not overwrite:
        refuse_others([one for one in targets if one[0] != PIPE], "choose another name or add --overwrite")
    params = ready_params(config, options.overrides(context.params), evidence, allow_code=allow_code)
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    from ffseg.api import segment as segment_pixels
    from ffseg.batch.outputs.encoding import as_labelme
    from ffseg.io.saving import ImageInfo, encoded

    domain = _domain(image, params.domain.masks)
    try:
        pixels, note = _read(image, params.input.range)
        result = segment_pixels(pixels, params, evidence=_evidence(evidence), domain=domain)
        source = ImageInfo(_name(image), pixels, label=params.region.label)
        found = []
        for path, output in targets:
            suffix = ".png" if path == PIPE else os.path.splitext(path)[1].lower()
            seen = as_labelme(path, image, pixels, source.label) if output == "labelme" else source
            found.append((path, encoded(result, output, seen, suffix)))
        _write(found)
    except Exception as error:
        if not (isinstance(error, FfsegError) or is_out_of_memory(error)):
            raise
        no_memory = "there is not enough memory for the image; scale it down"
        console.error(str(error) if isinstance(error, FfsegError) else no_memory)
        raise typer.Exit(console.FAILED_IMAGES) from error
    if not quiet:
        texts = [note, *result.messages]
        if label is not None and any(output == "yolo" for _, output in targets):
            texts.append(f"class 0 of YOLO's labels is {label}: name it in the data set's YAML file")
        for text in filter(None, texts):
            console.message(f"ffseg: {text}")
        console.message(f"ffseg: {repr(result).strip('<>').partition(': ')[2]}")


def _evidence(path: Path | None) -> Plane | None:
    if path is None:
        return None
    from ffseg.batch.workers.pictures import read_evidence

    return read_evidence(os.fspath(path))


def _domain(image: str, folder: str | None) -> Image | None:
    """The image's own domain in a folder of such masks, as `run` finds it."""
    if folder is None:
        return None
    from ffseg.batch.plan.beside import find_domains
    from ffseg.batch.plan.sources import InputImage as Input
    from ffseg.io.masks import load_mask

    if image == PIPE:
        raise UsageError(
            "domain.masks finds masks by the names of images, and stdin has none; name one with domain.mask"
        )
    (path,) = find_domains([Input(image, _name(image))], folder).values()
    return load_mask("domain.masks", path)


def _kind(path: str, named: str | None) -> str:
    """What to write into a file: what is asked for, or what its suffix stands for."""
    if named is not None and named not in KINDS:
        from ffseg.schema.kinds import nearest_word

        raise UsageError(f"--as {named}: choose one of {', '.join(KINDS)}{nearest_word(named, KINDS)}")
    if path == PIPE or named not in (None, "overlay", "cutout"):
        return named or "mask"
    from ffseg.io.saving import kind_of

    try:
        return kind_of(path, () if named is None else (named,))
    except OutputError as error:
        raise UsageError(f"{error}; or name it with --as" if named is None else str(error)) from error


def _require_other_names(image: str, targets: Sequence[tuple[str, str]]) -> None:
    """Refuse outputs that tell of several inputs, as a pattern of the shell makes: all but the first would be replaced."""
    if any(path != PIPE and _same(path, image) for path, _ in targets):
        raise UsageError("an output would replace the input image; choose another name")
    first: dict[tuple[str, str], str] = {}
    for path, kind in targets:
        output = (kind, os.path.splitext(path)[1].lower())
        if output in first:
            raise UsageError(
                f"{first[output]} and {path} would be the same {kind}; 'ffseg segment' takes one image, 'ffseg run' many"
            )
        first[output] = path


def _same(path: str, image: str) -> bool:
    try:
        return os.path.samefile(path, image)
    except OSError:
        return False


def _read(image: str, levels: Levels) -> tuple[Image, str]:
    """Pixels of an image, and what there is to say of frames that were not read."""
    from glob import has_magic

    from ffseg.batch.plan.reading import read_input
    from ffseg.io.files import printable
    from ffseg.io.images import Limits, read_picture

    limits = Limits()
    try:
        data = _stdin(limits.max_bytes) if image == PIPE else read_input(image, limits.max_bytes)
        return read_picture(data, limits, levels)
    except ImageReadError as error:
        name = "" if image == PIPE else f"{printable(image)}: "
        several = "; 'ffseg run' takes patterns" if error.reason == "missing" and has_magic(image) else ""
        raise ImageReadError(error.reason, f"{name}{error}{several}") from None


def _name(image: str) -> str:
    from ffseg.batch.plan.remote import is_remote, remote_name

    return "" if image == PIPE else remote_name(image) if is_remote(image) else os.path.basename(image)


def _stdin(most: int) -> bytes:
    data = sys.stdin.buffer.read(most + 1)
    if not data:
        raise ImageReadError("empty", "stdin is empty; send an image: ffseg segment - OUT < IMAGE")
    if len(data) > most:
        raise ImageReadError("too-many-bytes", f"stdin holds more than {most} bytes")
    return data


def _write(files: Sequence[tuple[str, bytes]]) -> None:
    """Write files whole and together or not at all, then what goes to stdout."""
    from ffseg.cli.streams import lost_output
    from ffseg.io.files import write_all_atomic

    write_all_atomic([(path, data) for path, data in files if path != PIPE])
    for data in (data for path, data in files if path == PIPE):
        if sys.stdout.isatty() and b"\0" in data:
            raise OutputError("stdout is a terminal, which shows no pictures; redirect it: ffseg segment IN - > OUT")
        sys.stdout.buffer.write(data)
        lost = lost_output()
        if lost:
            raise OutputError(f"stdout cannot be written ({lost})")
