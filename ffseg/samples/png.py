"""A PNG writer whose bytes depend on the pixels alone.

Every row is filtered by its upper neighbour and the stream coded with one Huffman table: a deflate stream of literals
(RFC 1951), without the string matching in which builds of zlib differ.
"""

from __future__ import annotations

import heapq
import struct
import zlib
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image

SIGNATURE = b"\x89PNG\r\n\x1a\n"
END_OF_BLOCK = 256
MAX_CODE_LENGTH = 15
CODE_LENGTH_ORDER = (16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15)
FILTER_UP = 2
CHUNK = 1 << 16
"""Symbols coded at a time, which bounds the memory of the bit expansion."""


def encode(image: Image) -> bytes:
    """Write an image as PNG.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey, or red, green, blue.

    Returns
    -------
    bytes
    """
    height, width = image.shape[:2]
    rows = image.reshape(height, -1)
    above = np.vstack([np.zeros_like(rows[:1]), rows[:-1]])
    filtered = np.hstack([np.full((height, 1), FILTER_UP, np.uint8), rows - above])
    header = struct.pack(">IIBBBBB", width, height, 8, 2 if image.ndim == 3 else 0, 0, 0, 0)
    packed = b"\x78\x01" + _deflate(filtered.ravel()) + struct.pack(">I", zlib.adler32(filtered.tobytes()))
    chunks = [_chunk(b"IHDR", header), _chunk(b"IDAT", packed), _chunk(b"IEND", b"")]
    return SIGNATURE + b"".join(chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _deflate(data: Image) -> bytes:
    """Code `data` as one final block with its own Huffman table."""
    symbols = np.append(data.astype(np.int64), END_OF_BLOCK)
    lengths = _code_lengths(np.bincount(symbols, minlength=END_OF_BLOCK + 1))
    codes = _reversed_codes(lengths)
    bits = [_table_bits(lengths)]
    bits += [_spread(codes[part], lengths[part]) for part in np.array_split(symbols, symbols.size // CHUNK + 1)]
    return np.packbits(np.concatenate(bits), bitorder="little").tobytes()


def _table_bits(lengths: NDArray[np.int64]) -> Image:
    """Block header: final block, dynamic table, the lengths of all codes written out in four bits each."""
    plain = np.zeros(19, np.int64)
    plain[:16] = 4  # sixteen code lengths 0..15, each with a code of four bits; no run lengths
    fields = [(1, 1), (2, 2), (0, 5), (0, 5), (len(CODE_LENGTH_ORDER) - 4, 4)]
    fields += [(int(plain[symbol]), 3) for symbol in CODE_LENGTH_ORDER]
    values, widths = np.array(fields).T
    listed = np.append(lengths, 0)  # one unused distance code
    codes = _reversed_codes(plain)
    return np.concatenate([_spread(values, widths), _spread(codes[listed], plain[listed])])


def _code_lengths(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Huffman code lengths of at most 15 bits; counts are halved until the longest code fits."""
    counts = counts.copy()
    while True:
        lengths = np.zeros(counts.size, np.int64)
        for symbol, depth in _depths(counts):
            lengths[symbol] = depth
        if lengths.max() <= MAX_CODE_LENGTH:
            return lengths
        counts = np.where(counts > 0, counts // 2 + 1, 0)


def _depths(counts: NDArray[np.int64]) -> Iterator[tuple[int, int]]:
    """Yield symbol and depth in the Huffman tree; ties go to the older node."""
    heap: list[tuple[int, int]] = [(int(counts[symbol]), int(symbol)) for symbol in np.flatnonzero(counts)]
    heapq.heapify(heap)
    children: dict[int, tuple[int, int]] = {}
    while len(heap) > 1:
        low, high = heapq.heappop(heap), heapq.heappop(heap)
        node = counts.size + len(children)
        children[node] = (low[1], high[1])
        heapq.heappush(heap, (low[0] + high[0], node))
    stack = [(heap[0][1], 0)]
    while stack:
        node, depth = stack.pop()
        if node in children:
            stack += [(child, depth + 1) for child in children[node]]
        else:
            yield node, max(depth, 1)


def _reversed_codes(lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    """Canonical codes (RFC 1951, 3.2.2) with their bits reversed, because deflate packs them from the first bit on."""
    codes = np.zeros(lengths.size, np.int64)
    code = 0
    for length in range(1, int(lengths.max()) + 1):
        for symbol in np.flatnonzero(lengths == length):
            codes[symbol] = int(f"{code:0{length}b}"[::-1], 2)
            code += 1
        code <<= 1
    return codes


def _spread(values: NDArray[np.int64], widths: NDArray[np.int64]) -> Image:
    """Write each value as `width` bits, the lowest first."""
    ends = np.cumsum(widths)
    position = np.arange(ends[-1]) - np.repeat(ends - widths, widths)
    bits: Image = ((np.repeat(values, widths) >> position) & 1).astype(np.uint8)
    return bits
