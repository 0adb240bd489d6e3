"""Damage done to image files, drawn from a seed: mutated headers, zero tails, cuts, flipped bits and holes."""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from bad_images import READS_GIF, encoded
from numpy.typing import NDArray
from PIL import Image, features

SHARES = (25, 35, 50, 60, 75, 85, 90, 95, 97, 98, 99)
"""Percent of a file at which its tail begins."""
HOLE = 4096
"""Bytes: the usual block of a file system."""
HEADER = 220
"""Bytes from the start in which headers are mutated."""


@dataclass(frozen=True, slots=True, eq=False)
class Damaged:
    """One damaged file: ``whole``, ``header``, ``tail``, ``cut``, ``bit`` or ``hole``, and its number among those of a kind."""

    kind: str
    number: int
    data: bytes


def picture(width: int = 256, height: int = 192) -> NDArray[np.uint8]:
    """RGB picture with texture, shape (height, width, 3): its files are longer than a few holes."""
    y, x = np.mgrid[0:height, 0:width]
    noise = np.random.default_rng(3).integers(0, 24, (height, width, 3))
    waves = np.stack([np.sin(x / 17 + y / 40), np.cos(y / 11), np.sin((x - y) / 23)], axis=-1)
    image = 110 + 80 * waves + noise
    image[height // 4 : height // 2, width // 3 : 2 * width // 3] = (200, 40, 60)
    return np.clip(image, 0, 255).astype(np.uint8)


def sources() -> dict[str, bytes]:
    """Whole files in every format and coding that is read."""
    rgb = picture()
    image, grey = Image.fromarray(rgb), Image.fromarray(rgb[..., 1])
    bit, palette = grey.convert("1"), image.quantize(200)
    made = {
        "png": encoded(image, "PNG"),
        "grey.png": encoded(grey, "PNG"),
        "palette.png": encoded(palette, "PNG"),
        "jpg": encoded(image, "JPEG", quality=90),
        "grey.jpg": encoded(grey, "JPEG", quality=90),
        "progressive.jpg": encoded(image, "JPEG", quality=90, progressive=True),
        "restart.jpg": encoded(image, "JPEG", quality=90, restart_marker_rows=1),
        "lossless.webp": encoded(image, "WEBP", lossless=True),
        "lossy.webp": encoded(image, "WEBP", quality=90),
        **({"gif": encoded(palette, "GIF")} if READS_GIF else {}),
        "24.bmp": encoded(image, "BMP"),
        "8.bmp": encoded(palette, "BMP"),
        "1.bmp": encoded(bit, "BMP"),
        "ppm": encoded(image, "PPM"),
        "pgm": encoded(grey, "PPM"),
        "pbm": encoded(bit, "PPM"),
        "text.ppm": _text_ppm(rgb[:64, :64]),
        "lossless.jp2": encoded(image, "JPEG2000"),
        "lossy.jp2": encoded(image, "JPEG2000", quality_mode="rates", quality_layers=[8]),
    }
    if "avif" in features.get_supported_modules():
        made["avif"] = encoded(image, "AVIF", quality=95, subsampling="4:4:4")
    return made | tiff_sources()


def tiff_sources() -> dict[str, bytes]:
    """TIFF files of every compression with the directory before the pixels, and one with it behind them."""
    rgb = picture()
    image, grey = Image.fromarray(rgb), Image.fromarray(rgb[..., 1])
    kinds = {"deflate": "tiff_adobe_deflate", "lzw": "tiff_lzw", "packbits": "packbits", "jpeg": "jpeg"}
    made = {"none.tif": encoded(image, "TIFF")}
    for name, compression in kinds.items():
        made[f"{name}.tif"] = directory_first(encoded(image, "TIFF", compression=compression))
    difference = encoded(image, "TIFF", compression="tiff_lzw", tiffinfo={317: 2})
    made["difference.tif"] = directory_first(difference)
    made["last.tif"] = encoded(image, "TIFF", compression="tiff_adobe_deflate", tiffinfo={278: 16})
    made["grey.tif"] = directory_first(encoded(grey, "TIFF", compression="tiff_lzw"))
    deep = Image.fromarray((rgb[..., 1].astype(np.uint16)) * 257)
    made["16.tif"] = directory_first(encoded(deep, "TIFF", compression="tiff_adobe_deflate"))
    return made


def tolerance(name: str) -> int:
    """Grey levels by which two decoders of a source may differ: the rounding of a colour transform, or of 16 bits."""
    if name == "16.tif":
        return 1
    return 3 if name.endswith("jpg") or name in ("jpeg.tif", "avif", "lossy.webp", "lossy.jp2") else 0


def directory_first(data: bytes) -> bytes:
    """A classic little-endian TIFF file with its directory moved before its pixels, as many programs write them."""
    order, at = "<", int.from_bytes(data[4:8], "little")
    count = int.from_bytes(data[at : at + 2], "little")
    entries = [struct.unpack(f"{order}HHI4s", data[at + 2 + 12 * i : at + 14 + 12 * i]) for i in range(count)]
    values = {tag: _values(data, kind, number, raw) for tag, kind, number, raw in entries}
    strips = [data[o : o + n] for o, n in zip(values[273][1], values[279][1], strict=True)]
    extra = b""
    first = 8 + 2 + 12 * count + 4
    room = sum(_size(kind, len(items)) for kind, items in values.values())
    places = np.cumsum([first + room, *(len(strip) + len(strip) % 2 for strip in strips)])[:-1]
    values[273] = (4, tuple(int(place) for place in places))
    body = b""
    for tag, (kind, items) in sorted(values.items()):
        packed = struct.pack(f"<{len(items)}{_CODES[kind]}", *items)
        if len(packed) > 4:
            field, extra = struct.pack("<I", first + len(extra)), extra + packed + bytes(len(packed) % 2)
        else:
            field = packed.ljust(4, b"\0")
        body += struct.pack("<HHI", tag, kind, len(items)) + field
    head = b"II*\0" + struct.pack("<IH", 8, count) + body + bytes(4) + extra.ljust(room, b"\0")
    return head + b"".join(strip + bytes(len(strip) % 2) for strip in strips)


_CODES = {1: "B", 2: "B", 3: "H", 4: "I", 5: "Q", 7: "B"}


def _size(kind: int, count: int) -> int:
    size = struct.calcsize(f"<{count}{_CODES[kind]}")
    return size + size % 2 if size > 4 else 0


def _values(data: bytes, kind: int, count: int, raw: bytes) -> tuple[int, tuple[int, ...]]:
    code = f"<{count}{_CODES[kind]}"
    size = struct.calcsize(code)
    at = int.from_bytes(raw, "little")
    return kind, struct.unpack(code, raw[:size] if size <= 4 else data[at : at + size])


def _text_ppm(rgb: NDArray[np.uint8]) -> bytes:
    numbers = "\n".join(" ".join(map(str, row)) for row in rgb.reshape(-1, 12).tolist())
    return f"P3\n{rgb.shape[1]} {rgb.shape[0]}\n255\n{numbers}\n".encode("ascii")


def damaged(name: str, data: bytes, headers: int) -> Iterator[Damaged]:
    """Every kind of damage to one file, with so many mutated headers; it is drawn by the name of its source."""
    rng = np.random.default_rng([*name.encode()])
    yield Damaged("whole", 0, data)
    for number in range(headers):
        yield Damaged("header", number, mutated_header(data, rng))
    for share in SHARES:
        end = len(data) * share // 100
        yield Damaged("tail", share, data[:end] + bytes(len(data) - end))
        yield Damaged("cut", share, data[:end])
    for number in range(20):
        at = int(rng.integers(min(HEADER, len(data) // 4), len(data)))
        yield Damaged("bit", number, _changed(data, at, bytes([data[at] ^ 1 << rng.integers(8)])))
    for number in range(6):
        at = int(rng.integers(len(data) // 8, max(len(data) - HOLE, len(data) // 8 + 1)))
        yield Damaged("hole", number, _changed(data, at, bytes(min(HOLE, len(data) - at))))


def mutated_header(data: bytes, rng: np.random.Generator) -> bytes:
    """A file with one to three bytes of its first `HEADER`, or of a TIFF directory behind them, changed."""
    places = [*range(min(HEADER, len(data)))]
    if data[:4] == b"II*\0":
        at = int.from_bytes(data[4:8], "little")
        places = [*range(4, 8), *range(at, min(at + HEADER, len(data)))]
    changed = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        at = int(rng.choice(places))
        value = [0, 1, 2, 0x7F, 0x80, 0xFF, changed[at] ^ 1 << int(rng.integers(8)), int(rng.integers(256))]
        changed[at] = value[rng.integers(len(value))]
    if data.startswith(b"\x89PNG") and rng.integers(4):  # most with right checksums, which else hide all the rest
        return with_checksums(bytes(changed))
    return bytes(changed)


def with_checksums(data: bytes) -> bytes:
    """A PNG file with the checksum of every chunk made right, as far as the lengths lead."""
    at, parts = 8, [data[:8]]
    while at + 12 <= len(data):
        end = at + 12 + int.from_bytes(data[at : at + 4], "big")
        if end > len(data):
            break
        parts += [data[at : end - 4], struct.pack(">I", zlib.crc32(data[at + 4 : end - 4]))]
        at = end
    return b"".join([*parts, data[at:]])


def _changed(data: bytes, at: int, by: bytes) -> bytes:
    return data[:at] + by + data[at + len(by) :]
