"""Films made in tests: a disc that moves over a dark ground."""

from pathlib import Path

import av
import numpy as np
from PIL import Image

SIZE = (80, 60)


def pictures(count: int, size: tuple[int, int] = SIZE, noise: int = 0) -> list[np.ndarray]:
    """RGB frames, shape (H, W, 3)."""
    width, height = size
    rows, columns = np.mgrid[:height, :width]
    found, random = [], np.random.default_rng(1)
    for number in range(count):
        x = width * (0.5 + 0.1 * np.sin(number / 8))
        inside = (columns - x) ** 2 + (rows - height / 2) ** 2 < (height / 3) ** 2
        pixels = np.where(inside[:, :, None], (200, 180, 60), (40, 40, 40))
        pixels = pixels + random.integers(-noise, noise + 1, pixels.shape)
        found.append(pixels.clip(0, 255).astype(np.uint8))
    return found


def write_film(
    path: Path, frames: list[np.ndarray], codec: str = "libx264", rate: int = 25, options: dict[str, str] | None = None
) -> Path:
    """Write a film; its container is told by the suffix, and its index stands before the frames."""
    height, width = frames[0].shape[:2]
    options = {"movflags": "faststart"} | (options or {})
    with av.open(str(path), "w", options=options) as film:
        track = film.add_stream(codec, rate=rate, options=options)
        track.width, track.height, track.pix_fmt = width, height, "yuvj420p" if codec == "mjpeg" else "yuv420p"
        for pixels in frames:
            film.mux(track.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")))
        film.mux(track.encode())
    return path


def write_animation(path: Path, frames: list[np.ndarray]) -> Path:
    """Write an animation of 40 ms a frame, or a stack of pages."""
    first, *others = (Image.fromarray(pixels) for pixels in frames)
    times = {} if path.suffix == ".tiff" else {"duration": 40, "loop": 0}
    lossless = {"lossless": True} if path.suffix == ".webp" else {}
    first.save(path, save_all=True, append_images=others, **times, **lossless)
    return path
