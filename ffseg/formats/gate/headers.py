"""The gate before a decoder: what a file is, its size in pixels, and whether its data can be there at all.

Nothing is decoded here; every function walks lengths that it has checked against the end of the data.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

from ffseg.errors import ImageReadError

MAX_CHUNKS = 200_000
"""A PNG of 100 Mpx in the usual 8 kB pieces has about 25,000 chunks; more than this is made to waste time."""
DEFLATE_RATIO = 1032
"""The most bytes one byte of a deflate stream can stand for."""
JPEG_PIXELS_PER_BYTE = 1024
"""Huffman coding spends a bit or more on each 8x8 block of the DC scan: six bits on 16x16 pixels with 4:2:0 colours."""
GIF_PIXELS_PER_BYTE = 4096
"""A 12-bit LZW code stands for at most 4096 pixels: 2731 for each byte."""


@dataclass(frozen=True, slots=True)
class Header:
    """What the gate found.

    Attributes
    ----------
    format : str
        ``PNG``, ``JPEG``, ``BMP``, ``TIFF``, ``WebP``, ``GIF``, ``PNM``, ``JPEG 2000`` or ``AVIF``.
    width, height : int
        As stored, before any orientation is applied.
    grey : bool
        The pixels have one colour channel.
    raw : bool
        Stored without compression or checksum: damage shows only in the pixels.
    bottom_up : bool
        The first stored row is the lowest.
    """

    format: str
    width: int
    height: int
    grey: bool = False
    raw: bool = False
    bottom_up: bool = False


def damaged(text: str) -> ImageReadError:
    """Error for data that contradicts itself."""
    return ImageReadError("damaged", f"{text}; copy the file again or convert it")


def truncated(text: str) -> ImageReadError:
    """Error for data that ends before the image does."""
    return ImageReadError("truncated", f"{text}; copy the file again")


def unsupported(text: str) -> ImageReadError:
    """Error for an image whose pixels have no reading that is sure to be right."""
    return ImageReadError("unsupported-pixels", f"{text}; convert it to an 8-bit PNG")


def png(data: bytes) -> Header:
    """Walk the chunks of a PNG file; a length that leads beyond the end is refused before a decoder believes it."""
    if len(data) < 33 or data[12:16] != b"IHDR":
        raise truncated("the PNG file ends inside its header")
    width, height, depth, kind = struct.unpack(">IIBB", data[16:26])
    if kind not in (0, 2, 3, 4, 6) or depth not in (1, 2, 4, 8, 16):
        raise damaged(f"the PNG header claims colour type {kind} with {depth} bits")
    packed = _png_idat_bytes(data)
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[kind]
    if height * (1 + width * depth * channels // 8) > packed * DEFLATE_RATIO + DEFLATE_RATIO:
        raise truncated(f"the PNG header claims {width}x{height} pixels, {packed} bytes of data cannot hold them")
    return Header("PNG", width, height, grey=kind in (0, 4))


def _png_idat_bytes(data: bytes) -> int:
    position, packed = 8, 0
    for _ in range(MAX_CHUNKS):
        if position + 12 > len(data):
            raise truncated("the PNG file ends before its last chunk")
        length = int.from_bytes(data[position : position + 4], "big")
        name = data[position + 4 : position + 8]
        if position + 12 + length > len(data):
            raise truncated(f"the PNG chunk {name!r} claims {length} bytes, more than the file has")
        if name == b"IEND":
            return packed
        packed += length if name == b"IDAT" else 0
        position += 12 + length
    raise damaged(f"the PNG file has more than {MAX_CHUNKS} chunks")


def jpeg(data: bytes) -> Header:
    """Find the frame header of a JPEG file; it must be Huffman coded, 8 bits, 1, 3 or 4 components."""
    _refuse_zeros_before_end(data)
    position = 2
    while position + 4 <= len(data):
        if data[position] != 0xFF:
            raise damaged("the JPEG markers are out of place")
        marker = data[position + 1]
        if marker == 0xFF or marker == 0x01 or 0xD0 <= marker <= 0xD8:
            position += 1 if marker == 0xFF else 2
            continue
        if marker in (0xDA, 0xD9):
            raise damaged("the JPEG file has no frame header before its data")
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            return _jpeg_frame(data, position, marker)
        position += 2 + int.from_bytes(data[position + 2 : position + 4], "big")
    raise truncated("the JPEG file ends inside its header")


def _refuse_zeros_before_end(data: bytes) -> None:
    # Some cameras pad with zeros, but after the end marker; zeros inside the scan decode to flat grey.
    if not data[-64:].strip(b"\0") and not data.rstrip(b"\0").endswith(b"\xff\xd9"):
        raise truncated("the JPEG data breaks off into zeros (an interrupted copy?)")


def _jpeg_frame(data: bytes, position: int, marker: int) -> Header:
    if position + 10 > len(data):
        raise truncated("the JPEG file ends inside its header")
    precision, height, width, components = struct.unpack(">BHHB", data[position + 4 : position + 10])
    if marker > 0xC2 or precision != 8:
        raise unsupported(f"the JPEG file uses a rare coding (frame type {marker - 0xC0}, {precision} bits)")
    if components not in (1, 3, 4):
        raise unsupported(f"the JPEG file has {components} components")
    if width * height > len(data) * JPEG_PIXELS_PER_BYTE:
        raise truncated(f"the JPEG header claims {width}x{height} pixels, {len(data)} bytes cannot hold them")
    return Header("JPEG", width, height, grey=components == 1)


def bmp(data: bytes) -> Header:
    """Header of a BMP file without compression."""
    if len(data) < 30:
        raise truncated("the BMP file ends inside its header")
    offset, size = struct.unpack("<II", data[10:18])
    if size < 40:
        raise unsupported("the BMP file has the header of OS/2")
    width, height = struct.unpack("<ii", data[18:26])
    bits, compression = struct.unpack("<HI", data[28:34].ljust(6, b"\0"))
    if compression != 0 or bits not in (1, 4, 8, 24, 32):
        raise unsupported(f"the BMP file has {bits} bits a pixel with compression {compression}")
    rows = abs(height)
    if width > 0 and offset + rows * ((width * bits + 31) // 32 * 4) > len(data):
        raise truncated(f"the BMP header claims {width}x{rows} pixels, the file is too short for them")
    return Header("BMP", width, rows, raw=True, bottom_up=height > 0)


def gif(data: bytes) -> Header:
    """Canvas of a GIF file; its first frame is the image."""
    if len(data) < 13:
        raise truncated("the GIF file ends inside its header")
    width, height = struct.unpack("<HH", data[6:10])
    if width * height > len(data) * GIF_PIXELS_PER_BYTE:
        raise truncated(f"the GIF header claims {width}x{height} pixels, {len(data)} bytes cannot hold them")
    return Header("GIF", width, height)


def webp(data: bytes) -> Header:
    """Size of a WebP file from its first chunk."""
    if len(data) < 30:
        raise truncated("the WebP file ends inside its header")
    if int.from_bytes(data[4:8], "little") + 8 > len(data):
        raise truncated("the WebP file is shorter than its header says")
    _refuse_zero_tail(data, "WebP")
    kind = data[12:16]
    if kind == b"VP8X":
        return Header("WebP", int.from_bytes(data[24:27], "little") + 1, int.from_bytes(data[27:30], "little") + 1)
    if kind == b"VP8L":
        bits = int.from_bytes(data[21:25], "little")
        return Header("WebP", (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1)
    if kind == b"VP8 ":
        width, height = struct.unpack("<HH", data[26:30])
        return Header("WebP", width & 0x3FFF, height & 0x3FFF)
    raise damaged(f"the WebP file starts with the chunk {kind!r}")


def _refuse_zero_tail(data: bytes, name: str) -> None:
    # An entropy coder's output is not zero over an eighth of the file; an interrupted copy is.
    tail = max(len(data) // 8, 64)
    if not data[-tail:].strip(b"\0"):
        raise damaged(f"the last {tail} bytes of the {name} file are zeros (an interrupted copy?)")


_PNM_FIELD = rb"(?:\s|#[^\r\n]*[\r\n])+(\d{1,9})"
_PNM_HEAD = re.compile(rb"P([1-6])" + _PNM_FIELD + _PNM_FIELD)
_PNM_LAST = re.compile(_PNM_FIELD + rb"\s")


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
    samples = height * ((width + 7) // 8 if kind == 4 else width * (3 if kind in (3, 6) else 1))
    needed = samples if kind >= 4 else samples + (samples - 1 if kind != 1 else 0)
    if end + needed > len(data):
        raise truncated(f"the PNM header claims {width}x{height} pixels, the file is too short for them")
    return Header("PNM", width, height, grey=kind not in (3, 6), raw=kind >= 4)


def jpeg2000(data: bytes) -> Header:
    """Image header box of a JP2 file; the code stream must reach its end marker."""
    at = data.find(b"ihdr", 0, 4096)
    if at < 0 or at + 18 > len(data):
        raise truncated("the JPEG 2000 file ends inside its header")
    height, width, channels, bits = struct.unpack(">IIHB", data[at + 4 : at + 15])
    if channels not in (1, 3) or bits != 7:
        raise unsupported(f"the JPEG 2000 file has {channels} channels of {(bits & 127) + 1} bits")
    if data[-2:] != b"\xff\xd9":
        raise truncated("the JPEG 2000 file does not end with its end marker")
    return Header("JPEG 2000", width, height, grey=channels == 1)


def avif(data: bytes) -> Header:
    """Largest image extent (``ispe``) that an AVIF file declares."""
    ends = [at.end() for at in re.finditer(b"ispe", data[:65536]) if at.end() + 12 <= len(data)]
    sizes = [struct.unpack(">II", data[end + 4 : end + 12]) for end in ends]
    if not sizes:
        raise truncated("the AVIF file ends inside its header")
    width, height = max(sizes, key=lambda size: size[0] * size[1])
    _refuse_zero_tail(data, "AVIF")
    return Header("AVIF", width, height)


_OTHERS: tuple[tuple[bytes, str], ...] = (
    (b"version https://git-lfs", "a Git LFS pointer; fetch the real file with `git lfs pull`"),
    (b"PK\x03\x04", "a zip archive; unpack it"),
    (b"\x1f\x8b", "a gzip archive; unpack it"),
    (b"%PDF", "a PDF document; export its pages as images"),
    (b"\x7fELF", "a program"),
    (b"8BPS", "a Photoshop file; export it as PNG"),
    (b"\x93NUMPY", "a NumPy array; save it as PNG"),
    (b"\x76\x2f\x31\x01", "an OpenEXR image of floats; convert it to an 8-bit PNG"),
    (b"#?", "a Radiance HDR image of floats; convert it to an 8-bit PNG"),
    (b"PF", "a PFM image of floats; convert it to an 8-bit PNG"),
    (b"Pf", "a PFM image of floats; convert it to an 8-bit PNG"),
    (b"P7", "a PAM image; convert it to PNG"),
    (b"\xff\x4f\xff\x51", "a bare JPEG 2000 code stream; convert it to PNG"),
    (b"\xff\x0a", "a JPEG XL image; convert it to PNG"),
    (b"\0\0\0\x0cJXL ", "a JPEG XL image; convert it to PNG"),
    (b"\0\0\x01\0", "an icon; convert it to PNG"),
    (b"RIFF", "a sound or video file; export its frames"),
    (b"\x1aE\xdf\xa3", "a video file; export its frames"),
)


def looks_like(data: bytes) -> str:
    """What a file that is no image of a known format looks like, with the remedy."""
    head = data[:1024]
    for start, what in _OTHERS:
        if head.startswith(start):
            return what
    if head[4:8] == b"ftyp":
        return "a HEIF image or a video file; convert it to PNG"
    if not head.strip(b"\0"):
        return "zeros only (lost blocks or an interrupted copy); copy it again"
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    if text.startswith((b"<!doctype html", b"<html")):
        return "an HTML page (a download that failed?); download it again"
    if text.startswith((b"<svg", b"<?xml")):
        return "an SVG or XML document; render it to PNG"
    if all(byte >= 32 or byte in b"\t\r\n" for byte in head):
        return "a text file; give image files"
    return "unknown binary data; give PNG, JPEG, TIFF, BMP, WebP, PNM, GIF, JPEG 2000 or AVIF"
