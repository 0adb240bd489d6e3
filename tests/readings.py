"""How Pillow and libvips read an image file: what ffseg's own reading is compared with."""

import io
import warnings

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

Pixels = NDArray[np.uint8]


def pillow(data: bytes) -> Pixels | None:
    """First frame of a file in BGR or grey, upright, as ffseg's policies want it; None when Pillow refuses it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = Image.open(io.BytesIO(data))
            image.load()
            return _of_pillow(ImageOps.exif_transpose(image))
    except Exception:  # noqa: BLE001 - whatever it raises on a damaged file, it did not read it
        return None


def _of_pillow(image: Image.Image) -> Pixels:
    if image.mode.startswith("I;16") or image.mode == "I":
        return _eight_bits(np.asarray(image).astype(np.uint32))
    if image.mode in ("1", "L"):
        return np.asarray(image.convert("L"))
    if image.mode == "LA":
        return np.asarray(image)[..., 0]
    if image.mode in ("RGBA", "RGBX"):
        return np.asarray(image)[..., 2::-1]
    if image.mode == "P" and "transparency" in image.info:
        del image.info["transparency"]
    return np.asarray(image.convert("RGB"))[..., ::-1]


def vips(data: bytes) -> Pixels | None:
    """The same by libvips; None when it refuses the file or is not there."""
    try:
        import pyvips
    except ImportError:
        return None
    try:
        image = pyvips.Image.new_from_buffer(data, "", access="sequential", fail_on="error")
        pixels = image.autorot().numpy() if image.get_typeof("orientation") else image.numpy()
    except (pyvips.Error, KeyError, ValueError):
        return None
    if pixels.dtype == np.uint16:
        pixels = _eight_bits(pixels)
    if pixels.dtype != np.uint8:
        return None
    if pixels.ndim == 3 and pixels.shape[2] in (1, 2):
        pixels = pixels[..., 0]
    return pixels if pixels.ndim == 2 else pixels[..., 2::-1]


def _eight_bits(levels: NDArray[np.unsignedinteger]) -> Pixels:
    return ((levels.astype(np.uint32) * 255 + 32767) // 65535).astype(np.uint8)


def same(first: Pixels, second: Pixels, tolerance: int) -> bool:
    """Whether two readings agree; a grey one stands for three equal channels."""
    if first.shape[:2] != second.shape[:2]:
        return False
    one, other = (image if image.ndim == 3 else image[..., None] for image in (first, second))
    return int(np.abs(one.astype(np.int16) - other.astype(np.int16)).max()) <= tolerance
