"""The gate for TIFF, a format whose variants OpenCV partly reads wrong: only those it reads right pass."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from ffseg.formats.gate.headers import Header, damaged, truncated, unsupported

_TYPE_CODES = {1: "B", 3: "H", 4: "I", 16: "Q"}
MAX_ENTRIES = 512
"""Tags in one directory; real files have about twenty."""
MAX_VALUES = 2_000_000
"""Values of one tag: enough for the strips of an image at the pixel limit."""

_WIDTH, _HEIGHT, _BITS, _COMPRESSION, _PHOTOMETRIC = 256, 257, 258, 259, 262
_STRIP_OFFSETS, _ORIENTATION, _SAMPLES, _STRIP_BYTES, _PLANAR, _PREDICTOR = 273, 274, 277, 279, 284, 317
_TILE_WIDTH, _TILE_OFFSETS, _TILE_BYTES, _EXTRA_SAMPLES, _SAMPLE_FORMAT = 322, 324, 325, 338, 339
_KNOWN = {
    _WIDTH,
    _HEIGHT,
    _BITS,
    _COMPRESSION,
    _PHOTOMETRIC,
    _STRIP_OFFSETS,
    _SAMPLES,
    _STRIP_BYTES,
    _PLANAR,
    _PREDICTOR,
    _TILE_WIDTH,
    _TILE_OFFSETS,
    _TILE_BYTES,
    _EXTRA_SAMPLES,
    _SAMPLE_FORMAT,
    _ORIENTATION,
}

_NONE, _LZW, _JPEG, _DEFLATE, _PACKBITS, _OLD_DEFLATE = 1, 5, 7, 8, 32773, 32946
_FAX = (2, 3, 4)
_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB, _PALETTE, _YCBCR = 0, 1, 2, 3, 6
_GREYS = (_WHITE_IS_ZERO, _BLACK_IS_ZERO)


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
    tags = _read_directory(data, layout)
    width, height, samples = _one(tags, _WIDTH, 0), _one(tags, _HEIGHT, 0), _one(tags, _SAMPLES, 1)
    _refuse_variants(tags)
    _check_extent(tags, len(data))
    plain = _one(tags, _COMPRESSION, _NONE) == _NONE and _TILE_WIDTH not in tags
    if plain and sum(tags[_STRIP_BYTES]) < height * ((width * samples * max(tags.get(_BITS, (1,))) + 7) // 8):
        raise truncated(f"the TIFF header claims {width}x{height} pixels, its strips hold fewer")
    grey = samples == 1 and _one(tags, _PHOTOMETRIC, _BLACK_IS_ZERO) in _GREYS
    return Header("TIFF", width, height, grey=grey, raw=plain and _one(tags, _ORIENTATION, 1) == 1)


def _one(tags: dict[int, tuple[int, ...]], tag: int, default: int) -> int:
    return tags.get(tag, (default,))[0]


def _read_directory(data: bytes, layout: _Layout) -> dict[int, tuple[int, ...]]:
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
        if tag in _KNOWN:
            tags[tag] = _read_values(data, layout, position)
    return tags


def _read_values(data: bytes, layout: _Layout, position: int) -> tuple[int, ...]:
    kind = layout.number(data, position + 2, 2)
    word = 8 if layout.big else 4
    count = layout.number(data, position + 4, word)
    code = _TYPE_CODES.get(kind)
    if code is None or not 0 < count <= MAX_VALUES:
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
    if samples == 1:
        right = photometric in _GREYS or (photometric == _PALETTE and bits == {8} and compression != _JPEG)
    else:
        right = photometric == _RGB or (photometric == _YCBCR and compression == _JPEG)
    if not right:
        raise unsupported(f"the TIFF colours are of a rare kind (photometric {photometric})")


def _refuse_coding(bits: set[int], compression: int, predictor: int) -> None:
    known = (_NONE, _LZW, _DEFLATE, _OLD_DEFLATE, _PACKBITS)
    if compression not in known + (_FAX if bits == {1} else ()) + ((_JPEG,) if bits == {8} else ()):
        raise unsupported(f"the TIFF compression {compression} with {max(bits)} bits is not read")
    if predictor != 1 and not (predictor == 2 and compression in (_LZW, _DEFLATE, _OLD_DEFLATE)):
        raise unsupported(f"the TIFF predictor {predictor} does not go with its compression")


def _check_extent(tags: dict[int, tuple[int, ...]], size: int) -> None:
    tiled = _TILE_WIDTH in tags
    offsets = tags.get(_TILE_OFFSETS if tiled else _STRIP_OFFSETS)
    counts = tags.get(_TILE_BYTES if tiled else _STRIP_BYTES)
    if offsets is None or counts is None or len(offsets) != len(counts):
        raise damaged("the TIFF file does not say where its pixels are")
    if any(offset + count > size for offset, count in zip(offsets, counts, strict=True)):
        raise truncated("the TIFF pixels lie beyond the end of the file")
