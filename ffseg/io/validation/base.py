"""Results of the header checks: the header as a value, the EXIF orientation, and the errors of a refusal."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from ffseg.errors import ImageReadError

FREE_PIXELS = 4_000_000
"""An image up to this size is read however few bytes it has: 2000x2000 pixels cost any decoder under 100 MB."""
FLAT_PIXELS_PER_BYTE = 4096
"""Beyond `FREE_PIXELS`, for codings that need no bit for a flat area: a disc on flat ground, drawn at 100 Mpx, still has
a byte for each 2000 pixels, and less has no outline to be found."""


Probe = tuple[bytes, bool]
"""A copy of a file whose data has zeros as lost blocks leave them, with the end of its packed data missing or with more behind
it, and whether a decoder takes it when the pixels end where the data does: then the zeros belong to them."""


@dataclass(frozen=True, slots=True)
class Header:
    """What the gate found.

    Attributes
    ----------
    format : str
        ``PNG``, ``JPEG``, ``BMP``, ``TIFF``, ``WebP``, ``GIF``, ``PNM``, ``JPEG 2000``, ``AVIF`` or ``HEIC``.
    width, height : int
        As stored, before any orientation is applied.
    grey : bool
        The pixels have one colour channel.
    orientation : int
        EXIF's number for what turns the pixels upright; 0 leaves it to the decoder.
    deep : bool
        Samples have 16 bits, of which the least is black.
    levels : (int, int) or None
        Of black and white, where the file states them for 16 bits.
    several : bool
        More frames or pages follow the first.
    still : bytes or None
        The image as a file of its own, where decoders take another frame for it.
    check : callable
        Looks through the packed pixels, to be called once the size is accepted; raises ``ImageReadError``, or gives
        what only a decoder can tell.
    """

    format: str
    width: int
    height: int
    grey: bool = False
    orientation: int = 0
    several: bool = False
    deep: bool = False
    levels: tuple[int, int] | None = None
    still: bytes | None = None
    check: Callable[[], Iterable[Probe]] = tuple


def damaged(text: str) -> ImageReadError:
    """Error for data that contradicts itself."""
    return ImageReadError("damaged", f"{text}; copy the file again or convert it")


def truncated(text: str) -> ImageReadError:
    """Error for data that ends before the image does."""
    return ImageReadError("truncated", f"{text}; copy the file again")


def unsupported(text: str) -> ImageReadError:
    """Error for an image whose pixels have no reading that is sure to be right."""
    return ImageReadError("unsupported-pixels", f"{text}; convert it to an 8-bit PNG")


def refuse_claim(name: str, size: tuple[int, int], num_bytes: int, per_byte: int, free: int = 0) -> None:
    """Refuse a header that claims more pixels than its bytes can stand for.

    Parameters
    ----------
    name : str
        Of the format.
    size : (int, int)
        Width and height, pixels.
    num_bytes : int
        Of the packed data.
    per_byte : int
        Pixels that one byte can stand for.
    free : int
        Pixels that need no byte.
    """
    width, height = size
    if width * height > free + num_bytes * per_byte:
        raise truncated(f"the {name} header claims {width}x{height} pixels, {num_bytes} bytes cannot hold them")


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
