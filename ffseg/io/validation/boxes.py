"""Header checks of formats made of boxes: JPEG 2000, AVIF and HEIC."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from ffseg.io.validation.base import (
    FLAT_PIXELS_PER_BYTE,
    FREE_PIXELS,
    Header,
    damaged,
    refuse_claim,
    truncated,
    unsupported,
)  # fmt: skip
from ffseg.io.validation.streams import frame_size, jpeg2000_stream

MAX_BOXES = 1000
"""Boxes of one level; a still picture has about ten."""
ZEROS = 64
"""Zeros that no encoder writes: at the end of AVIF data, as its range coder ends with a one; anywhere in those of HEVC, which
puts a 3 behind two (emulation prevention)."""


def _boxes(data: bytes, at: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Name, start and end of the content of each box."""
    for _ in range(MAX_BOXES):
        if at + 8 > end:
            return
        size, name, head = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8], 8
        if size == 1:
            size, head = int.from_bytes(data[at + 8 : at + 16], "big"), 16
        stop = end if size == 0 else at + size
        if stop > end or stop < at + head:
            raise truncated(f"the box {name!r} ends beyond its file")
        yield name, at + head, stop
        at = stop
    raise damaged(f"the file has more than {MAX_BOXES} boxes")


_GREY, _SRGB = 17, 16


def jpeg2000(data: bytes) -> Header:
    """Header boxes of a JP2 file and the size marker of its code stream, which must reach its end marker."""
    boxes = {name: (at, end) for name, at, end in _boxes(data, 0, len(data))}
    if b"jp2h" not in boxes or b"jp2c" not in boxes:
        raise truncated("the JPEG 2000 file ends inside its header")
    parts = {name: (at, end) for name, at, end in _boxes(data, *boxes[b"jp2h"])}
    if b"ihdr" not in parts:
        raise damaged("the JPEG 2000 file has no image header")
    height, width, channels, bits = struct.unpack(">IIHB", data[parts[b"ihdr"][0] :][:11].ljust(11, b"\0"))
    if b"pclr" in parts or b"cmap" in parts:
        raise unsupported("the JPEG 2000 file has a palette")
    if channels not in (1, 3) or bits != 7:
        raise unsupported(f"the JPEG 2000 file has {channels} channels of {(bits & 127) + 1} bits")
    _refuse_colours(data, parts)
    at, end = boxes[b"jp2c"]
    _check_stream(data[at:end], (width, height), channels)
    return Header("JPEG 2000", width, height, grey=channels == 1)


def _refuse_colours(data: bytes, parts: dict[bytes, tuple[int, int]]) -> None:
    at, end = parts.get(b"colr", (0, 0))
    if end - at >= 7 and data[at] == 1 and int.from_bytes(data[at + 3 : at + 7], "big") not in (_GREY, _SRGB):
        raise unsupported("the JPEG 2000 file is neither grey nor sRGB")
    at, end = parts.get(b"cdef", (0, 0))
    for entry in range(at + 2, end - 5, 6):
        number, kind, colour = struct.unpack(">HHH", data[entry : entry + 6])
        if kind != 0 or colour not in (0, number + 1):
            raise unsupported("the JPEG 2000 file keeps its channels in another order")


def _check_stream(stream: bytes, size: tuple[int, int], channels: int) -> None:
    refuse_claim("JPEG 2000", size, len(stream), FLAT_PIXELS_PER_BYTE, FREE_PIXELS)
    found = jpeg2000_stream(stream)
    if (found.width, found.height) != size or len(found.channels) != 3 * channels:
        raise damaged("the JPEG 2000 code stream has not the size its header claims")
    if found.channels != b"\x07\x01\x01" * channels:
        raise unsupported("the JPEG 2000 channels are not of 8 bits and full size")
    if stream[-2:] != b"\xff\xd9":
        raise truncated("the JPEG 2000 file does not end with its end marker")


@dataclass(slots=True)
class _Meta:
    """What the boxes of an AVIF file say of its items."""

    primary: int = 0
    kinds: dict[int, bytes] = field(default_factory=dict)
    properties: list[tuple[bytes, int, int]] = field(default_factory=list)
    of_item: dict[int, list[int]] = field(default_factory=dict)
    places: dict[int, tuple[int, int]] = field(default_factory=dict)

    def named(self, item: int, name: bytes) -> tuple[int, int] | None:
        """Content of an item's property."""
        return next(((at, end) for kind, at, end in self.listed(item) if kind == name), None)

    def listed(self, item: int) -> list[tuple[bytes, int, int]]:
        """Properties of an item, in the order that they apply."""
        return [self.properties[i - 1] for i in self.of_item.get(item, ()) if 0 < i <= len(self.properties)]


def _primary(data: bytes, format_: str) -> tuple[dict[bytes, tuple[int, int]], _Meta, tuple[int, int]]:
    """Boxes of the file, what describes its items, and width and height of the primary one."""
    top = {name: (at, end) for name, at, end in _boxes(data, 0, len(data))}
    if b"meta" not in top:
        raise truncated(f"the {format_} file ends inside its header, or has no still picture")
    meta = _read_meta(data, *top[b"meta"])
    extent = meta.named(meta.primary, b"ispe")
    if extent is None or extent[1] - extent[0] < 12:
        raise damaged(f"the {format_} file does not say how large its image is")
    width, height = struct.unpack(">II", data[extent[0] + 4 : extent[0] + 12])
    return top, meta, (width, height)


def avif(data: bytes) -> Header:
    """Size and orientation of the primary image of an AVIF file."""
    top, meta, size = _primary(data, "AVIF")
    kind = meta.kinds.get(meta.primary)
    if kind != b"av01":
        raise unsupported("the AVIF image is put together from several")
    refuse_claim("AVIF", size, len(data), FLAT_PIXELS_PER_BYTE, FREE_PIXELS)
    coded = frame_size(_first_bytes(data, meta))
    if coded != size:
        raise damaged(f"the AVIF file claims {size[0]}x{size[1]} pixels, its frame is {coded[0]}x{coded[1]}")
    if not data[-ZEROS:].strip(b"\0"):
        raise damaged(f"the last {ZEROS} bytes of the AVIF file are zeros (an interrupted copy?)")
    return Header("AVIF", *size, orientation=_turn(data, meta), several=b"moov" in top)


def heic(data: bytes) -> Header:
    """Size of the primary image of a HEIC file, of one piece or of tiles, none of which lies beyond the file.

    Its decoder turns it upright.
    """
    _, meta, size = _primary(data, "HEIC")
    if meta.kinds.get(meta.primary) not in (b"hvc1", b"grid"):
        raise unsupported("the HEIF image is not coded as HEVC")
    refuse_claim("HEIC", size, len(data), FLAT_PIXELS_PER_BYTE, FREE_PIXELS)
    cropped = meta.named(meta.primary, b"clap")  # sides that are odd are coded a pixel longer
    if cropped is not None and cropped[1] - cropped[0] >= 16:
        width, per_width, height, per_height = struct.unpack(">4I", data[cropped[0] : cropped[0] + 16])
        size = (width // max(per_width, 1), height // max(per_height, 1))
    if any(at + length > len(data) for at, length in meta.places.values()):
        raise truncated("the HEIC pixels lie beyond the end of the file")
    coded = (place for item, place in meta.places.items() if meta.kinds.get(item) == b"hvc1")
    if any(data.find(bytes(ZEROS), at, at + length) >= 0 for at, length in coded):
        raise damaged(f"{ZEROS} bytes of the HEIC pixels in a row are zeros (an interrupted copy?)")
    return Header("HEIC", *size)


_SEQUENCE_BYTES = 64
"""The sequence header stands first in the data and is shorter."""


def _first_bytes(data: bytes, meta: _Meta) -> bytes:
    at, length = meta.places.get(meta.primary, (0, 0))
    if at + length > len(data) or length == 0:
        raise truncated("the AVIF pixels lie beyond the end of the file")
    return data[at : at + min(length, _SEQUENCE_BYTES)]


# Rotation by quarter turns against the clock, and mirroring, as EXIF numbers.
_ROTATED = (1, 8, 3, 6)
_MIRRORED = (4, 2)
_BOTH = {
    (8, 4): 5,
    (8, 2): 7,
    (3, 4): 2,
    (3, 2): 4,
    (6, 4): 7,
    (6, 2): 5,
    (4, 8): 7,
    (2, 8): 5,
    (4, 3): 2,
    (2, 3): 4,
    (4, 6): 5,
    (2, 6): 7,
}
"""The one after the other; they apply in the order in which they are listed."""


def _turn(data: bytes, meta: _Meta) -> int:
    """EXIF's number for the rotation and mirroring of the primary image."""
    code = 1
    for name, at, _ in meta.listed(meta.primary):
        if name == b"clap":
            raise unsupported("the AVIF image is to be cropped")
        if name not in (b"irot", b"imir"):
            continue
        step = _ROTATED[data[at] & 3] if name == b"irot" else _MIRRORED[data[at] & 1]
        if step != 1:
            code = step if code == 1 else _BOTH.get((code, step), 0)
    if code == 0:
        raise unsupported("the AVIF image is to be turned twice")
    return code


def _read_meta(data: bytes, at: int, end: int) -> _Meta:
    meta = _Meta()
    for name, start, stop in _boxes(data, at + 4, end):
        if name == b"pitm":
            meta.primary = int.from_bytes(data[start + 4 : start + (8 if data[start] else 6)], "big")
        elif name == b"iinf":
            _read_items(data, start, stop, meta)
        elif name == b"iloc":
            _read_places(data, start, stop, meta)
        elif name == b"iprp":
            for kind, first, last in _boxes(data, start, stop):
                if kind == b"ipco":
                    meta.properties = list(_boxes(data, first, last))
                elif kind == b"ipma":
                    _read_associations(data[first:last], meta)
    return meta


def _read_items(data: bytes, at: int, end: int, meta: _Meta) -> None:
    for name, start, _ in _boxes(data, at + (8 if data[at] else 6), end):
        if name == b"infe" and data[start] >= 2:
            wide = 4 if data[start] == 3 else 2
            number = int.from_bytes(data[start + 4 : start + 4 + wide], "big")
            meta.kinds[number] = data[start + 6 + wide : start + 10 + wide]


class _Fields:
    def __init__(self, content: bytes) -> None:
        self._content, self._at = content, 0

    def number(self, size: int) -> int:
        """The next number of `size` bytes."""
        part = self._content[self._at : self._at + size]
        if len(part) < size:
            raise truncated("the file ends inside a box")
        self._at += size
        return int.from_bytes(part, "big")


def _read_associations(content: bytes, meta: _Meta) -> None:
    fields = _Fields(content)
    version, flags = fields.number(1), fields.number(3)
    for _ in range(min(fields.number(4), MAX_BOXES)):
        item = fields.number(4 if version else 2)
        wide = 2 if flags & 1 else 1
        mask = 0x7FFF if flags & 1 else 0x7F
        meta.of_item.setdefault(item, []).extend([fields.number(wide) & mask for _ in range(fields.number(1))])


def _read_places(data: bytes, at: int, end: int, meta: _Meta) -> None:
    """First extent of each item stored in the file itself."""
    fields = _Fields(data[at:end])
    version = fields.number(4) >> 24
    sizes = fields.number(2)
    offset_bytes, length_bytes, base_bytes, index_bytes = (sizes >> shift & 15 for shift in (12, 8, 4, 0))
    for _ in range(min(fields.number(4 if version == 2 else 2), MAX_BOXES)):
        item = fields.number(4 if version == 2 else 2)
        method = fields.number(2) & 15 if version else 0
        fields.number(2)
        base = fields.number(base_bytes)
        for index in range(fields.number(2)):
            fields.number(index_bytes if version else 0)
            offset, length = fields.number(offset_bytes), fields.number(length_bytes)
            if index == 0 and method == 0:
                meta.places[item] = base + offset, length
