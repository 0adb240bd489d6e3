"""Outputs of all frames as films, written frame by frame with the frames' own times."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from ffseg.arrays import Image
from ffseg.batch.outputs.table import FILM_KINDS
from ffseg.batch.plan.reading import read_input, split_member_path
from ffseg.batch.plan.sources import film_of, film_stems
from ffseg.batch.tar.members import output_bytes
from ffseg.batch.values import Record
from ffseg.errors import ImageReadError, OutputError, UsageError
from ffseg.io.files import printable, replacement
from ffseg.io.images import decode_image
from ffseg.io.overlays import as_colour
from ffseg.plugins import require

if TYPE_CHECKING:
    from ffseg.batch.record.tables import Records

_CODECS = {
    "mask": ("libx264", "yuv420p", {"qp": "0", "preset": "veryfast"}),
    "overlay": ("libx264", "yuv420p", {"crf": "18", "preset": "veryfast"}),
    "cutout": ("libvpx-vp9", "yuva420p", {"crf": "20", "b:v": "0", "deadline": "realtime", "cpu-used": "8"}),
}
"""Codec, layout of the pixels and how well: masks without loss, cut-outs with alpha."""
_RATE = 25
"""Frames a second where they have no times, as in a folder."""
_CLOCK = 90_000
_MAX_BYTES = 1 << 30
Timed = tuple[float, Image]


def read_film_kinds(text: str) -> tuple[str, ...]:
    """Kinds of film that a text such as ``mask,overlay`` names.

    Raises
    ------
    UsageError
        For another name, or without PyAV.
    """
    kinds = tuple(dict.fromkeys(name.strip().lower() for name in text.split(",") if name.strip()))
    unknown = next((name for name in kinds if name not in FILM_KINDS), "")
    if unknown:
        raise UsageError(f"--film-out {printable(unknown)}: choose from {', '.join(FILM_KINDS)}")
    if kinds:
        require("av", "--film-out needs PyAV", "video")
    return kinds


def write_films(out: str, kinds: Sequence[str], survey: Records, tell: Callable[[str], None]) -> list[str]:
    """Write the films of all images that stand; `tell` hears of each that cannot be written. Gives their names."""
    written: list[str] = []
    films = film_stems(record.name for record in survey.records() if record.outputs) if kinds else {}
    inputs = (
        {os.path.realpath(split_member_path(record.files["image"][0])[0]) for record in survey.records()}
        if films
        else set()
    )
    for film, stem in films.items():
        for kind in kinds:
            name = f"{stem}_{kind}.{FILM_KINDS[kind]}"
            frames = (record for record in survey.records() if film_of(record.name) == film)
            try:
                if os.path.realpath(os.path.join(out, name)) in inputs:
                    raise OutputError(
                        f"the film {printable(name)} would replace an input; choose another output folder"
                    )
                _write(os.path.join(out, name), kind, _timed(out, kind, frames))
            except (OutputError, ImageReadError) as error:
                tell(str(error))
            written.append(name)
    return written


def _timed(out: str, kind: str, records: Iterable[Record]) -> Iterator[Timed]:
    for number, record in enumerate(records):
        if not record.outputs:  # it failed: the frame before it stands
            continue
        time = record.row.get("time_s")
        yield number / _RATE if time is None else float(time), _picture(out, kind, record)


def _picture(out: str, kind: str, record: Record) -> Image:
    """Pixels of a frame, shape (H, W) of a mask, (H, W, 3) in BGR order, or (H, W, 4) with alpha."""
    folder = "overlays/" if kind == "overlay" else "masks/"
    path = next(path for path in record.outputs if path.startswith(folder))
    made = decode_image(output_bytes(out, path, record.members.get(path)))
    if kind == "cutout":
        image = decode_image(read_input(record.files["image"][0], _MAX_BYTES))
        made = np.dstack([as_colour(image) * (made[:, :, None] > 0), made])
    more = [(0, side % 2) for side in made.shape[:2]]  # colours of two pixels are stored as one
    return np.pad(made, [*more, *([(0, 0)] if made.ndim > 2 else [])], mode="edge")


def _frame(pixels: Image) -> Any:  # noqa: ANN401 - of PyAV
    import av

    if pixels.ndim > 2:
        return av.VideoFrame.from_ndarray(pixels, format="bgra" if pixels.shape[2] == 4 else "bgr24")
    colourless = np.full((len(pixels) // 2, pixels.shape[1]), 128, np.uint8)
    return av.VideoFrame.from_ndarray(np.vstack([pixels, colourless]), format="yuv420p")  # 0 and 255 in either range


def _lasting(frames: Iterable[Timed]) -> Iterator[tuple[int, int, Image]]:
    """When each frame begins and how long it lasts, in ticks; the last one as long as the one before it."""
    before: tuple[int, Image] | None = None
    lasts = _CLOCK // _RATE
    for time, pixels in frames:
        begin = round(time * _CLOCK)
        if before is not None:
            begin = max(before[0] + 1, begin)  # in a GIF two frames may have one time
            lasts = begin - before[0]
            yield before[0], lasts, before[1]
        before = begin, pixels
    if before is not None:
        yield before[0], lasts, before[1]


def _with_duration(packet: Any, shown: dict[int, int]) -> Any:  # noqa: ANN401 - of PyAV
    packet.duration = shown.pop(packet.pts, packet.duration)
    return packet


def _write(path: str, kind: str, frames: Iterator[Timed]) -> None:
    import av

    codec, layout, options = _CODECS[kind]
    size, shown = (0, 0), dict[int, int]()
    with replacement(path) as temporary:
        try:
            with av.open(temporary, "w", format=FILM_KINDS[kind], container_options={"fflags": "+bitexact"}) as film:
                track: Any = film.add_stream(codec, rate=_RATE, options=options)
                track.pix_fmt, track.codec_context.time_base = layout, Fraction(1, _CLOCK)
                for begin, lasts, pixels in _lasting(frames):
                    if not any(size):
                        track.width, track.height = size = (pixels.shape[1], pixels.shape[0])
                    if size != (pixels.shape[1], pixels.shape[0]):
                        raise OutputError(
                            f"{printable(path)}: frames of several sizes make no film; run them one film at a time"
                        )
                    frame = _frame(pixels)
                    frame.pts, frame.time_base = begin, Fraction(1, _CLOCK)
                    shown[begin] = lasts
                    film.mux([_with_duration(packet, shown) for packet in track.encode(frame)])
                film.mux([_with_duration(packet, shown) for packet in track.encode()])
        except av.FFmpegError as error:
            raise OutputError(f"{printable(path)} cannot be written ({error}); free some space") from error
