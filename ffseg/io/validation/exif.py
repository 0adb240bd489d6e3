"""Which way up an image is, by the EXIF block that came with it."""

from __future__ import annotations

import struct

_PREFIX = b"Exif\0\0"
"""Stands before the block in a JPEG file, and in WebP files of programs that copy it from there."""
_ORIENTATION_TAG = 0x112
_SHORT = 3
"""The type that EXIF gives the orientation; some readers take any other for it too, with numbers nobody meant."""
_MAX_ENTRIES = 512
"""Tags in one directory; cameras write about forty."""


def orientation_of(block: bytes) -> int:
    """EXIF's number 1 to 8 of what turns the pixels upright; 1 when the block gives none."""
    block = block.removeprefix(_PREFIX)
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(block[:4])
    if order is None or len(block) < 8:
        return 1
    start = struct.unpack(order + "I", block[4:8])[0]
    if start + 2 > len(block):
        return 1
    count = struct.unpack(order + "H", block[start : start + 2])[0]
    for at in range(start + 2, start + 2 + 12 * min(count, _MAX_ENTRIES), 12):
        if at + 12 > len(block):
            return 1
        tag, kind = struct.unpack(order + "HH", block[at : at + 4])
        if tag == _ORIENTATION_TAG and kind == _SHORT:
            count, code = struct.unpack_from(order + "IH", block, at + 4)
            return code if count == 1 and 1 <= code <= 8 else 1
    return 1
