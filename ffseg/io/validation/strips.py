"""Whether the packed strips or tiles of a TIFF file unpack completely, tested before it is decoded.

Decoders of TIFF fill what they cannot unpack with black and say nothing.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ffseg.errors import ImageReadError
from ffseg.io.validation.base import Header, Probe, damaged, truncated
from ffseg.io.validation.jpeg import jpeg
from ffseg.io.validation.rows import interrupted
from ffseg.native import _core

NONE, LZW, JPEG, DEFLATE, PACKBITS, OLD_DEFLATE = 1, 5, 7, 8, 32773, 32946
_STEP = 1 << 20
"""Bytes unpacked at a time: what is checked is not kept."""


@dataclass(frozen=True, slots=True)
class Pieces:
    """Strips or tiles of one TIFF image.

    Attributes
    ----------
    row_bits : int
        Bits of one unpacked row of a piece.
    width : int
        Pixels of such a row.
    rows : tuple of int
        Rows of each piece that the image needs; tiles have all of theirs.
    full_rows : int
        Rows that a piece may have; the last strip is written with all of them by some programs.
    places : tuple of (int, int)
        Offset and length of each.
    tables : bytes
        What the pieces of JPEG data share.
    """

    compression: int
    row_bits: int
    width: int
    rows: tuple[int, ...]
    full_rows: int
    places: tuple[tuple[int, int], ...]
    tables: bytes = b""
    tiled: bool = False

    @property
    def row_bytes(self) -> int:
        """Bytes of one unpacked row."""
        return (self.row_bits + 7) // 8

    def packed(self, data: bytes) -> Iterator[tuple[bytes, int]]:
        """Content and needed rows of each piece."""
        for (offset, length), rows in zip(self.places, self.rows, strict=True):
            yield data[offset : offset + length], rows


def check_pieces(data: bytes, pieces: Pieces) -> list[Probe]:
    """Refuse a TIFF file whose pieces do not unpack to the rows they stand for.

    Returns
    -------
    list of Probe
        Of JPEG data.

    Raises
    ------
    ImageReadError
        ``truncated`` or ``damaged``.
    """
    if pieces.compression == NONE:
        _check_plain(data, pieces)
        return []
    probes: list[Probe] = []
    for index, (packed, rows) in enumerate(pieces.packed(data), start=1):
        header = _jpeg(packed, rows, pieces) if pieces.compression == JPEG else None
        if header is None and not _is_whole(packed, rows, pieces):
            kind = "tile" if pieces.tiled else "strip"
            raise damaged(f"{kind} {index} of {len(pieces.places)} of the TIFF file does not unpack to its {rows} rows")
        probes += header.check() if header is not None else ()
    return probes


def _check_plain(data: bytes, pieces: Pieces) -> None:
    if any(len(packed) < rows * pieces.row_bytes for packed, rows in pieces.packed(data)):
        raise truncated("a strip of the TIFF file is shorter than its rows")
    offset, length = pieces.places[-1]
    if pieces.tiled or any(data[offset : offset + length][-pieces.row_bytes :]):  # the usual case, without a copy
        return
    stored = b"".join(packed[: rows * pieces.row_bytes] for packed, rows in pieces.packed(data))
    if interrupted(np.frombuffer(stored, np.uint8).reshape(-1, pieces.row_bytes)):
        raise truncated("the TIFF pixels break off into zeros inside a row")


def _is_whole(packed: bytes, rows: int, pieces: Pieces) -> bool:
    sizes = (rows * pieces.row_bytes, pieces.full_rows * pieces.row_bytes)
    if pieces.compression == LZW:
        return _core.lzw_size(packed) in sizes
    if pieces.compression == PACKBITS:
        return _core.packbits_size(packed) in sizes
    return pieces.compression != JPEG and _inflated_size(packed, max(sizes)) in sizes


def _inflated_size(packed: bytes, most: int) -> int:
    """Bytes that a deflate stream of right checksum stands for; -1 if it has none, or is longer than `most`."""
    stream, total, rest = zlib.decompressobj(), 0, packed
    try:
        while not stream.eof and total <= most and (rest or total == 0):
            total += len(stream.decompress(rest, _STEP))
            rest = stream.unconsumed_tail
    except zlib.error:
        return -1
    return total if stream.eof else -1


def _jpeg(packed: bytes, rows: int, pieces: Pieces) -> Header | None:
    """Header of a piece that is a JPEG image of its size, with an end marker; None if it is not."""
    if packed[:2] != b"\xff\xd8" or not packed.rstrip(b"\0").endswith(b"\xff\xd9"):
        return None
    tables = pieces.tables[2:].removesuffix(b"\xff\xd9")
    try:
        header = jpeg(packed[:2] + tables + packed[2:])
    except ImageReadError:
        return None
    return header if header.width == pieces.width and header.height in (rows, pieces.full_rows) else None
