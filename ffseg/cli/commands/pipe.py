"""``ffseg run - --out -``: frames from stdin, what is found of each to stdout, one after another."""

from __future__ import annotations

import sys
from time import perf_counter
from typing import TYPE_CHECKING, Any

import typer

from ffseg.cli import console
from ffseg.cli.checks import ready_params
from ffseg.cli.options import overrides
from ffseg.errors import ImageReadError, SegmentationError, UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ffseg.parameters import Parameters

PIPE = "-"
_TAKEN = (
    "context", "inputs", "out", "config", "settings", "allow_code", "outside", "boxes", "largest", "min_area", "fill_holes",
    "raw", "film_out", "max_pixels", "quiet",
)  # fmt: skip
"""Options that frames of a pipe take."""


def pipe(context: typer.Context) -> int:
    """Do what the command line of `run` asks for, from stdin to stdout; the exit code.

    Raises
    ------
    UsageError
        For options that frames of a pipe do not take, or a stream that cannot be read.
    """
    from ffseg.io.images import Limits
    from ffseg.io.pipes import encoded, frames, head, read_form

    asked = _asked(context)
    params = ready_params(asked["config"], overrides(asked), allow_code=asked["allow_code"])
    kind = asked["film_out"] or "mask"
    form = read_form(sys.stdin.buffer, asked["raw"], Limits(max_pixels=asked["max_pixels"]))
    count, failed, begin = 0, 0, perf_counter()
    try:
        _send(head(form, grey=kind == "mask"))
        for image in frames(sys.stdin.buffer, form):
            picture, problem = _picture(image, params, kind)
            _send(encoded(picture, form))
            count, failed = count + 1, failed + bool(problem)
            if problem and not asked["quiet"]:
                console.message(f"ffseg: frame {count - 1}: {problem}")
    except BrokenPipeError:
        console.error(f"whoever reads stdout has gone after {count} frames")
        return console.FAILED_IMAGES
    except ImageReadError as error:
        console.error(str(error))
        return console.FAILED_IMAGES
    finally:
        if not asked["quiet"]:
            console.message(f"ffseg: {count} frames, {count / (perf_counter() - begin):.1f} a second, {failed} failed")
    return console.FAILED_IMAGES if failed else 0


def _asked(context: typer.Context) -> dict[str, Any]:
    """Options of the command, without those that a pipe does not take."""
    for option in context.command.params:
        source = context.get_parameter_source(option.name or "")
        if source is not None and source.name == "COMMANDLINE" and option.name not in _TAKEN:
            raise UsageError(f"frames of a pipe take no {option.opts[0]}; leave it out, or name a film instead of -")
    asked = context.params
    if PIPE not in (*(asked["inputs"] or ()), str(asked["out"])):
        raise UsageError("--raw says what stdin holds: ffseg run - --raw WxH:LAYOUT --out -; leave it out for files")
    if list(asked["inputs"] or ()) != [PIPE]:
        raise UsageError(
            "--out -: - is no folder; write ./- if it is called so, or take frames from a pipe: ffseg run - --out -"
        )
    if str(asked["out"]) != PIPE:
        raise UsageError(
            "-: frames of a pipe go to one: ffseg run - --out -; write --list - for names and 'ffseg segment - OUT' for an image"
        )
    from ffseg.batch.outputs.table import FILM_KINDS

    if asked["film_out"] not in ("", *FILM_KINDS):
        raise UsageError(f"--film-out: a pipe takes one of {', '.join(FILM_KINDS)}")
    if sys.stdin.isatty() or sys.stdout.isatty():
        raise UsageError("frames go through pipes, not a terminal: ffmpeg ... | ffseg run - --out - | ffmpeg ...")
    return asked


def _picture(image: NDArray[np.uint8], params: Parameters, kind: str) -> tuple[NDArray[np.uint8], str]:
    """What is sent of a frame, and why it could not be segmented: then its region is empty."""
    import numpy as np

    from ffseg.api import segment
    from ffseg.io.overlays import as_colour, draw_overlay, polylines

    inside, problem = np.zeros(image.shape[:2], np.bool_), ""
    lines = []
    try:
        result = segment(image, params)
        inside, lines = result.mask, polylines(result.contours)
    except SegmentationError as error:
        problem = str(error)
    if kind == "overlay":
        return draw_overlay(image, lines, inside), problem
    levels = inside.astype(np.uint8)
    return (levels * np.uint8(255) if kind == "mask" else as_colour(image) * levels[:, :, None]), problem


def _send(data: bytes) -> None:
    """Write to stdout at once, whole: a reader that has gone is heard of, as the stream of the program does not."""
    from ffseg.io.files import write_fully

    write_fully(1, data)
