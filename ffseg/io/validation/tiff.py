"""Header checks of TIFF, of which OpenCV reads some variants wrong: only those that it reads right pass."""

from __future__ import annotations

import struct
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

from ffseg.errors import ImageReadError
from ffseg.io.validation.base import Header, damaged, refuse_claim, truncated, unsupported
from ffseg.io.validation.strips import (
    DEFLATE,
    JPEG,
    LZW,
    NONE,
    OLD_DEFLATE,
    PACKBITS,
    Pieces,
    check_pieces,
)  # fmt: skip

_TYPE_CODES = {1: "B", 3: "H", 4: "I", 7: "B", 16: "Q"}
_BYTES = 7
MAX_ENTRIES = 512
"""Tags in one directory; real files have about twenty."""
MAX_VALUES = 2_000_000
"""Values of one tag: enough for the strips of an image at the pixel limit."""

_WIDTH, _HEIGHT, _BITS, _COMPRESSION, _PHOTOMETRIC, _FILL_ORDER = 256, 257, 258, 259, 262, 266
_STRIP_OFFSETS, _ORIENTATION, _SAMPLES, _STRIP_ROWS, _STRIP_BYTES, _PLANAR = 273, 274, 277, 278, 279, 284
_PREDICTOR, _COLOURS = 317, 320
_TILE_WIDTH, _TILE_HEIGHT, _TILE_OFFSETS, _TILE_BYTES = 322, 323, 324, 325
_EXTRA_SAMPLES, _SAMPLE_FORMAT, _JPEG_TABLES = 338, 339, 347
_MIN, _MAX, _SIGNED_MIN, _SIGNED_MAX = _STATED = (280, 281, 340, 341)
"""Smallest and largest value of a sample; where they are no whole numbers they say nothing here."""
_DEEP, _FULL = 16, 65535
_KNOWN = {
    *(_WIDTH, _HEIGHT, _BITS, _COMPRESSION, _PHOTOMETRIC, _FILL_ORDER, _STRIP_OFFSETS, _ORIENTATION, _SAMPLES),
    *(_STRIP_ROWS, _STRIP_BYTES, _PLANAR, _PREDICTOR, _COLOURS, _TILE_WIDTH, _TILE_HEIGHT),
    *(_TILE_OFFSETS, _TILE_BYTES, _EXTRA_SAMPLES, _SAMPLE_FORMAT, _JPEG_TABLES),
}

_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB, _PALETTE, _YCBCR = 0, 1, 2, 3, 6
_GREYS = (_WHITE_IS_ZERO, _BLACK_IS_ZERO)
_FAX = (2, 3, 4)

_DEFLATE_RATIO = 1032
_PIXELS_PER_BYTE = {
    NONE: 8,  # of one bit
    LZW: 20_480,  # a 12-bit code stands for at most 3840 bytes of eight pixels
    JPEG: 1024,  # as in JPEG files
    DEFLATE: 8 * _DEFLATE_RATIO,
    OLD_DEFLATE: 8 * _DEFLATE_RATIO,
    PACKBITS: 512,  # two bytes stand for 128 of eight pixels
}
"""The most pixels that a byte of packed data can stand for."""


@dataclass(frozen=True, slots=True)
class _Layout:
    """How the numbers of a TIFF file are stored."""

    order: str
    big: bool

    @property
    def entry_bytes(self) -> int:
        return 20 if self.big else 12

    def number(self, data: bytes, position: int, size: int) -> int:
        if position + size > len(data):
            raise truncated("the TIFF file ends inside its directory")
        return int.from_bytes(data[position : position + size], "little" if self.order == "<" else "big")


def tiff(data: bytes) -> Header:
    """First page of a TIFF file, if it is a variant that decodes right; the others are refused by name."""
    layout = _Layout("<" if data[:2] == b"II" else ">", data[2:4] in (b"+\0", b"\0+"))
    tags, several = _read_directory(data, layout)
    width, height, samples = _one(tags, _WIDTH, 0), _one(tags, _HEIGHT, 0), _one(tags, _SAMPLES, 1)
    _refuse_variants(tags)
    places = _places(tags, len(data))
    if width == 0 or height == 0:
        return Header("TIFF", width, height)
    compression, bits = _one(tags, _COMPRESSION, NONE), _one(tags, _BITS, 1) * samples
    most = _PIXELS_PER_BYTE[compression] // (bits if compression != JPEG else 1) + 1
    refuse_claim("TIFF", (width, height), min(sum(length for _, length in places), len(data)), most)
    pieces = _pieces(tags, (width, height), places)
    grey = samples == 1 and _one(tags, _PHOTOMETRIC, _BLACK_IS_ZERO) in _GREYS
    deep = _one(tags, _BITS, 1) == _DEEP and _one(tags, _PHOTOMETRIC, -1) != _WHITE_IS_ZERO
    return Header(
        "TIFF", width, height, grey=grey, several=several, check=partial(check_pieces, data, pieces),
        deep=deep, levels=_stated(tags) if deep else None,
    )  # fmt: skip


def _stated(tags: dict[int, tuple[int, ...]]) -> tuple[int, int] | None:
    """Least and largest value, where the file states the largest for all samples."""
    highest = tags.get(_SIGNED_MAX) or tags.get(_MAX) or (0,)
    lowest = tags.get(_SIGNED_MIN) or tags.get(_MIN) or (0,)
    low, high = min(lowest), max(highest)
    return (low, high) if low < high <= _FULL else None


def _pieces(tags: dict[int, tuple[int, ...]], size: tuple[int, int], places: tuple[tuple[int, int], ...]) -> Pieces:
    width, height = size
    bits = _one(tags, _BITS, 1) * _one(tags, _SAMPLES, 1)
    tiled = _TILE_WIDTH in tags
    if tiled:
        piece_width, full_rows = _one(tags, _TILE_WIDTH, 0), _one(tags, _TILE_HEIGHT, 0)
    else:
        piece_width, full_rows = width, min(_one(tags, _STRIP_ROWS, height), height)
    if piece_width == 0 or full_rows == 0 or piece_width % 16 * tiled:
        raise damaged(f"the TIFF file claims pieces of {piece_width}x{full_rows} pixels")
    across, down = -(-width // piece_width), -(-height // full_rows)
    if across * down != len(places):
        raise damaged(f"the TIFF file claims {width}x{height} pixels in {len(places)} pieces of {full_rows} rows")
    last = full_rows if tiled else height - (down - 1) * full_rows
    return Pieces(
        _one(tags, _COMPRESSION, NONE), piece_width * bits, piece_width,
        rows=(full_rows,) * (len(places) - 1) + (last,), full_rows=full_rows, places=places,
        tables=bytes(tags.get(_JPEG_TABLES, ())), tiled=tiled,
    )  # fmt: skip


def _one(tags: dict[int, tuple[int, ...]], tag: int, default: int) -> int:
    return tags.get(tag, (default,))[0]


def _read_directory(data: bytes, layout: _Layout) -> tuple[dict[int, tuple[int, ...]], bool]:
    """Known tags of the first directory, and whether another follows."""
    word = 8 if layout.big else 4
    start = layout.number(data, 8 if layout.big else 4, word)
    count_bytes = 8 if layout.big else 2
    count = layout.number(data, start, count_bytes)
    if count > MAX_ENTRIES:
        raise damaged(f"the TIFF directory claims {count} entries")
    tags: dict[int, tuple[int, ...]] = {}
    for index in range(count):
        position = start + count_bytes + index * layout.entry_bytes
        tag = layout.number(data, position, 2)
        if tag in tags:
            raise damaged(f"the TIFF directory has tag {tag} twice")
        if tag in _KNOWN:
            tags[tag] = _read_values(data, layout, position, tag)
        elif tag in _STATED:
            with suppress(ImageReadError):
                tags[tag] = _read_values(data, layout, position, tag)
    end = start + count_bytes + count * layout.entry_bytes
    return tags, any(data[end : end + word])


def _read_values(data: bytes, layout: _Layout, position: int, tag: int) -> tuple[int, ...]:
    kind = layout.number(data, position + 2, 2)
    word = 8 if layout.big else 4
    count = layout.number(data, position + 4, word)
    code = _TYPE_CODES.get(kind)
    if code is None or not 0 < count <= MAX_VALUES or (kind == _BYTES) != (tag == _JPEG_TABLES):
        raise damaged(f"a TIFF tag has {count} values of type {kind}")
    size = count * struct.calcsize(code)
    at = position + 4 + word
    if size > word:
        at = layout.number(data, at, word)
    if at + size > len(data):
        raise truncated("a TIFF tag points beyond the end of the file")
    return struct.unpack(f"{layout.order}{count}{code}", data[at : at + size])


def _refuse_variants(tags: dict[int, tuple[int, ...]]) -> None:
    samples, bits = _one(tags, _SAMPLES, 1), set(tags.get(_BITS, (1,)))
    photometric, compression = _one(tags, _PHOTOMETRIC, -1), _one(tags, _COMPRESSION, 1)
    if set(tags.get(_SAMPLE_FORMAT, (1,))) != {1}:
        raise unsupported("the TIFF pixels are signed, float or complex numbers, which have no fixed white level")
    if samples not in (1, 3) or _EXTRA_SAMPLES in tags:
        raise unsupported(f"the TIFF file has {samples} samples a pixel (alpha or further channels)")
    if bits not in ({8}, {16}) and not (bits == {1} and samples == 1):
        raise unsupported(f"the TIFF samples have {'/'.join(map(str, sorted(bits)))} bits")
    if samples == 3 and _one(tags, _PLANAR, 1) != 1:
        raise unsupported("the TIFF file keeps its colours in separate planes")
    if bits == {16} and _TILE_WIDTH in tags:
        raise unsupported("the TIFF file has tiles of 16-bit samples")
    _refuse_coding(bits, compression, _one(tags, _PREDICTOR, 1))
    if _one(tags, _FILL_ORDER, 1) != 1:
        raise unsupported("the TIFF file keeps the bits of its bytes in reverse")
    if samples == 1:
        right = photometric in _GREYS or (photometric == _PALETTE and bits == {8} and compression != JPEG)
    else:
        right = photometric == _RGB or (photometric == _YCBCR and compression == JPEG)
    if not right:
        raise unsupported(f"the TIFF colours are of a rare kind (photometric {photometric})")
    if photometric == _PALETTE and len(tags.get(_COLOURS, ())) != 3 << max(bits):
        raise damaged("the TIFF palette has not a colour for each number")


def _refuse_coding(bits: set[int], compression: int, predictor: int) -> None:
    known = (NONE, LZW, DEFLATE, OLD_DEFLATE, PACKBITS)
    if compression in _FAX:
        raise unsupported("the TIFF file holds a fax (CCITT), of which decoders give wrong rows where it is damaged")
    if compression not in known + ((JPEG,) if bits == {8} else ()):
        raise unsupported(f"the TIFF compression {compression} with {max(bits)} bits is not read")
    if predictor != 1 and not (predictor == 2 and compression in (LZW, DEFLATE, OLD_DEFLATE)):
        raise unsupported(f"the TIFF predictor {predictor} does not go with its compression")


def _places(tags: dict[int, tuple[int, ...]], size: int) -> tuple[tuple[int, int], ...]:
    """Offset and length of each strip or tile."""
    tiled = _TILE_WIDTH in tags
    offsets = tags.get(_TILE_OFFSETS if tiled else _STRIP_OFFSETS)
    counts = tags.get(_TILE_BYTES if tiled else _STRIP_BYTES)
    if offsets is None or counts is None or len(offsets) != len(counts):
        raise damaged("the TIFF file does not say where its pixels are")
    places = tuple(zip(offsets, counts, strict=True))
    if any(offset + count > size for offset, count in places):
        raise truncated("the TIFF pixels lie beyond the end of the file")
    return places
