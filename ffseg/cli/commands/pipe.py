"""``ffseg run - --out -``: frames from stdin, results to stdout, one at a time."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any

import typer

from ffseg.cli import console
from ffseg.cli.checks import ready_params
from ffseg.cli.options import overrides
from ffseg.errors import ImageReadError, OutputError, SegmentationError, UsageError

if TYPE_CHECKING:
    from ffseg.arrays import Image, Mask
    from ffseg.batch.workers.past import PastFrame
    from ffseg.geometry.freeform import FreeForm
    from ffseg.io.starts import Start
    from ffseg.parameters import Parameters

PIPE = "-"
_TAKEN = (
    "context", "inputs", "out", "config", "settings", "allow_code", "outside", "boxes", "largest", "min_area", "fill_holes",
    "raw", "film_out", "max_pixels", "quiet", "starts", "steady",
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
    from ffseg.io.pipes import encoded, frames, head, read_frame_format

    arguments = _arguments(context)
    film = _film(arguments)
    kind = arguments["film_out"] or "mask"
    form = read_frame_format(sys.stdin.buffer, arguments["raw"], Limits(max_pixels=arguments["max_pixels"]))
    count, failed, begin = 0, 0, perf_counter()
    try:
        _send(head(form, grey=kind == "mask"))
        for image in frames(sys.stdin.buffer, form):
            inside, contours, problem = film.found(image)
            picture = _picture(image, inside, contours, kind)
            _send(encoded(picture, form))
            count, failed = count + 1, failed + bool(problem)
            if problem and not arguments["quiet"]:
                console.message(f"ffseg: frame {count - 1}: {problem}")
    except BrokenPipeError:
        console.error(f"whoever reads stdout has gone after {count} frames")
        return console.FAILED_IMAGES
    except (ImageReadError, OutputError) as error:
        console.error(str(error))
        return console.FAILED_IMAGES
    finally:
        if not arguments["quiet"]:
            console.message(f"ffseg: {count} frames, {count / (perf_counter() - begin):.1f} a second, {failed} failed")
    return console.FAILED_IMAGES if failed else 0


def _arguments(context: typer.Context) -> dict[str, Any]:
    """Options of the command, without those that a pipe does not take."""
    for option in context.command.params:
        source = context.get_parameter_source(option.name or "")
        if source is not None and source.name == "COMMANDLINE" and option.name not in _TAKEN:
            raise UsageError(f"frames of a pipe take no {option.opts[0]}; leave it out, or name a film instead of -")
    arguments = context.params
    if PIPE not in (*(arguments["inputs"] or ()), str(arguments["out"])):
        raise UsageError("--raw says what stdin holds: ffseg run - --raw WxH:LAYOUT --out -; leave it out for files")
    if list(arguments["inputs"] or ()) != [PIPE]:
        raise UsageError(
            "--out -: - is no folder; write ./- if it is called so, or take frames from a pipe: ffseg run - --out -"
        )
    if str(arguments["out"]) != PIPE:
        raise UsageError(
            "-: frames of a pipe go to one: ffseg run - --out -; write --list - for names and 'ffseg segment - OUT' for an image"
        )
    from ffseg.batch.outputs.table import FILM_KINDS

    if arguments["film_out"] not in ("", *FILM_KINDS):
        raise UsageError(f"--film-out: a pipe takes one of {', '.join(FILM_KINDS)}")
    if sys.stdin.isatty() or sys.stdout.isatty():
        raise UsageError("frames go through pipes, not a terminal: ffmpeg ... | ffseg run - --out - | ffmpeg ...")
    return arguments


def _film(arguments: dict[str, Any]) -> _Film:
    from ffseg.cli.options import starts_file
    from ffseg.io.starts import numbered_starts

    params = ready_params(arguments["config"], overrides(arguments), allow_code=arguments["allow_code"])
    if params.domain.masks is not None:
        raise UsageError(
            "domain.masks finds masks by the names of images, and frames of a pipe have none; take domain.mask"
        )
    starts = starts_file(arguments["starts"], params)
    film = _Film(params, numbered_starts(starts) if starts else {})
    if arguments["steady"]:
        from ffseg.batch.workers.past import PastFrame
        from ffseg.io.images import Limits

        film.past = PastFrame(steady=True, limits=Limits())
    return film


@dataclass(slots=True, eq=False)
class _Film:
    """How frames are segmented, by their numbers, and what is remembered of the one before."""

    params: Parameters
    starts: Mapping[int, Start]
    past: PastFrame | None = None
    number: int = 0
    held: Start | None = None
    last: tuple[Image, Mask] | None = None

    def found(self, image: Image) -> tuple[Mask, tuple[FreeForm, ...], str]:
        """Region and contours of the next frame, and why it could not be segmented: then its region is empty."""
        import numpy as np

        from ffseg.api import segment

        start, self.number = self.starts.get(self.number, self.held), self.number + 1
        params = self.params if start is None else start.placed(self.params, image.shape)
        self.held = start.next_frame() if start and self.past else None
        try:
            if self.past is None:
                result = segment(image, params)
            else:
                self.past.carry(self.last, image)
                absent = self.past.absent(start)
                result, _ = self.past.result(absent or segment(image, self.past.start(params, image.shape, start)))
        except SegmentationError as error:
            return np.zeros(image.shape[:2], np.bool_), (), str(error)
        if result.mask.any():
            self.last = (image, result.mask)
        return result.mask, result.contours, ""


def _picture(image: Image, inside: Mask, contours: tuple[FreeForm, ...], kind: str) -> Image:
    import numpy as np

    from ffseg.io.overlays import as_colour, draw_overlay, polylines

    if kind == "overlay":
        return draw_overlay(image, polylines(contours), inside)
    levels = inside.astype(np.uint8)
    return levels * np.uint8(255) if kind == "mask" else as_colour(image) * levels[:, :, None]


def _send(data: bytes) -> None:
    """Write to stdout at once, whole: a reader that has gone is heard of, as the stream of the program does not."""
    from ffseg.io.files import unwritten, write_fully

    try:
        write_fully(1, data)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise unwritten("stdout", error) from error
