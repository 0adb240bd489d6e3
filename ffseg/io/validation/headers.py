"""Header checks before a decoder: format, size in pixels, and whether the data can hold that many.

Nothing is decoded here; every function walks lengths that it has checked against the end of the data. PNG and GIF are
looked at here, the other formats in the modules beside.
"""

from __future__ import annotations

import struct

from ffseg.io.validation.base import Header, damaged, orientation_of, refuse_claim, truncated

MAX_CHUNKS = 200_000
"""A PNG of 100 Mpx in the usual 8 kB pieces has about 25,000 chunks; more than this is made to waste time."""
DEFLATE_RATIO = 1032
"""The most bytes one byte of a deflate stream can stand for."""
GIF_PIXELS_PER_BYTE = 4096
"""A 12-bit LZW code stands for at most 4096 pixels: 2731 for each byte."""


def png(data: bytes) -> Header:
    """Walk the chunks of a PNG file; a length that leads beyond the end is refused before a decoder believes it."""
    if len(data) < 33 or data[12:16] != b"IHDR":
        raise truncated("the PNG file ends inside its header")
    width, height, depth, kind = struct.unpack(">IIBB", data[16:26])
    if kind not in (0, 2, 3, 4, 6) or depth not in (1, 2, 4, 8, 16):
        raise damaged(f"the PNG header claims colour type {kind} with {depth} bits")
    chunks = _png_chunks(data)
    packed = sum(end - at - 12 for name, at, end in chunks if name == b"IDAT")
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[kind]
    if height * (1 + width * depth * channels // 8) > packed * DEFLATE_RATIO + DEFLATE_RATIO:
        raise truncated(f"the PNG header claims {width}x{height} pixels, {packed} bytes of data cannot hold them")
    names = {name for name, *_ in chunks}
    still = None
    if names & (_FRAMES | _PACKED_TEXTS):
        left_out = _FRAMES | _PACKED_TEXTS
        still = data[:8] + b"".join(data[at:end] for name, at, end in chunks if name not in left_out)
    turned = next((orientation_of(data[at + 8 : end - 4]) for name, at, end in chunks if name == b"eXIf"), 1)
    return Header(
        "PNG", width, height, kind in (0, 4), turned, several=bool(names & _FRAMES), still=still, deep=depth == 16
    )


_FRAMES = {b"acTL", b"fcTL", b"fdAT"}
"""Chunks of an animation; the image is what programs show that know nothing of them."""
_PACKED_TEXTS = {b"zTXt", b"iTXt", b"iCCP"}
"""Chunks that say nothing of the pixels, but are unpacked by decoders: each small one to 8 MB, and there may be many."""


def _png_chunks(data: bytes) -> list[tuple[bytes, int, int]]:
    """Name, start and end of every chunk."""
    chunks, at = [], 8
    for _ in range(MAX_CHUNKS):
        if at + 12 > len(data):
            raise truncated("the PNG file ends before its last chunk")
        length = int.from_bytes(data[at : at + 4], "big")
        name, end = data[at + 4 : at + 8], at + 12 + length
        if end > len(data):
            raise truncated(f"the PNG chunk {name!r} claims {length} bytes, more than the file has")
        chunks.append((name, at, end))
        if name == b"IEND":
            return chunks
        at = end
    raise damaged(f"the PNG file has more than {MAX_CHUNKS} chunks")


def gif(data: bytes) -> Header:
    """Canvas of a GIF file; its first frame is the image."""
    if len(data) < 13:
        raise truncated("the GIF file ends inside its header")
    width, height = struct.unpack("<HH", data[6:10])
    refuse_claim("GIF", (width, height), len(data), GIF_PIXELS_PER_BYTE)
    return Header("GIF", width, height, several=_gif_frames(data) > 1)


_GIF_FRAME, _GIF_EXTENSION = 0x2C, 0x21


def _gif_frames(data: bytes) -> int:
    """Frames of a GIF file, not counted beyond two."""
    at, frames = 13 + _gif_colours(data[10]), 0
    while at + 10 < len(data) and data[at] in (_GIF_FRAME, _GIF_EXTENSION) and frames < 2:
        frame = data[at] == _GIF_FRAME
        frames += frame
        at += 11 + _gif_colours(data[at + 9]) if frame else 2
        while at < len(data) and data[at]:
            at += 1 + data[at]
        at += 1
    return frames


def _gif_colours(flags: int) -> int:
    """Bytes of the palette that a flag byte announces."""
    return 3 << (flags & 7) + 1 if flags & 0x80 else 0


_AS_FILM = "'ffseg run' reads files named .mp4, .mkv, .webm, .avi or .mov frame by frame"
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
    (b"RIFF", f"a sound or video file; {_AS_FILM}"),
    (b"\x1aE\xdf\xa3", f"a video file; {_AS_FILM}"),
    *(
        (mark, "a bag of ROS; name it and its images with --bag and --topic of run")
        for mark in (b"#ROSBAG", b"\x89MCAP")
    ),
)


def looks_like(data: bytes) -> str:
    """What a file that is no image of a known format looks like, with the remedy."""
    head = data[:1024]
    if not head:
        return "an empty file; copy it again"
    for start, what in _OTHERS:
        if head.startswith(start):
            return what
    if head[4:8] == b"ftyp":
        return f"a video file, or a HEIF image to be converted to PNG; {_AS_FILM}"
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
