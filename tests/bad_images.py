"""Small images that are broken, hostile or odd, made from nothing; each with what a reader owes it."""

import io
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, features

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


READS_GIF = cv2.imdecode(np.frombuffer(encoded(Image.new("P", (1, 1)), "GIF"), np.uint8), cv2.IMREAD_COLOR) is not None
"""The oldest OpenCV allowed has no decoder for it."""


def png_chunk(name: bytes, data: bytes, crc: int | None = None) -> bytes:
    """One PNG chunk; `crc` replaces the right checksum."""
    checksum = zlib.crc32(name + data) if crc is None else crc
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", checksum)


def png_file(size: tuple[int, int], depth: int, kind: int, packed: bytes, extra: bytes = b"") -> bytes:
    """A PNG file with any header one likes round the given IDAT data."""
    header = png_chunk(b"IHDR", struct.pack(">IIBBBBB", *size, depth, kind, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + extra + png_chunk(b"IDAT", packed) + png_chunk(b"IEND", b"")


def png_rows(image: NDArray[np.generic]) -> bytes:
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
        **({"gif": encoded(image.quantize(64), "GIF")} if READS_GIF else {}),
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


def _tiff_claim(width: int, height: int, coding: int = 1, samples: int = 1) -> bytes:
    bits = 1 if coding in (2, 3, 4) else 8
    tags = [(256, 4, width), (257, 4, height), (258, 3, bits), (259, 3, coding), (262, 3, 1), (273, 4, 8)]
    tags += [(277, 3, samples), (278, 4, height), (279, 4, 100)]
    body = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    return b"II*\0" + struct.pack("<I", 108) + bytes(100) + struct.pack("<H", len(tags)) + body + bytes(4)


def _shared_strips(width: int, height: int) -> bytes:
    """A TIFF file whose strips of one row are all the same few bytes."""
    row = zlib.compress(bytes(width))
    tags = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 8), (259, 3, 1, 8), (262, 3, 1, 1)]
    places = 8 + 2 + 12 * 9 + 4
    tags += [(273, 4, height, places), (277, 3, 1, 1), (278, 4, 1, 1), (279, 4, height, places + 4 * height)]
    body = b"".join(struct.pack("<HHII", *tag) for tag in tags)
    at = places + 8 * height
    lists = struct.pack("<I", at) * height + struct.pack("<I", len(row)) * height
    return b"II*\0" + struct.pack("<IH", 8, len(tags)) + body + bytes(4) + lists + row[:-1]


def many_scans(count: int, progressive: bool = True) -> bytes:
    """A JPEG file that sends its last scan `count` times more; a baseline one sends each component alone."""
    if progressive:
        data = encoded(Image.fromarray(picture()), "JPEG", progressive=True)
        last = data.rfind(b"\xff\xda")
    else:
        data, last = _separate_scans()
    return data[:-2] + data[last:-2] * count + data[-2:]


def _separate_scans() -> tuple[bytes, int]:
    """A baseline JPEG file of three components with a scan of the first alone, and where that begins."""
    grey = encoded(Image.fromarray(picture()[..., 0]), "JPEG")
    at, scan = grey.find(b"\xff\xc0"), grey.find(b"\xff\xda")
    length = int.from_bytes(grey[at + 2 : at + 4], "big")
    frame = b"\xff\xc0\0\x11" + grey[at + 4 : at + 9] + b"\3" + b"".join(bytes([i, 0x11, 0]) for i in (1, 2, 3))
    data = grey[:at] + frame + grey[at + 2 + length :]
    return data, scan + len(frame) - length - 2


def _flat_webp(width: int, height: int) -> bytes:
    """A WebP file of one colour, whose pixels take no bit: only its header says how many there are."""
    data = bytearray(encoded(Image.new("RGB", (64, 64), (9, 8, 7)), "WEBP", lossless=True))
    data[21:25] = struct.pack("<I", (width - 1) | (height - 1) << 14)
    return bytes(data)


def _jp2_claim(width: int, height: int, tile: int = 0) -> bytes:
    data = bytearray(plain_files()["jp2"])
    header, size = data.find(b"ihdr") + 4, data.find(b"\xff\x51") + 6
    data[header : header + 8] = struct.pack(">II", height, width)
    data[size : size + 8] = struct.pack(">II", width, height)
    data[size + 16 : size + 24] = struct.pack(">II", tile or width, tile or height)
    return bytes(data)


def _jp2_coding(layers: int, precinct: int, block: int = 4) -> bytes:
    """A JPEG 2000 file of 1990x1990 pixels with other numbers of layers, precincts and code blocks than it holds."""
    data = bytearray(_jp2_claim(1_990, 1_990))
    at = data.find(b"\xff\x52")
    length = int.from_bytes(data[at + 2 : at + 4], "big")
    segment = data[at + 4 : at + 2 + length]
    segment[0] |= 1
    segment[2:4] = struct.pack(">H", layers)
    segment[6:8] = bytes([block, block])
    segment += bytes([precinct | precinct << 4]) * (segment[5] + 1)
    data[at + 2 : at + 2 + length] = struct.pack(">H", 2 + len(segment)) + segment
    box = data.find(b"jp2c")
    data[box - 4 : box] = bytes(4)  # to the end of the file
    return bytes(data)


def avif_claim(width: int, height: int) -> bytes:
    """An AVIF file whose container claims another size than its frame has."""
    data = encoded(Image.fromarray(picture()), "AVIF")
    at = data.find(b"ispe") + 8
    return data[:at] + struct.pack(">II", width, height) + data[at + 8 :]


def jp2_palette() -> bytes:
    """A JPEG 2000 file whose one channel numbers the colours of a palette."""
    data = encoded(Image.fromarray(picture()[..., 0] // 16), "JPEG2000")
    entries = bytes(range(48))
    extra = _box(b"pclr", struct.pack(">HB", 16, 3) + b"\7\7\7" + entries)
    extra += _box(b"cmap", b"".join(struct.pack(">HBB", 0, 1, column) for column in range(3)))
    at = data.find(b"jp2h")
    length = int.from_bytes(data[at - 4 : at], "big")
    colours = data.find(b"colr")
    begin = colours - 4 + int.from_bytes(data[colours - 4 : colours], "big")
    return data[: at - 4] + struct.pack(">I", length + len(extra)) + data[at:begin] + extra + data[begin:]


def _box(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", 8 + len(content)) + name + content


def bmp_in_palette() -> bytes:
    """A BMP file whose pixels are said to begin in the middle of its palette."""
    data = bytearray(encoded(Image.fromarray(picture()).quantize(256), "BMP"))
    data[10:14] = struct.pack("<I", 14 + 40 + 512)
    return bytes(data)


def webp_with_exif(code: int, prefix: bytes = b"Exif\0\0") -> bytes:
    """A WebP file with an EXIF orientation behind the prefix of JPEG files."""
    exif = Image.Exif()
    exif[0x112] = code
    block = prefix + exif.tobytes().removeprefix(b"Exif\0\0")
    chunk = encoded(Image.fromarray(picture()), "WEBP", lossless=True)[12:]
    canvas = struct.pack("<II", 10, 8) + struct.pack("<I", WIDTH - 1)[:3] + struct.pack("<I", HEIGHT - 1)[:3]
    body = b"WEBPVP8X" + canvas + chunk + b"EXIF" + struct.pack("<I", len(block)) + block + bytes(len(block) % 2)
    return b"RIFF" + struct.pack("<I", len(body)) + body


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
        **{f"coded{code}.tif": _tiff_claim(9_999, 9_999, code) for code in (2, 3, 4, 5, 7, 8, 32773, 32946)},
        "shared.tif": _shared_strips(9_000, 9_000),
        "scans.jpg": many_scans(300),
        "separate.jpg": many_scans(300, progressive=False),
        "flat.webp": _flat_webp(9_000, 9_000),
        "claim.jp2": _jp2_claim(9_000, 9_000),
        "tiles.jp2": _jp2_claim(1_900, 1_900, tile=1),
        "layers.jp2": _jp2_coding(layers=65_535, precinct=6),
        "precincts.jp2": _jp2_coding(layers=1, precinct=1),
        "blocks.jp2": _jp2_coding(layers=1, precinct=15, block=0),
    }
    if "avif" in features.get_supported_modules():
        files["claim.avif"] = avif_claim(9_000, 9_000)
        files["small.avif"] = avif_claim(1_900, 1_900)
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


def misleading() -> list[Case]:
    """Files that decoders read, to other pixels than they hold."""
    return [
        Case("palette.jp2", jp2_palette(), frozenset({"unsupported-pixels"})),
        *(
            Case(
                f"{name}.tif",
                encoded(Image.new("1", (64, 48)), "TIFF", compression=name),
                frozenset({"unsupported-pixels"}),
            )
            for name in ("group3", "group4", "tiff_ccitt")
        ),
        Case("in_palette.bmp", bmp_in_palette(), frozenset({"damaged"})),
        Case("no_space.pbm", b"P4 64 48\xff" + bytes(400), frozenset({"damaged"})),
        Case("letters.ppm", b"P3 1 1 255 1 2x3 4", frozenset({"damaged"})),
        Case("above.pgm", b"P2 2 1 255 7 256", frozenset({"damaged"})),
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
        ("trailing.png", encoded(image, "PNG") + b"<?php ?>" * 9, bgr),
        ("really_png.jpg", encoded(image, "PNG"), bgr),
        ("one.png", encoded(Image.fromarray(rgb[:1, :1]), "PNG"), bgr[:1, :1]),
        ("thin.png", encoded(Image.fromarray(np.tile(rgb[:1], (1, 70, 1))), "PNG"), np.tile(bgr[:1], (1, 70, 1))),
    ]
    packed = zlib.compress(bytes(7_900_000), 9)
    for name, head in ((b"zTXt", b"k\0\0"), (b"iTXt", b"k\0\1\0\0\0"), (b"iCCP", b"k\0\0")):
        bomb = png_chunk(name, head + packed) * 40
        pieces.append((f"{name.decode()}_bomb.png", png_file((WIDTH, HEIGHT), 8, 2, png_rows(rgb), bomb), bgr))
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
        cases.append(Case(f"copied{code}.webp", webp_with_exif(code), pixels=truth))
        jpeg = encoded(image, "JPEG", exif=exif, quality=100, subsampling=0)
        cases.append(Case(f"turned{code}.jpg", jpeg, pixels=truth, tolerance=6))
        if "avif" in features.get_supported_modules():  # where Pillow rotates and mirrors the item
            avif = encoded(image, "AVIF", exif=exif, quality=100, subsampling="4:4:4")
            cases.append(Case(f"turned{code}.avif", avif, pixels=truth, tolerance=3))
    return cases


def all_cases() -> list[Case]:
    return [*good_cases(), *not_images(), *cut_files(), *bombs(), *damaged_png(), *misleading(), *odd_cases()]


def write_all(folder: Path) -> list[Case]:
    """Write every case under `folder` and return them."""
    cases = all_cases()
    for case in cases:
        (folder / case.name).write_bytes(case.data)
    return cases
