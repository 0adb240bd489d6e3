"""Header checks of JPEG: frame header, number of scans, and runs of zeros in place of pixels."""

from __future__ import annotations

import re
import struct
from dataclasses import replace
from functools import partial

from ffseg.io.validation.base import Header, Probe, damaged, orientation_of, refuse_claim, truncated, unsupported

PIXELS_PER_BYTE = 1024
"""Huffman coding spends a bit or more on each 8x8 block of the DC scan: six bits on 16x16 pixels with 4:2:0 colours."""
MAX_SCANS = 100
"""Each scan walks over the whole image. Encoders write 10 to 20; the colour components of a file in which every
coefficient is sent alone and refined twice have 64."""
SCAN_PIXELS = 500_000_000
"""Pixels of all scans together, beyond the first `FREE_SCANS`: about two seconds of decoding."""
FREE_SCANS = 20
ZEROS = bytes(64)
"""A run of zeros to be doubted: flat ground may be packed so, lost blocks leave 512 and more."""
SPARE = 8
"""Bytes before the end marker that a decoder may do without: those it has read ahead."""
MORE = bytes(32)
"""In place of the end marker: what a decoder may read ahead. One that wants more has lost some."""
_APP1 = 0xE1
_SCAN, _END = re.compile(rb"\xff\xda"), b"\xff\xd9"
_SEQUENTIAL, _PROGRESSIVE = (0xC0, 0xC1), 0xC2


def jpeg(data: bytes) -> Header:
    """Find the frame header of a JPEG file; it must be Huffman coded, 8 bits, 1, 3 or 4 components."""
    # Some cameras pad with zeros, but after the end marker; zeros inside the scan decode to flat grey.
    if not data[-64:].strip(b"\0") and not data.rstrip(b"\0").endswith(_END):
        raise truncated("the JPEG data breaks off into zeros (an interrupted copy?)")
    frame: tuple[int, int, int, int] | None = None
    interval, turned = 0, 1
    for marker, at in _segments(data):
        if marker == 0xDA:
            if frame is None:
                raise damaged("the JPEG file has no frame header before its data")
            return replace(_header(data, frame, at, interval), orientation=turned)
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            if frame is not None:
                raise damaged("the JPEG file has two frame headers")
            frame = _frame(data, at, marker)
        if marker == _APP1 and turned == 1:
            length = int.from_bytes(data[at + 2 : at + 4], "big")
            turned = orientation_of(data[at + 4 : at + 2 + length])
        if marker == 0xDD:
            interval = int.from_bytes(data[at + 4 : at + 6], "big")
    raise truncated("the JPEG file ends inside its header")


def _segments(data: bytes) -> list[tuple[int, int]]:
    """Markers and their places, up to the first scan."""
    found, at = [], 2
    while at + 4 <= len(data):
        if data[at] != 0xFF:
            raise damaged("the JPEG markers are out of place")
        marker = data[at + 1]
        if marker == 0xFF or marker == 0x01 or 0xD0 <= marker <= 0xD8:
            at += 1 if marker == 0xFF else 2
            continue
        if marker == 0xD9:
            raise damaged("the JPEG file has no frame header before its data")
        found.append((marker, at))
        if marker == 0xDA:
            break
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return found


def _frame(data: bytes, at: int, marker: int) -> tuple[int, int, int, int]:
    """Marker, width, height and number of components."""
    if at + 10 > len(data):
        raise truncated("the JPEG file ends inside its header")
    precision, height, width, components = struct.unpack(">BHHB", data[at + 4 : at + 10])
    if marker > _PROGRESSIVE or precision != 8:
        raise unsupported(f"the JPEG file uses a rare coding (frame type {marker - 0xC0}, {precision} bits)")
    if components not in (1, 3, 4):
        raise unsupported(f"the JPEG file has {components} components")
    refuse_claim("JPEG", (width, height), len(data), PIXELS_PER_BYTE)
    return marker, width, height, components


def _header(data: bytes, frame: tuple[int, int, int, int], scan: int, interval: int) -> Header:
    marker, width, height, components = frame
    together = scan + 4 < len(data) and data[scan + 4] == components
    single = marker in _SEQUENTIAL and together  # the decoder stops after it, whatever follows
    scans, pixels = len(_SCAN.findall(data, scan)) if not single else 1, width * height
    if scans > MAX_SCANS or (scans > FREE_SCANS and scans * pixels > SCAN_PIXELS):
        raise unsupported(f"the JPEG file goes over its {pixels} pixels in {scans} scans, made to waste time")
    return Header(
        "JPEG", width, height, grey=components == 1, check=partial(_probes, data, scan, interval) if single else tuple
    )


def _probes(data: bytes, scan: int, interval: int) -> list[Probe]:
    zeros, end = data.find(ZEROS, scan), -1
    if zeros >= 0:
        end = data.find(_END, scan)
    if zeros > end - 1:
        return []
    _refuse_lost_intervals(data[scan:end], interval)
    return [(data[: end - SPARE], False), (data[:end] + MORE, True)]


def _refuse_lost_intervals(scan: bytes, interval: int) -> None:
    """Restart markers count from 0 to 7 and begin again; lost blocks take some with them."""
    counts = [byte[0] & 7 for byte in re.findall(rb"\xff([\xd0-\xd7])", scan)] if interval else []
    if any(count != index % 8 for index, count in enumerate(counts)):
        raise damaged("restart markers of the JPEG data are missing (lost blocks?)")
