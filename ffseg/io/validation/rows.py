"""Header checks of rows stored without compression, BMP and PNM: their length, and where zeros begin."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable

import numpy as np

from ffseg.arrays import Image
from ffseg.io.validation.base import Header, damaged, truncated, unsupported

_WITHIN = 6
"""Bytes of the broken row that must be zero: with fewer, a margin of two pixels looks the same."""


def interrupted(rows: Image) -> bool:
    """Whether stored rows break off into zeros inside a row whose upper neighbour goes on: a copy that stopped.

    A black margin does not look like this: above its first pixel the image is black as well.

    Parameters
    ----------
    rows : ndarray of uint8, shape (height, bytes a row)
        In file order.
    """
    if rows.shape[0] < 4 or rows[-2:].any() or not rows.any():
        return False
    last = int(np.flatnonzero(rows.any(axis=1))[-1])
    end = int(np.flatnonzero(rows[last])[-1]) + 1
    if last == 0 or rows.shape[1] - end < _WITHIN:
        return False
    return bool(np.count_nonzero(rows[last - 1]) >= 0.9 * rows.shape[1] and np.count_nonzero(rows[last]) >= 0.9 * end)


def _check(data: bytes, name: str, offset: int, rows: int, row_bytes: int) -> Callable[[], tuple[()]]:
    def check() -> tuple[()]:
        stored = np.frombuffer(data, np.uint8, rows * row_bytes, offset)
        if interrupted(stored.reshape(rows, row_bytes)):
            raise truncated(f"the {name} pixels break off into zeros inside a row")
        return ()

    return check


def bmp(data: bytes) -> Header:
    """Header of a BMP file without compression."""
    if len(data) < 54:
        raise truncated("the BMP file ends inside its header")
    offset, size = struct.unpack("<II", data[10:18])
    if size < 40:
        raise unsupported("the BMP file has the header of OS/2")
    width, height = struct.unpack("<ii", data[18:26])
    bits, compression = struct.unpack("<HI", data[28:34])
    if compression != 0 or bits not in (1, 4, 8, 24, 32):
        raise unsupported(f"the BMP file has {bits} bits a pixel with compression {compression}")
    colours = int.from_bytes(data[46:50], "little") or (1 << bits if bits <= 8 else 0)
    if bits <= 8 and colours > 1 << bits:
        raise damaged(f"the BMP palette claims {colours} colours of {bits} bits")
    if offset < 14 + size + (4 * colours if bits <= 8 else 0):
        raise damaged("the BMP pixels begin inside the header or palette")
    rows, row_bytes = abs(height), (width * bits + 31) // 32 * 4
    if width > 0 and offset + rows * row_bytes > len(data):
        raise truncated(f"the BMP header claims {width}x{rows} pixels, the file is too short for them")
    return Header("BMP", width, rows, check=_check(data, "BMP", offset, rows, row_bytes))


_PNM_FIELD = rb"(?:\s|#[^\r\n]*[\r\n])+(\d{1,9})"
_PNM_HEAD = re.compile(rb"P([1-6])" + _PNM_FIELD + _PNM_FIELD + rb"(?=\s)")
_PNM_LAST = re.compile(_PNM_FIELD + rb"\s")
_PNM_PLAIN = re.compile(rb"[\d\s]*")
_PNM_ABOVE_255 = re.compile(rb"\b0*(?:[1-9]\d{3,}|[3-9]\d\d|2[6-9]\d|25[6-9])\b")
_PNM_ABOVE_1 = re.compile(rb"[2-9]")


def pnm(data: bytes) -> Header:
    """Header of a PBM, PGM or PPM file, binary or text."""
    head = _PNM_HEAD.match(data[:4096])
    if head is None:
        raise damaged("the PNM header has no width and height")
    kind, width, height = (int(group) for group in head.groups())
    end, maximum = head.end() + 1, 1
    if kind not in (1, 4):
        last = _PNM_LAST.match(data[:4096], head.end())
        if last is None:
            raise damaged("the PNM header has no largest value")
        end, maximum = last.end(), int(last.group(1))
    if maximum not in (1, 255) or (maximum == 1) != (kind in (1, 4)):
        raise unsupported(f"the PNM file has a largest value of {maximum}, not 255")
    row_bytes = (width + 7) // 8 if kind == 4 else width * (3 if kind in (3, 6) else 1)
    samples = height * row_bytes
    needed = samples if kind >= 4 else samples + (samples - 1 if kind != 1 else 0)
    if end + needed > len(data):
        raise truncated(f"the PNM header claims {width}x{height} pixels, the file is too short for them")
    check = _check(data, "PNM", end, height, row_bytes) if kind >= 4 else _text_check(data, end, kind)
    return Header("PNM", width, height, grey=kind not in (3, 6), check=check)


def _text_check(data: bytes, start: int, kind: int) -> Callable[[], tuple[()]]:
    above = _PNM_ABOVE_1 if kind == 1 else _PNM_ABOVE_255

    def check() -> tuple[()]:
        plain = _PNM_PLAIN.match(data, start)
        if plain is None or plain.end() != len(data):
            raise damaged("the numbers of the PNM file are mixed with other characters")
        if above.search(data, start) is not None:
            raise damaged("the PNM file has numbers above its largest value")
        return ()

    return check
