"""Detection of cut films: by their stated lengths, the outermost parts of the container exceed the file.

References
----------
ISO/IEC 14496-12, 4.2 (boxes, of MP4 and MOV); RFC 8794, 4 to 6 (elements, of Matroska and WebM); RIFF (chunks, of AVI).
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO


def is_cut(path: str) -> bool:
    """Whether a film ends inside one of its parts; parts of unknown length, as of a film recorded live, are looked into.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    end = Path(path).stat().st_size
    with Path(path).open("rb") as file:
        mark, place = file.read(4), 0
        after = {b"RIFF": _after_chunk, b"\x1aE\xdf\xa3": _after_element}.get(mark, _after_box)
        while place < end:
            file.seek(place)
            place = after(file) or end
    return place > end


def _after_box(file: BinaryIO) -> int:
    """Where the next box begins; 0 where this one says that it goes to the end, or is none."""
    place, size, kind = file.tell(), int.from_bytes(file.read(4), "big"), file.read(4)
    if size == 1:
        size = int.from_bytes(file.read(8), "big")
    if len(kind) < 4:  # its head is cut
        return place + 8
    return place + size if size >= 8 and kind.isascii() else 0


def _after_chunk(file: BinaryIO) -> int:
    """Where the next chunk begins; 0 where this one does not say, as one that was sent through a pipe."""
    _, size = file.read(4), int.from_bytes(file.read(4), "little")
    return 0 if size in (0, 0xFFFFFFFF) else file.tell() + size


def _after_element(file: BinaryIO) -> int:
    """Where the next element begins, or the first inside one of unknown length; 0 where there is none."""
    try:
        size = _varying(file) and _varying(file)
    except EOFError:  # its head is cut
        return file.tell() + 1
    if not size:
        return 0
    length, unknown = size
    return file.tell() + (0 if unknown else length)


def _varying(file: BinaryIO) -> tuple[int, bool] | None:
    """A number whose first set bit tells its bytes, without that bit, and whether all others are set; None of none."""
    first = file.read(1)
    if first == b"\0":
        return None
    width = 9 - first[0].bit_length() if first else 1
    data = first + file.read(width - 1)
    if len(data) < width:
        raise EOFError
    value = int.from_bytes(data, "big") - (1 << 7 * width)
    return value, value == (1 << 7 * width) - 1
