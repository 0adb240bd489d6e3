"""Header checks of WebP: its chunks."""

from __future__ import annotations

import struct
from functools import partial

from ffseg.io.validation.base import (
    FLAT_PIXELS_PER_BYTE,
    FREE_PIXELS,
    Header,
    Probe,
    damaged,
    orientation_of,
    refuse_claim,
    truncated,
)

_CANVAS, _ANIMATION, _FRAME, _EXIF = b"VP8X", b"ANIM", b"ANMF", b"EXIF"
_IMAGES = (b"VP8 ", b"VP8L")
_HAS_EXIF = 8
"""Flag of the canvas chunk: viewers look for an EXIF chunk only when it is set."""
_FOLLOWING = 8 | 4
"""Flags of what stands behind an image: EXIF and XMP."""
_FRAME_HEADER = 16
"""Bytes of a frame before its own chunks."""
MAX_CHUNKS = 10_000
"""Of a whole file, frames included: five minutes of film."""
ZEROS = bytes(32)
"""A run of zeros to be doubted: encoders end flat images with up to thousands, but a lost block has at least 512."""
SPARE = 8
"""Bytes at the end of the data that a decoder may do without; encoders were seen to add up to three."""


def webp(data: bytes) -> Header:
    """Size and orientation of a WebP file; the chunks must fill it."""
    if len(data) < 30:
        raise truncated("the WebP file ends inside its header")
    end = int.from_bytes(data[4:8], "little") + 8
    if end > len(data):
        raise truncated("the WebP file is shorter than its header says")
    chunks = _chunks(data, 12, end)
    first, at, _ = chunks[0]
    names = [name for name, *_ in chunks]
    if first == _CANVAS:
        size = int.from_bytes(data[at + 4 : at + 7], "little") + 1, int.from_bytes(data[at + 7 : at + 10], "little") + 1
    elif first in _IMAGES:
        size = _image_size(data, first, at)
    else:
        raise damaged(f"the WebP file starts with the chunk {first!r}")
    if not any(name in (*_IMAGES, _FRAME) for name in names):
        raise truncated("the WebP file has no image behind its header")
    refuse_claim("WebP", size, len(data), FLAT_PIXELS_PER_BYTE, FREE_PIXELS)
    return Header(
        "WebP", *size, orientation=_orientation(data, chunks), several=names.count(_FRAME) > 1,
        still=_alone(data, chunks), check=partial(_probes, data, chunks),
    )  # fmt: skip


def _chunks(data: bytes, at: int, end: int) -> list[tuple[bytes, int, int]]:
    """Name, place of the content and its length, of every chunk."""
    chunks: list[tuple[bytes, int, int]] = []
    while at + 8 <= end:
        name, length = data[at : at + 4], int.from_bytes(data[at + 4 : at + 8], "little")
        if not all(32 <= byte < 127 for byte in name) or at + 8 + length > end or len(chunks) == MAX_CHUNKS:
            raise damaged("the chunks of the WebP file are out of place")
        chunks.append((name, at + 8, length))
        at += 8 + length + length % 2
    if not chunks:
        raise truncated("the WebP file has no chunk")
    return chunks


def _image_size(data: bytes, name: bytes, at: int) -> tuple[int, int]:
    if name == b"VP8L":
        bits = int.from_bytes(data[at + 1 : at + 5], "little")
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    width, height = struct.unpack("<HH", data[at + 6 : at + 10])
    return width & 0x3FFF, height & 0x3FFF


def _orientation(data: bytes, chunks: list[tuple[bytes, int, int]]) -> int:
    first, start, _ = chunks[0]
    if first != _CANVAS or not data[start] & _HAS_EXIF:
        return 1
    return next((orientation_of(data[at : at + length]) for name, at, length in chunks if name == _EXIF), 1)


def _probes(data: bytes, chunks: list[tuple[bytes, int, int]]) -> list[Probe]:
    """Probe of the first image; later frames of an animation are not read."""
    for name, at, length in chunks:
        if name == _FRAME:
            return _probes(data, _chunks(data, at + _FRAME_HEADER, at + length))
        body = data[at : at + length]
        if name in _IMAGES:
            return [(_file([_chunk(name, body[:-SPARE])]), False)] if ZEROS in body else []
    return []


def _alone(data: bytes, chunks: list[tuple[bytes, int, int]]) -> bytes | None:
    """The file up to its image: where chunks follow, the decoder takes them for more of the image's damaged data."""
    place = next((place for place, (name, *_) in enumerate(chunks) if name in _IMAGES), len(chunks))
    if place >= len(chunks) - 1:
        return None
    parts = [[name, data[at : at + length]] for name, at, length in chunks[: place + 1]]
    if parts[0][0] == _CANVAS:
        parts[0][1] = bytes([parts[0][1][0] & ~_FOLLOWING, *parts[0][1][1:]])
    return _file([_chunk(name, body) for name, body in parts])


def _chunk(name: bytes, body: bytes) -> bytes:
    return name + len(body).to_bytes(4, "little") + body + bytes(len(body) % 2)


def _file(chunks: list[bytes]) -> bytes:
    body = b"WEBP" + b"".join(chunks)
    return b"RIFF" + len(body).to_bytes(4, "little") + body
