"""Frames of films (PyAV) and of animated or multi-page images (Pillow), read one at a time.

Policies
--------
Frame : counted from 0 as shown; where every packet has a time of its own, a frame keeps its number though others are lost.
Time : seconds after the first frame, of the packets; pages have none.
Reading : from the first frame on, without jumps: what a jump decodes may differ from what playing does.
Containers : those of `CONTAINERS` only; a play list under another name, which would open further files, is refused.
"""

from __future__ import annotations

import atexit
import io
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from threading import Lock
from typing import Any

from ffseg.errors import ImageReadError, said
from ffseg.io.containers import is_cut
from ffseg.io.files import printable
from ffseg.plugins import require

FILMS = (".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi")
ANIMATIONS = (".gif", ".webp", ".png", ".apng", ".tif", ".tiff")
"""Pictures that may hold several frames or pages."""
CONTAINERS = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi"
_PHOTOMETRIC, _SAMPLE_FORMAT = 262, 339
"""Tags of TIFF."""
_RATE = 25.0
"""Frames a second of a film that does not say."""
_COPY = "copy the film again, or write what is left of it anew: ffmpeg -i IN OUT.mkv"

Encode = Callable[[], bytes]
Numbered = tuple[int, Encode | None]


@dataclass(frozen=True, slots=True)
class FilmContents:
    """What a film holds.

    Attributes
    ----------
    times : tuple of float or None
        Seconds of each frame; None for pages.
    problem : str
        What is known to be missing behind the last frame (``reason: text``), or empty.
    """

    times: tuple[float | None, ...]
    problem: str = ""


def is_film(path: str) -> bool:
    """Whether a file is named as a film."""
    return path.lower().endswith(FILMS)


def require_video(path: str) -> None:
    """Refuse a film or an animation whose reader is not installed."""
    module, what = ("av", "a film needs PyAV") if is_film(path) else ("PIL", "--film needs Pillow for it")
    require(module, f"{printable(path)}: {what}", "video")


def film_contents(path: str) -> FilmContents:
    """Times of all frames, read without decoding those of a film.

    Raises
    ------
    ImageReadError
        If the file is none that can be read.
    """
    return _film_contents(path) if is_film(path) else FilmContents(tuple(_times(path)))


def frame_bytes(path: str, number: int, max_bytes: int) -> bytes:
    """One frame as the bytes of an image file: PNM of a film, PNG of a picture.

    Frames asked for in rising order are read once; for an earlier one the film is read again from its beginning.

    Raises
    ------
    ImageReadError
        If there is no such frame, or it cannot be decoded.
    """
    try:
        status = os.stat(path)
    except OSError as error:
        raise ImageReadError("unreadable", f"the film cannot be read ({os.strerror(error.errno or 0)})") from error
    return _reader(path, (status.st_size, status.st_mtime_ns), max_bytes).frame(number)


class _Reader:
    """A film being read; holds the place it is at."""

    def __init__(self, path: str, max_bytes: int) -> None:
        self._path, self._max_bytes = path, max_bytes
        self._lock = Lock()
        self._asked = sys.maxsize  # begins at the first frame

    def frame(self, number: int) -> bytes:
        """As `frame_bytes`."""
        with self._lock:
            if number < self._asked:
                read = _film_frames if is_film(self._path) else _pages
                self._frames = read(self._path, self._max_bytes)
                self._held: Numbered = (-1, None)
            self._asked = number
            while self._held[0] < number:
                self._held = next(self._frames, (sys.maxsize, None))
            found, encode = self._held
            if found == number and encode is not None:
                return encode()
        reason, what = ("truncated", "ends before") if encode is None else ("damaged", "cannot be decoded at")
        raise ImageReadError(reason, f"the film {what} frame {number}; {_COPY}")


@lru_cache(maxsize=2)
def _reader(path: str, _mark: tuple[int, int], max_bytes: int) -> _Reader:
    """The reader of a file, kept while it is the same file: a second one would begin again."""
    return _Reader(path, max_bytes)


atexit.register(_reader.cache_clear)  # while the modules that close a film are still there


def _opened(path: str) -> Any:  # noqa: ANN401 - container and picture track of PyAV
    import av

    try:
        container: Any = av.open(os.path.abspath(path), options={"format_whitelist": CONTAINERS})
    except (av.FFmpegError, OSError, ValueError) as error:
        raise ImageReadError("damaged", f"it is no film that can be read, or its index is cut off; {_COPY}") from error
    track = container.streams.best("video")
    if track is not None and track.codec_context is None:
        raise ImageReadError(
            "unsupported-pixels", f"the film's pictures are coded as nothing that PyAV decodes; {_COPY}"
        )
    if track is None or not track.codec_context.width:
        raise ImageReadError("not-an-image", f"the film has no picture track, or its index is cut off; {_COPY}")
    track.codec_context.thread_count = 1  # of a worker
    return container, track


def _packets(path: str) -> Iterator[tuple[Any, Any]]:
    """Track and packets, also of frames that others are decoded from; in the end an empty one, which drains the decoder."""
    import av

    container, track = _opened(path)
    with container, suppress(av.FFmpegError):  # what cannot be read any more is missing at the end
        for packet in container.demux(track):
            yield track, packet


def _is_shown(track: Any, packet: Any) -> bool:  # noqa: ANN401 - of PyAV
    """Whether the frame of a packet is one of the film's: not before its cut, nor one that VP8 keeps to itself."""
    hidden = track.codec_context.name.startswith("vp8") and not bytes(packet)[0] & 0x10
    return not (packet.is_discard or hidden)


@dataclass(frozen=True, slots=True)
class _Stamps:
    """When the frames of a film are shown, in the order in which they are."""

    ticks: list[int | None]
    """Of the packets; None where they have none, or not each its own."""
    clock: float
    """Seconds of a tick."""
    rate: float
    """Frames a second."""

    def seconds(self) -> Iterator[float]:
        """After the first frame."""
        first = self.ticks[0] or 0
        for number, tick in enumerate(self.ticks):
            yield number / self.rate if tick is None else (tick - first) * self.clock


def _stamps(path: str) -> _Stamps:
    found: list[int | None] = []
    clock, rate, stored = 1.0, _RATE, False
    for track, packet in _packets(path):  # what a track says is gone with its container
        clock, rate = float(track.time_base), float(track.average_rate or track.guessed_rate or _RATE)
        stored = track.container.format.name != "avi"  # whose times are made up, in the order of storage
        if packet.size and _is_shown(track, packet):
            found.append(packet.pts)
    ticks = {tick for tick in found if tick is not None}
    if not stored or len(ticks) < len(found):
        return _Stamps([None] * len(found), clock, rate)
    return _Stamps([*sorted(ticks)], clock, rate)


def _film_contents(path: str) -> FilmContents:
    stamps = _stamps(path)
    count = len(stamps.ticks)
    if not count:
        raise ImageReadError("truncated", f"the film has no frame left; {_COPY}")
    problem = f"truncated: the film ends after {count} frames, before its head says; {_COPY}" if is_cut(path) else ""
    return FilmContents(tuple(round(time, 6) for time in stamps.seconds()), problem)


def _film_frames(path: str, max_bytes: int) -> Iterator[Numbered]:
    import av

    places = {tick: number for number, tick in enumerate(_stamps(path).ticks) if tick is not None}
    count = 0
    for _track, packet in _packets(path):
        with suppress(av.FFmpegError):  # this frame is missing, and said to be when it is asked for
            for frame in packet.decode():
                count = places.get(frame.pts, count)
                yield count, lambda frame=frame: _pnm(frame, max_bytes)  # type: ignore[misc]
                count += 1


def _pnm(frame: Any, max_bytes: int) -> bytes:  # noqa: ANN401 - of PyAV
    """A frame upright, as the film's own note of turns and mirrors says."""
    _require_room(frame, 3, max_bytes)
    if frame.is_corrupt:
        raise ImageReadError("damaged", f"the frame is incomplete; {_COPY}")
    grey = frame.format.name.startswith("gray")
    pixels = _upright(frame, frame.to_ndarray(format="gray" if grey else "rgb24"))
    height, width = pixels.shape[:2]
    data: bytes = pixels.tobytes()
    return b"P%d\n%d %d\n255\n" % (5 if grey else 6, width, height) + data


def _upright(frame: Any, pixels: Any) -> Any:  # noqa: ANN401 - of PyAV and NumPy
    """Pixels turned as the display matrix of their frame says: x' = a x + c y, y' = b x + d y, by quarters and mirrored."""
    found = frame.side_data.get("DISPLAYMATRIX")
    if found is None:
        return pixels
    import numpy as np

    a, b, _, c, d = np.frombuffer(bytes(found), "<i4")[:5].tolist()
    if abs(b) > abs(a):  # it lies
        pixels, a, d = pixels.swapaxes(0, 1), c, b
    return pixels[:: -1 if d < 0 else 1, :: -1 if a < 0 else 1]


def _require_room(frame: Any, channels: int, max_bytes: int) -> None:  # noqa: ANN401 - of PyAV or Pillow
    if frame.width * frame.height * channels > max_bytes:
        size = f"{frame.width}x{frame.height}"
        raise ImageReadError("too-many-bytes", f"the frame has {size} pixels, the limit is {max_bytes} bytes")


def _pictures(path: str) -> Iterator[Any]:
    """Frames or pages of a picture file, each valid until the next is asked for."""
    import logging

    from PIL import Image, ImageSequence

    told = logging.getLogger("PIL")
    if not told.handlers:
        told.addHandler(logging.NullHandler())  # else it goes to stderr, without a name: the error says it again
    try:
        with Image.open(path, formats=("GIF", "WEBP", "PNG", "TIFF")) as picture:
            for frame in ImageSequence.Iterator(picture):
                if frame.format != "TIFF":
                    frame.load()  # WebP tells how long a frame is shown when it decodes it
                yield frame
    except MemoryError:
        raise
    except Exception as error:  # Pillow raises whatever it comes upon
        raise ImageReadError(
            "damaged", f"a frame of it cannot be read ({said(error)}); write the file again"
        ) from error


def _times(path: str) -> Iterator[float | None]:
    passed = 0.0
    for picture in _pictures(path):
        yield None if picture.format == "TIFF" else round(passed / 1e3, 6)
        passed += float(picture.info.get("duration", 0))


def _pages(path: str, max_bytes: int) -> Iterator[Numbered]:
    for number, picture in enumerate(_pictures(path)):
        yield number, lambda picture=picture: _png(picture, max_bytes)  # type: ignore[misc]


def _png(picture: Any, max_bytes: int) -> bytes:  # noqa: ANN401 - of Pillow
    from PIL import ImageOps

    _require_room(picture, 4, max_bytes)
    tags = getattr(picture, "tag_v2", {})  # of TIFF, of which Pillow takes negative for large, and some white for black
    if set(tags.get(_SAMPLE_FORMAT, (1,))) != {1} or (tags.get(_PHOTOMETRIC) == 0 and picture.mode.startswith("I")):
        text = "the page's numbers are signed, float, or 16 bits that begin with white; save it with unsigned ones"
        raise ImageReadError("unsupported-pixels", text)
    data = io.BytesIO()
    try:
        ImageOps.exif_transpose(picture).save(data, "PNG", compress_level=0)
    except MemoryError:
        raise
    except Exception as error:
        reason = "unsupported-pixels" if "mode" in str(error) else "damaged"
        raise ImageReadError(reason, f"the frame cannot be read ({said(error)}); save it in 8 bits") from error
    return data.getvalue()
