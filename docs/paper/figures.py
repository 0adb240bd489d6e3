"""Make the figures of the software paper from the sample pictures: ``python docs/paper/figures.py``."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

import ffseg
from ffseg.io.overlays import Polyline, draw_overlay

FOLDER = Path(__file__).resolve().parent
SAMPLES = FOLDER.parents[1] / "samples"


def overlay(image: np.ndarray, result: ffseg.Segmentation | ffseg.Frame) -> np.ndarray:
    """The image with the contours of a result."""
    lines = [Polyline(c.flatten(0.1), "outer" if c.signed_area > 0 else "obstacle") for c in result.contours]
    return draw_overlay(image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), lines)


def stages() -> np.ndarray:
    """One drawing with fixed patches, with refinement, with refinement and topology."""
    image = ffseg.read_image(SAMPLES / "toy.png")
    return np.hstack([overlay(image, ffseg.segment(image, f"toy-{name}")) for name in ("fixed", "refined", "full")])


def ground() -> np.ndarray:
    """A rendered pair: the segmentation of the second image, and its free space."""
    sequence = ffseg.Sequence(ffseg.load_camera(SAMPLES / "pair" / "camera.yaml"))
    for name in ("0001.png", "0002.png"):
        image = ffseg.read_image(SAMPLES / "pair" / name)
        frame = sequence.feed(image)
    return np.hstack([overlay(image, frame.segmentation), overlay(image, frame)])


def main() -> None:
    """Write the figures beside the paper."""
    for name, draw in {"stages": stages, "ground": ground}.items():
        drawn = draw()
        small = cv2.resize(drawn, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        _, coded = cv2.imencode(".png", small)
        (FOLDER / f"{name}.png").write_bytes(coded.tobytes())


if __name__ == "__main__":
    main()
