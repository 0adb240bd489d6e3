"""Guarded reading of images: header checks before the decoder, and a closed list of reasons for refusal.

Policies
--------
Orientation : an EXIF orientation, and the rotation and mirroring of AVIF, are applied; the array, and so every mask, is
    upright. An orientation in XMP, or in a text chunk of PNG, is not looked at.
Bit depth : 16 bits are scaled to 8 by the range that the file states (TIFF), or that the caller names, or from 0 to the most
    that 10, 12, 14 or 16 bits hold, the fewest in use; masks by the full range. 1 bit becomes 0 and 255.
Alpha : ignored, the colours are taken as stored, hidden ones too. TIFF files with alpha are refused.
Palette : replaced by its colours.
CMYK : JPEG is converted to BGR by the decoder; TIFF is refused.
Float, signed, complex : refused, they have no fixed white level.
Several frames or pages : the first is the image; of an animated PNG what programs show that know of no animation.
GIF : the first frame on its canvas; transparent pixels and what it leaves open have the background colour.
"""

from __future__ import annotations

import ctypes
import os
import re
import reprlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.errors import ImageReadError, ParameterError
from ffseg.image.checked import ends_of, to_8_bits
from ffseg.io.files import printable, read_bytes
from ffseg.io.validation.base import Header, damaged
from ffseg.io.validation.boxes import avif, heic, jpeg2000
from ffseg.io.validation.headers import gif, looks_like, png
from ffseg.io.validation.jpeg import jpeg
from ffseg.io.validation.rows import bmp, pnm
from ffseg.io.validation.tiff import tiff
from ffseg.io.validation.webp import webp
from ffseg.parameters import Levels

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_KEPT_BYTES, _MAX_KEPT_BLOCK = 128 << 20, 32 << 20
"""Freed memory that stays with the process, and the largest block that is kept so, which is the largest the library
allows: the buffers of an image of 8 Mpx. Returned to the system after every image, they cost 10,000 page faults for the
next one of 1600x1200. More than the largest image needed at once is never held."""

REASONS = {
    "missing": "no such file",
    "link-loop": "a symbolic link that leads back to itself",
    "bad-name": "a name the file system cannot hold",
    "unreadable": "no permission, or the disk failed",
    "not-a-file": "a folder, pipe, device or socket",
    "empty": "a file without a byte",
    "too-many-bytes": "a file above the limit in bytes",
    "not-an-image": "the content is something else; the message says what it looks like",
    "unsupported-pixels": "an image whose pixels have no reading that is sure to be right",
    "no-pixels": "a width or height of zero",
    "too-many-pixels": "an image above the limit in pixels",
    "truncated": "the data ends before the image does",
    "damaged": "the data contradicts itself",
}
"""Every reason an ``ImageReadError`` can carry."""


@dataclass(frozen=True, slots=True)
class Limits:
    """How large a file and an image may be before it is refused unread; no method takes a longer side.

    Examples
    --------
    >>> try:
    ...     ffseg.read_image("pictures/toy.png", ffseg.Limits(max_pixels=1000))
    ... except ffseg.ImageReadError as error:
    ...     print(error.reason)
    too-many-pixels
    """

    max_bytes: int = 1 << 30
    max_pixels: int = 100_000_000
    max_side: int = 65_535


def read_image(
    path: str | os.PathLike[str], limits: Limits | None = None, levels: Levels | None = "auto"
) -> NDArray[np.uint8]:
    """Read one image file.

    Parameters
    ----------
    path : path
        A regular file; its format is told by its content, not its name.
    limits : Limits, optional
    levels : tuple of float, "auto" or None
        Values of 16 bits that are black and white; "auto" looks for them as ``input.range`` says, None takes the full range.

    Returns
    -------
    ndarray of uint8, shape (H, W) for grey or (H, W, 3) in BGR order

    Raises
    ------
    ImageReadError
        With one of ``REASONS``; the message names the file and the remedy.
    ParameterError
        If black is not below white, or either is no number.

    Examples
    --------
    >>> image = ffseg.read_image("pictures/toy.png")
    >>> image.shape, image.dtype
    ((600, 800), dtype('uint8'))
    """
    limits = limits or Limits()
    if levels is not None and levels != "auto" and ends_of(levels) is None:
        raise ParameterError(f'levels: {reprlib.repr(levels)} is not "auto", None or (black, white), black below white')
    try:
        return decode_image(read_bytes(path, limits.max_bytes), limits, levels)
    except ImageReadError as error:
        raise ImageReadError(error.reason, f"{printable(path)}: {error}") from None


def decode_image(data: bytes, limits: Limits | None = None, levels: Levels | None = None) -> NDArray[np.uint8]:
    """Decode the bytes of an image file; as `read_image`, but the message does not name the file."""
    return read_picture(data, limits, levels)[0]


def read_picture(
    data: bytes, limits: Limits | None = None, levels: Levels | None = "auto"
) -> tuple[NDArray[np.uint8], str]:
    """The image in the bytes of a file, and what there is to say of how it was read."""
    limits = limits or Limits()
    header = inspect(data, limits)
    probes = header.check()
    image = _decoded(header.still or data, header, cv2.IMREAD_ANYDEPTH if header.deep and levels is not None else 0)
    if image is None:
        # a MemoryError, if it is that
        np.empty(_DECODER_BYTES * header.width * header.height + _DECODER_BASE_BYTES, np.uint8)
        raise _undecodable(header)
    if {image.shape[0], image.shape[1]} != {header.height, header.width}:
        raise ImageReadError("damaged", f"the {header.format} pixels have not the size its header claims; convert it")
    if any((_decoded(copy, header) is not None) != decodes for copy, decodes in probes):
        raise damaged(f"the {header.format} data has zeros where pixels should be (lost blocks?)")
    image, notes = _levelled(image, header, levels)
    return _upright(image, header.orientation), "; ".join(filter(None, (_note(header), notes)))


DEPTHS = (10, 12, 14)
"""Bits of the cameras and microscopes whose values stand in files of 16 bits."""


def _levelled(image: NDArray[Any], header: Header, levels: Levels | None) -> tuple[NDArray[np.uint8], str]:
    """The image with the black and white of its 16-bit values, and what to say of them where nobody has named them."""
    if image.dtype != np.uint16:
        return image, ""
    if levels is not None and levels != "auto":
        return to_8_bits(image, levels), ""
    most = int(image.max())
    bits = next((bits for bits in DEPTHS if most < 1 << bits), 16)
    low, high = header.levels or (0, (1 << bits) - 1)
    if (low, high) == (0, 65535) or most == 0:  # as OpenCV itself makes 8 bits of them
        rounds = header.format == "TIFF" and image.ndim == 3
        return to_8_bits(image, (0, 65535)) if rounds else (image >> 8).astype(np.uint8), ""
    why = "as the file states" if header.levels else f"no value needs more than {bits} bits"
    return to_8_bits(image, (low, high)), f"16-bit values read from {low} to {high}: {why}; input.range sets others"


def _decoded(data: bytes, header: Header, depth: int = 0) -> NDArray[Any] | None:
    if header.format == "HEIC":
        return _heif(data)
    flag = cv2.IMREAD_GRAYSCALE if header.grey else cv2.IMREAD_COLOR
    flag |= depth
    if header.orientation:
        flag |= cv2.IMREAD_IGNORE_ORIENTATION
    try:
        decoded = cv2.imdecode(np.frombuffer(data, np.uint8), flag)
    except cv2.error:
        return None
    return None if decoded is None else np.asarray(decoded)


def _heif(data: bytes) -> NDArray[np.uint8] | None:
    """Pixels of a HEIC file, upright; None where it is damaged.

    Raises
    ------
    ImageReadError
        If the package that reads them is not installed.
    """
    try:
        import pillow_heif
    except ImportError:
        text = "HEIC is read with the package pillow-heif: pip install 'ffseg[heif]', or convert it to PNG"
        raise ImageReadError("unsupported-pixels", text) from None
    try:
        decoded = np.asarray(pillow_heif.read_heif(data, convert_hdr_to_8bit=True))
    except MemoryError:
        raise
    except Exception:  # noqa: BLE001 - a foreign parser raises whatever it comes upon
        return None
    return decoded if decoded.ndim == 2 else np.ascontiguousarray(decoded[..., 2::-1])


_DECODER_BYTES, _DECODER_BASE_BYTES = 8, 1 << 20
"""Bytes a pixel, and besides, of a decoder at work: three channels, twice, and tables. OpenCV does not tell an image that it
cannot decode from one for which there is no memory."""
_TRANSPOSED = (5, 6, 7, 8)
_FLIPPED = {2: (0, 1), 3: (1, 1), 4: (1, 0), 6: (0, 1), 7: (1, 1), 8: (1, 0)}
"""After the transposition, whether rows and columns are reversed."""


def _upright(image: NDArray[np.uint8], orientation: int) -> NDArray[np.uint8]:
    """The pixels turned as EXIF's number says."""
    if orientation <= 1:
        return image
    turned = image.swapaxes(0, 1) if orientation in _TRANSPOSED else image
    rows, columns = _FLIPPED.get(orientation, (0, 0))
    return np.ascontiguousarray(turned[:: -1 if rows else 1, :: -1 if columns else 1])


def inspect(data: bytes, limits: Limits) -> Header:
    """Pass the bytes of a file through the gate without decoding them.

    Raises
    ------
    ImageReadError
        Not an image, an image above the limits, or one whose data cannot be complete.
    """
    parser = next((parser for start, parser in _PARSERS if re.match(start, data, re.DOTALL)), None)
    if parser is None:
        raise ImageReadError("not-an-image", f"the content looks like {looks_like(data)}")
    header = parser(data)
    if header.width <= 0 or header.height <= 0:
        raise ImageReadError("no-pixels", f"the {header.format} header claims {header.width}x{header.height} pixels")
    if header.width * header.height > limits.max_pixels:
        claim = f"{header.width}x{header.height} pixels are more than the limit of {limits.max_pixels}"
        raise ImageReadError(
            "too-many-pixels",
            f"{claim}; scale the image down, or raise the limit: run --max-pixels, ffseg.Limits in Python",
        )
    if max(header.width, header.height) > limits.max_side:
        claim = f"{header.width}x{header.height} pixels: no side may be longer than {limits.max_side}"
        raise ImageReadError("too-many-pixels", f"{claim}; scale the image down or cut it into pieces")
    return header


def _note(header: Header) -> str:
    """What to say of a file of which other readers may give other pixels: more frames, or EXIF that turns; else empty."""
    notes = []
    if header.several:
        part = "page" if header.format == "TIFF" else "frame"
        remedy = "" if header.format == "AVIF" else ": ffseg run --film takes all"
        notes.append(f"only the first {part} was read; the {header.format} file has more{remedy}")
    if header.orientation > 1:
        turned = f"turned upright as EXIF orientation {header.orientation} says"
        notes.append(f"{turned}; readers that ignore it see other pixels than the mask's")
    return "; ".join(notes)


_PARSERS: tuple[tuple[bytes, Callable[[bytes], Header]], ...] = (
    (rb"\x89PNG\r\n\x1a\n", png),
    (rb"\xff\xd8\xff", jpeg),
    (rb"BM", bmp),
    (rb"GIF8[79]a", gif),
    (rb"II[*+]\0|MM\0[*+]", tiff),
    (rb"RIFF....WEBP", webp),
    (rb"P[1-6][\s#]", pnm),
    (rb"\0\0\0\x0cjP  \r\n\x87\n", jpeg2000),
    (rb"....ftypavi[fs]", avif),
    (rb"....ftyp(he[iv][cxms]|mif1|msf1)", heic),
)


def _undecodable(header: Header) -> ImageReadError:
    if header.format in ("AVIF", "GIF", "HEIC", "JPEG 2000", "TIFF"):
        reader = f"OpenCV {OPENCV_VERSION}"
        text = f"the {header.format} data is damaged, or of a kind {reader} does not read; update that, or convert it to PNG"
    else:
        text = f"the {header.format} data is damaged or incomplete; copy the file again"
    return ImageReadError("damaged", text)


OPENCV_VERSION: str = cv2.__version__


def prepare_worker() -> None:
    """Keep OpenCV to one thread, as a worker has one image and one core, and what is freed for the next image.

    Notes
    -----
    The second where the C library can be told so.
    """
    cv2.setNumThreads(1)
    tell = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if tell is not None:
        tell(_M_TRIM_THRESHOLD, _KEPT_BYTES)
        tell(_M_MMAP_THRESHOLD, _MAX_KEPT_BLOCK)
