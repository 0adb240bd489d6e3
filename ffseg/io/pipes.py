"""Frames through pipes: raw pixels, or YUV4MPEG2 (Y4M) as ``ffmpeg -f yuv4mpegpipe`` writes it, read one at a time.

Y4M carries 8 bits of 4:2:0 (BT.601; studio range, 16 to 235, where its header does not say full range) or grey of full range.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

import cv2
import numpy as np

from ffseg.arrays import Image
from ffseg.errors import ImageReadError, UsageError
from ffseg.io.files import printable
from ffseg.io.images import Limits
from ffseg.io.overlays import as_colour

_RAW = re.compile(r"(\d{1,5})x(\d{1,5}):(bgr24|rgb24|gray)")
_MAGIC, _FRAME = b"YUV4MPEG2", b"FRAME"
_MAX_HEADER = 1024
"""Bytes of a header line."""
_COLOURS = ("420", "420jpeg", "420mpeg2", "420paldv", "mono")
_CHANNELS = {"bgr24": 3, "rgb24": 3, "gray": 1}


@dataclass(frozen=True, slots=True)
class FrameFormat:
    """How frames stand in a stream.

    Attributes
    ----------
    width, height : int
    layout : str
        ``bgr24``, ``rgb24`` or ``gray`` of raw pixels; of Y4M ``420`` or ``mono``.
    tags : tuple of str
        Fields of a Y4M header beside size and colours, such as the rate.
    full : bool
        The values of 4:2:0 go from 0 to 255, as in a JPEG file; those that are written are of studio range.
    """

    width: int
    height: int
    layout: str
    tags: tuple[str, ...] = ()
    full: bool = False

    @property
    def is_raw(self) -> bool:
        """Whether there is nothing but pixels."""
        return self.layout in _CHANNELS

    @property
    def num_bytes(self) -> int:
        """Of a frame's pixels."""
        pixels = self.width * self.height
        return pixels * 3 // 2 if self.layout == "420" else pixels * _CHANNELS.get(self.layout, 1)


def read_frame_format(stream: BinaryIO, raw: str, limits: Limits) -> FrameFormat:
    """How the frames of a stream stand: as told for raw pixels, else as its Y4M header says.

    Raises
    ------
    UsageError
        If `raw` is no size and layout, or the stream is not Y4M of 8 bits 4:2:0 or grey within the limits.
    """
    form = _raw_form(raw) if raw else _y4m_form(stream)
    if not 0 < form.width * form.height <= limits.max_pixels or max(form.width, form.height) > limits.max_side:
        raise UsageError(
            f"stdin: frames of {form.width}x{form.height} pixels; name or send another size (--max-pixels)"
        )
    if not form.is_raw and (form.width % 2 or form.height % 2):
        raise UsageError(
            f"stdin: {form.width}x{form.height} is odd; send raw pixels: ffmpeg -pix_fmt bgr24 -f rawvideo -"
        )
    return form


def _raw_form(raw: str) -> FrameFormat:
    found = _RAW.fullmatch(raw)
    if found is None:
        raise UsageError(
            f"--raw {printable(raw)}: write WIDTHxHEIGHT:LAYOUT with bgr24, rgb24 or gray, as 800x600:bgr24"
        )
    return FrameFormat(int(found[1]), int(found[2]), found[3])


def _y4m_form(stream: BinaryIO) -> FrameFormat:
    head = stream.readline(_MAX_HEADER)
    magic, *fields = head.split() or [b""]
    if magic != _MAGIC:
        raise UsageError("stdin holds no Y4M; send ffmpeg -f yuv4mpegpipe, or raw frames and say --raw 800x600:bgr24")
    tags = [field.decode("ascii", "replace") for field in fields]
    by_kind = {tag[0]: tag[1:] for tag in tags}
    colours = by_kind.get("C", "420jpeg")
    if colours not in _COLOURS:
        raise UsageError(f"stdin: Y4M with colours {printable(colours)}; send 8 bits: ffmpeg -pix_fmt yuv420p")
    sides = [by_kind.get(side, "") for side in "WH"]
    if not all(side.isdecimal() and len(side) < 6 for side in sides):
        raise UsageError(
            "stdin: the Y4M header has no size of up to five digits; write it anew with ffmpeg -f yuv4mpegpipe"
        )
    kept = tuple(tag for tag in tags if tag[0] not in "WHCX")
    layout = "mono" if colours == "mono" else "420"
    return FrameFormat(int(sides[0]), int(sides[1]), layout, kept, layout == "420" and "XCOLORRANGE=FULL" in tags)


def frames(stream: BinaryIO, form: FrameFormat) -> Iterator[Image]:
    """Frames of a stream, shape (H, W) or (H, W, 3) in BGR order.

    Raises
    ------
    ImageReadError
        If it ends inside a frame.
    """
    for number in itertools.count():
        if not form.is_raw:
            line = stream.readline(_MAX_HEADER)
            if not line:
                return
            if not line.startswith(_FRAME):
                raise ImageReadError("damaged", f"stdin: no frame begins where frame {number} should; send it again")
        data = stream.read(form.num_bytes)
        if form.is_raw and number == 0 and data.startswith(_MAGIC):
            raise ImageReadError("damaged", "stdin holds Y4M, which says its size itself; leave --raw out")
        if not data and form.is_raw:
            return
        if len(data) < form.num_bytes:
            raise ImageReadError("truncated", f"stdin ends inside frame {number}; those before it are done")
        yield _pixels(np.frombuffer(data, np.uint8), form)


def _pixels(data: Image, form: FrameFormat) -> Image:
    """A frame as an image, a copy where the layout is another."""
    height, width = form.height, form.width
    if form.layout in ("gray", "mono"):
        return data.reshape(height, width)
    if form.full:
        luma, chroma = data[: height * width], data[height * width :].reshape(2, height // 2, width // 2)
        blue, red = (plane.repeat(2, axis=0).repeat(2, axis=1) for plane in chroma)
        planes = np.stack([luma.reshape(height, width), red, blue], axis=2)
        return np.asarray(cv2.cvtColor(planes, cv2.COLOR_YCrCb2BGR), np.uint8)
    if form.layout == "420":
        return np.asarray(cv2.cvtColor(data.reshape(height * 3 // 2, width), cv2.COLOR_YUV2BGR_I420), np.uint8)
    pixels = data.reshape(height, width, 3)
    return pixels if form.layout == "bgr24" else np.ascontiguousarray(pixels[:, :, ::-1])


def head(form: FrameFormat, *, grey: bool) -> bytes:
    """Header of a stream of pictures like its source's; empty of raw pixels."""
    if form.is_raw:
        return b""
    tags = (f"W{form.width}", f"H{form.height}", *form.tags, "Cmono" if grey else "C420jpeg")
    return b" ".join([_MAGIC, *(tag.encode("ascii", "replace") for tag in tags)]) + b"\n"


def encoded(picture: Image, form: FrameFormat) -> bytes:
    """A picture, shape (H, W) for grey or (H, W, 3) in BGR order, as a frame of such a stream."""
    if form.is_raw:
        return (picture[:, :, ::-1] if form.layout == "rgb24" and picture.ndim == 3 else picture).tobytes()
    if picture.ndim == 3:
        picture = np.asarray(cv2.cvtColor(as_colour(picture), cv2.COLOR_BGR2YUV_I420), np.uint8)
    return _FRAME + b"\n" + picture.tobytes()
