"""The size of the frames of an AV1 stream, from its sequence header."""

from __future__ import annotations

from ffseg.formats.gate.base import damaged

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

    Raises
    ------
    ImageReadError
        If there is none.
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
