"""Small images that are broken, hostile or odd, made from nothing; each with what a reader owes it."""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

WIDTH, HEIGHT = 64, 48


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """One file: its bytes, and either the reasons allowed for a refusal or the pixels (BGR or grey) it must give."""

    name: str
    data: bytes
    reasons: frozenset[str] = frozenset()
    pixels: NDArray[np.uint8] | None = None
    tolerance: int = 0


def picture() -> NDArray[np.uint8]:
    """RGB test picture without symmetry and without zeros, shape (48, 64, 3)."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    red, green = 40 + 3 * x, 30 + 4 * y
    blue = 128 + 90 * np.sin(x / 9) * np.cos(y / 7)
    image = np.stack([red, green, blue], axis=-1).astype(np.uint8)
    image[10:30, 20:45] = (200, 40, 60)
    return image


def encoded(image: Image.Image, kind: str, **options: object) -> bytes:
    """Bytes of an image in one of Pillow's formats."""
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return buffer.getvalue()


def png_chunk(name: bytes, data: bytes, crc: int | None = None) -> bytes:
    """One PNG chunk; `crc` replaces the right checksum."""
    checksum = zlib.crc32(name + data) if crc is None else crc
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", checksum)


def png_file(size: tuple[int, int], depth: int, kind: int, packed: bytes, extra: bytes = b"") -> bytes:
    """A PNG file with any header one likes round the given IDAT data."""
    header = png_chunk(b"IHDR", struct.pack(">IIBBBBB", *size, depth, kind, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + extra + png_chunk(b"IDAT", packed) + png_chunk(b"IEND", b"")


def png_rows(image: NDArray[np.generic]) -> bytes:
    """Deflated PNG rows without a filter."""
    return zlib.compress(b"".join(b"\0" + row.tobytes() for row in image))


def plain_files() -> dict[str, bytes]:
    """The same picture in every format that is read."""
    image = Image.fromarray(picture())
    return {
        "png": encoded(image, "PNG"),
        "jpg": encoded(image, "JPEG", quality=95, subsampling=0),
        "progressive.jpg": encoded(image, "JPEG", quality=95, progressive=True, subsampling=0),
        "tif": encoded(image, "TIFF"),
        "lzw.tif": encoded(image, "TIFF", compression="tiff_lzw"),
        "bmp": encoded(image, "BMP"),
        "webp": encoded(image, "WEBP", lossless=True),
        "gif": encoded(image.quantize(64), "GIF"),
        "ppm": encoded(image, "PPM"),
        "jp2": encoded(image, "JPEG2000"),
    }


def good_cases() -> list[Case]:
    """Every format as it should be; JPEG against what Pillow decodes, within the rounding of the colour transform."""
    cases = []
    for suffix, data in plain_files().items():
        truth = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))[..., ::-1]
        cases.append(Case(f"plain.{suffix}", data, pixels=truth, tolerance=3 if suffix.endswith("jpg") else 0))
    return cases


def not_images() -> list[Case]:
    """Files that are something else, whatever their name says."""
    wrong = frozenset({"not-an-image"})
    return [
        Case("page.jpg", b"<!DOCTYPE html><html><body>404</body></html>", wrong),
        Case("pointer.png", b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n", wrong),
        Case("drawing.png", b'<svg xmlns="http://www.w3.org/2000/svg"/>', wrong),
        Case("archive.png", b"PK\x03\x04" + bytes(60), wrong),
        Case("note.png", b"take these pictures again\n", wrong),
        Case("zeros.jpg", bytes(4096), wrong),
        Case("random.png", np.random.default_rng(7).bytes(4096), wrong),
        Case("float.pfm", b"PF\n30000 30000\n-1.0\n" + bytes(64), wrong),
        Case("empty.png", b"", frozenset({"empty"})),
    ]


def cut_files() -> list[Case]:
    """Every format cut at 5, 50, 90 and 99 %, and with its second half zeroed."""
    reasons = frozenset({"truncated", "damaged", "unsupported-pixels"})
    cases = []
    for suffix, data in plain_files().items():
        ends = {percent: max(9, len(data) * percent // 100) for percent in (5, 50, 90, 99)}
        cases += [Case(f"cut{percent:02d}.{suffix}", data[:end], reasons) for percent, end in ends.items()]
        half = len(data) // 2 + 37
        cases.append(Case(f"zeroed.{suffix}", data[:half] + bytes(len(data) - half), reasons))
    return cases


def _jpeg_claim(width: int, height: int) -> bytes:
    data = bytearray(plain_files()["jpg"])
    at = data.find(b"\xff\xc0")
    data[at + 5 : at + 9] = struct.pack(">HH", height, width)
    return bytes(data)


def _bmp_claim(width: int, height: int) -> bytes:
    data = bytearray(plain_files()["bmp"])
    data[18:26] = struct.pack("<ii", width, height)
    return bytes(data)


def _tiff_claim(width: int, height: int, samples: int = 3) -> bytes:
    tags = [(256, 4, width), (257, 4, height), (258, 3, 8), (259, 3, 1), (262, 3, 2), (273, 4, 8), (277, 3, samples)]
    tags += [(278, 4, height), (279, 4, 100)]
    body = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    return b"II*\0" + struct.pack("<I", 108) + bytes(100) + struct.pack("<H", len(tags)) + body + bytes(4)


def bombs() -> list[Case]:
    """Small files that claim to be huge."""
    rows = png_rows(picture())
    solid = zlib.compress(bytes(12_000 * (1 + 12_000 // 8)), 9)
    refused = frozenset({"too-many-pixels", "truncated", "damaged", "no-pixels", "unsupported-pixels"})
    gif_frame = b"\x2c" + struct.pack("<HHHHB", 0, 0, 1, 1, 0) + b"\x02\x02\x44\x01\x00;"
    files = {
        "claim.png": png_file((32_000, 32_000), 8, 2, rows),
        "overflow.png": png_file((2**31 - 1, 2**31 - 1), 8, 2, rows),
        "solid.png": png_file((12_000, 12_000), 1, 0, solid),
        "chunk.png": plain_files()["png"][:33] + struct.pack(">I", 2**31 - 1) + b"IDAT" + bytes(40),
        "claim.jpg": _jpeg_claim(32_000, 32_000),
        "fits_limit.jpg": _jpeg_claim(9_000, 9_000),
        "flat.jpg": _jpeg_claim(64, 0),
        "claim.bmp": _bmp_claim(18_000, 18_000),
        "lowest.bmp": _bmp_claim(64, -(2**31)),
        "claim.gif": b"GIF89a" + struct.pack("<HHBBB", 32_000, 32_000, 0x80, 0, 0) + bytes(6) + gif_frame,
        "claim.ppm": b"P6\n32000 32000\n255\n" + bytes(100),
        "negative.ppm": b"P6\n-5 10\n255\n" + bytes(200),
        "overflow.ppm": b"P6\n4294967297 2\n255\n" + bytes(200),
        "claim.tif": _tiff_claim(32_000, 32_000),
        "samples.tif": _tiff_claim(100, 100, samples=60_000),
    }
    return [Case(f"bomb_{name}", data, refused) for name, data in files.items()]


def damaged_png() -> list[Case]:
    """PNG files that contradict themselves in one place."""
    rows, broken = png_rows(picture()), frozenset({"damaged", "truncated", "no-pixels"})
    size = (WIDTH, HEIGHT)
    good = png_file(size, 8, 2, rows)
    crc = good[:29] + b"\0\0\0\1" + good[33:]
    return [
        Case("crc_header.png", crc, broken),
        Case("crc_data.png", good[:-20] + bytes([good[-20] ^ 0x55]) + good[-19:], broken),
        Case("width0.png", png_file((0, HEIGHT), 8, 2, rows), broken),
        Case("depth3.png", png_file(size, 3, 2, rows), broken),
        Case("half_rows.png", png_file(size, 8, 2, png_rows(picture()[: HEIGHT // 2])), broken),
        Case("no_data.png", good[:33] + png_chunk(b"IEND", b""), broken),
    ]


def odd_cases() -> list[Case]:
    """Valid images of unusual kinds, with the pixels the stated policies give."""
    rgb = picture()
    grey, bgr, image = rgb[..., 0], rgb[..., ::-1], Image.fromarray(rgb)
    palette = image.quantize(16)
    palette_bgr = np.asarray(palette.convert("RGB"))[..., ::-1]
    one_bit = np.asarray(image.convert("1")).astype(np.uint8) * 255
    alpha = np.where(np.arange(WIDTH) > 30, 255, 0).astype(np.uint8)[None, :].repeat(HEIGHT, axis=0)
    grey16 = grey.astype(">u2") * 257
    rgb16 = rgb.astype(">u2") * 257
    pieces: list[tuple[str, bytes, NDArray[np.uint8]]] = [
        ("grey16.png", png_file((WIDTH, HEIGHT), 16, 0, png_rows(grey16)), grey),
        ("rgb16.png", png_file((WIDTH, HEIGHT), 16, 2, png_rows(rgb16)), bgr),
        ("rgba_hidden.png", encoded(Image.fromarray(np.dstack([rgb, alpha])), "PNG"), bgr),
        ("grey_alpha.png", encoded(Image.fromarray(np.dstack([grey, alpha]), "LA"), "PNG"), grey),
        ("palette.png", encoded(palette, "PNG"), palette_bgr),
        ("palette_clear.png", encoded(palette, "PNG", transparency=3), palette_bgr),
        ("bit.png", encoded(image.convert("1"), "PNG"), one_bit),
        ("bit_g4.tif", encoded(image.convert("1"), "TIFF", compression="group4"), one_bit),
        ("trailing.png", encoded(image, "PNG") + b"<?php ?>" * 9, bgr),
        ("really_png.jpg", encoded(image, "PNG"), bgr),
        ("one.png", encoded(Image.fromarray(rgb[:1, :1]), "PNG"), bgr[:1, :1]),
        ("thin.png", encoded(Image.fromarray(np.tile(rgb[:1], (1, 70, 1))), "PNG"), np.tile(bgr[:1], (1, 70, 1))),
    ]
    bomb = png_chunk(b"zTXt", b"k\0\0" + zlib.compress(bytes(20_000_000), 9))
    pieces.append(("text_bomb.png", png_file((WIDTH, HEIGHT), 8, 2, png_rows(rgb), bomb), bgr))
    black = rgb.copy()
    black[HEIGHT // 2 :] = 0
    pieces.append(("black_half.bmp", encoded(Image.fromarray(black), "BMP"), black[..., ::-1]))
    pieces.append(("black_half.ppm", encoded(Image.fromarray(black), "PPM"), black[..., ::-1]))
    return [Case(f"odd_{name}", data, pixels=pixels) for name, data, pixels in pieces] + _orientations()


def _orientations() -> list[Case]:
    rgb = picture()
    upright = {
        1: rgb, 2: rgb[:, ::-1], 3: rgb[::-1, ::-1], 4: rgb[::-1], 5: rgb.transpose(1, 0, 2),
        6: np.rot90(rgb, -1), 7: rgb[::-1, ::-1].transpose(1, 0, 2), 8: np.rot90(rgb),
    }  # fmt: skip
    cases = []
    for code, pixels in upright.items():
        exif = Image.Exif()
        exif[0x112] = code
        truth = np.ascontiguousarray(pixels[..., ::-1])
        image = Image.fromarray(rgb)
        cases.append(Case(f"turned{code}.png", encoded(image, "PNG", exif=exif), pixels=truth))
        cases.append(Case(f"turned{code}.webp", encoded(image, "WEBP", exif=exif, lossless=True), pixels=truth))
        cases.append(Case(f"turned{code}.tif", encoded(image, "TIFF", tiffinfo={0x112: code}), pixels=truth))
        jpeg = encoded(image, "JPEG", exif=exif, quality=100, subsampling=0)
        cases.append(Case(f"turned{code}.jpg", jpeg, pixels=truth, tolerance=6))
    return cases


def all_cases() -> list[Case]:
    """Everything above."""
    return [*good_cases(), *not_images(), *cut_files(), *bombs(), *damaged_png(), *odd_cases()]


def write_all(folder: Path) -> list[Case]:
    """Write every case under `folder` and return them."""
    cases = all_cases()
    for case in cases:
        (folder / case.name).write_bytes(case.data)
    return cases
