"""Headers of the code streams inside AVIF and JP2 files: AV1's frame size, the packets of JPEG 2000."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from ffseg.io.validation.base import damaged, truncated, unsupported

_SEQUENCE_HEADER, _DELIMITER = 1, 2


class _Bits:
    """Bits of a byte string, the highest of each byte first; zeros stand behind its end."""

    def __init__(self, data: bytes) -> None:
        self._value, self._left = int.from_bytes(data, "big"), 8 * len(data)

    def take(self, count: int) -> int:
        """The next `count` bits as a number."""
        self._left -= count
        shifted = self._value >> self._left if self._left >= 0 else self._value << -self._left
        return shifted & (1 << count) - 1

    def skip_exponential(self) -> None:
        """Step over a number of variable length (Exp-Golomb)."""
        zeros = 0
        while self._left > 0 and not self.take(1):
            zeros += 1
        self.take(zeros if zeros < 32 else 0)


def frame_size(data: bytes) -> tuple[int, int]:
    """Largest width and height of the frames, pixels.

    Parameters
    ----------
    data : bytes
        Beginning of the stream: a sequence header, after a temporal delimiter at most.
    """
    at = 0
    while at + 2 <= len(data):
        kind, extended, sized = data[at] >> 3 & 15, data[at] & 4, data[at] & 2
        at += 2 if extended else 1
        length, at = _leb128(data, at) if sized else (len(data) - at, at)
        if kind == _SEQUENCE_HEADER:
            return _size(_Bits(data[at : at + length]))
        if kind != _DELIMITER:
            break
        at += length
    raise damaged("the AVIF image does not begin with its sequence header")


def _leb128(data: bytes, at: int) -> tuple[int, int]:
    """A number of seven bits a byte, lowest first, and the place behind it."""
    value = 0
    for index in range(8):
        byte = data[at + index] if at + index < len(data) else 0
        value |= (byte & 127) << 7 * index
        if not byte & 128:
            return value, at + index + 1
    raise damaged("a length in the AVIF image has no end")


def _size(bits: _Bits) -> tuple[int, int]:
    """Fields of the sequence header up to the frame size, in the order of the AV1 specification, 5.5.1."""
    bits.take(4)  # profile, still picture
    if bits.take(1):  # reduced header
        bits.take(5)
    else:
        _skip_operating_points(bits)
    width_bits, height_bits = bits.take(4) + 1, bits.take(4) + 1
    return bits.take(width_bits) + 1, bits.take(height_bits) + 1


def _skip_operating_points(bits: _Bits) -> None:
    delay_bits = 0
    if bits.take(1):  # timing
        bits.take(64)
        if bits.take(1):
            bits.skip_exponential()
        if bits.take(1):  # decoder model
            delay_bits = bits.take(5) + 1
            bits.take(42)
    display_delay = bits.take(1)
    for _ in range(bits.take(5) + 1):
        bits.take(12)
        if bits.take(5) > 7:
            bits.take(1)
        if delay_bits and bits.take(1):
            bits.take(2 * delay_bits + 1)
        if display_delay and bits.take(1):
            bits.take(4)


_START, _SIZE, _CODING, _COMPONENT, _ORDER = 0xFF4F, 0xFF51, 0xFF52, 0xFF53, 0xFF5F
_TILE, _DATA, _END = 0xFF90, 0xFF93, 0xFFD9
_TILE_HEADER = 14
"""Bytes of the shortest header of a tile."""
_USER_PRECINCTS = 1
_MIN_BLOCK = 8
"""Binary logarithm of the samples of a code block, of 16x16: a decoder keeps 100 bytes and more for each block, and
encoders take 32x32 or 64x64."""


@dataclass(frozen=True, slots=True)
class CodeStream:
    """Main header of a JPEG 2000 code stream.

    Attributes
    ----------
    channels : bytes
        Three bytes for each: bits less 1, horizontal and vertical step.
    """

    width: int
    height: int
    channels: bytes


def jpeg2000_stream(stream: bytes) -> CodeStream:
    """Read the main header, and refuse a stream that claims more packets than it has bytes: none takes less than one."""
    segments = dict(_segments(stream, 2, _TILE)) if stream[:2] == b"\xff\x4f" else {}
    size, coding = segments.get(_SIZE, b""), segments.get(_CODING, b"")
    if len(size) < 36 or len(coding) < 10:
        raise damaged("the JPEG 2000 code stream does not begin with its size and coding")
    right, bottom, left, top, tile_width, tile_height = struct.unpack(">6I", size[2:26])
    count = int.from_bytes(size[34:36], "big")
    if 0 in (tile_width, tile_height) or right <= left or bottom <= top or len(size) < 36 + 3 * count:
        raise damaged("the JPEG 2000 code stream has no pixels, or tiles without")
    if _COMPONENT in segments or _ORDER in segments:
        raise unsupported("the JPEG 2000 channels are coded each in its own way")
    tiles = -(-right // tile_width) * -(-bottom // tile_height)
    if tiles * _TILE_HEADER > len(stream):
        raise truncated(f"the JPEG 2000 code stream claims {tiles} tiles, {len(stream)} bytes cannot hold them")
    _refuse_tile_codings(stream)
    whole = max(1, (right // tile_width) * (bottom // tile_height)) if left == top == 0 else 1  # tiles that are full
    packets = whole * count * _packets(coding, min(tile_width, right - left), min(tile_height, bottom - top))
    if packets > len(stream):
        raise truncated(f"the JPEG 2000 code stream claims {packets} packets, {len(stream)} bytes cannot hold them")
    return CodeStream(right - left, bottom - top, size[36 : 36 + 3 * count])


def _segments(stream: bytes, at: int, last: int) -> Iterator[tuple[int, bytes]]:
    """Marker and content of each segment up to the marker `last`."""
    while at + 4 <= len(stream):
        marker, length = struct.unpack(">HH", stream[at : at + 4])
        if marker == last:
            return
        if marker < _START or length < 2 or at + 2 + length > len(stream):
            raise damaged("the markers of the JPEG 2000 code stream are out of place")
        yield marker, stream[at + 4 : at + 2 + length]
        at += 2 + length
    raise truncated("the JPEG 2000 code stream ends inside its header")


def _refuse_tile_codings(stream: bytes) -> None:
    """Walk over the tiles: none may be coded otherwise than the main header says."""
    at = stream.find(b"\xff\x90")
    while at + _TILE_HEADER <= len(stream) and stream[at : at + 2] == b"\xff\x90":
        length = int.from_bytes(stream[at + 6 : at + 10], "big")
        if any(marker in (_CODING, _COMPONENT, _ORDER) for marker, _ in _segments(stream, at + 12, _DATA)):
            raise unsupported("the JPEG 2000 tiles are coded each in its own way")
        if length == 0:
            return
        if length < _TILE_HEADER:
            raise damaged("a JPEG 2000 tile is shorter than its header")
        at += length
    if stream[at : at + 2] != b"\xff\xd9":
        raise damaged("the tiles of the JPEG 2000 code stream are out of place")


def _packets(coding: bytes, width: int, height: int) -> int:
    """Packets of one channel of a tile: one for each precinct of each resolution in each layer."""
    layers, levels = int.from_bytes(coding[2:4], "big"), coding[5]
    own = coding[0] & _USER_PRECINCTS
    if levels > 32 or layers == 0 or len(coding) < 10 + (levels + 1) * own:
        raise damaged("the JPEG 2000 coding contradicts itself")
    if coding[6] + coding[7] + 4 < _MIN_BLOCK:
        raise unsupported("the JPEG 2000 code blocks are smaller than any encoder makes them")
    total = 0
    for resolution in range(levels + 1):
        exponents = coding[10 + resolution] if own else 0xFF
        scale = levels - resolution
        total += _precincts(width, scale, exponents & 15) * _precincts(height, scale, exponents >> 4)
    return total * layers


def _precincts(side: int, scale: int, exponent: int) -> int:
    """Precincts of side ``2**exponent`` along a side scaled down by ``2**scale``, both rounded up."""
    return -(-side >> scale + exponent)
