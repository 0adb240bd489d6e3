"""A film killed (-9) many times ends in the bytes of an undisturbed run, in flat memory.

``python tests/campaigns/films.py --work DIR --frames 3000 --kills 10``
"""

from __future__ import annotations

import json
import random
import shutil
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import av
import harness
import numpy as np

SIZE = (800, 600)
EARLY = 100
"""Frames after which memory counts as settled."""
GRADIENT = ("--set", "edges.source=gradient")


@dataclass
class Figures:
    """What came of it."""

    frames: int = 0
    kills: int = 0
    differ: int = 0
    early_mb: float = 0.0
    end_mb: float = 0.0


def draw(path: Path, count: int, size: tuple[int, int]) -> Path:
    """A region that moves and turns over a noisy ground, made frame by frame."""
    width, height = size
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:height, :width]
    noise = [rng.normal(0, 4, (height, width, 1)) for _ in range(4)]
    with av.open(str(path), "w") as film:
        track = film.add_stream("libx264", rate=25, options={"preset": "ultrafast"})
        track.width, track.height, track.pix_fmt = width, height, "yuv420p"
        for number in range(count):
            dx, dy = x - width * (0.5 + 0.06 * np.sin(number / 9)), y - height / 2
            angle = np.arctan2(dy, dx) + number / 40
            inside = np.hypot(dx, dy) < height * (0.3 + 0.05 * np.sin(3 * angle))
            pixels = np.where(inside[:, :, None], (200, 180, 60), (40, 60, 40)) + noise[number % 4]
            film.mux(track.encode(av.VideoFrame.from_ndarray(pixels.clip(0, 255).astype(np.uint8), format="rgb24")))
        film.mux(track.encode())
    return path


def campaign(work: Path, frames: int, kills: int, size: tuple[int, int] = SIZE) -> Figures:
    """Run a film undisturbed, watching its memory, and under kills."""
    work.mkdir(parents=True, exist_ok=True)
    film, straight, out = draw(work / "film.mp4", frames, size), work / "straight", work / "out"
    figures = Figures(frames)
    for name in (straight, out):
        shutil.rmtree(name, ignore_errors=True)
    seconds = _watched(film, straight, GRADIENT, figures)
    reference = harness.outputs(straight)
    rng = random.Random(1)  # noqa: S311 - moments to kill at
    while figures.kills < kills:
        process = harness.start("run", film, "--out", out, "--jobs", "1", "-q", *GRADIENT)
        time.sleep(seconds * rng.uniform(0.4, 0.4 + 0.6 / kills))
        if process.poll() is not None:  # the machine has become quicker: once more, and sooner
            shutil.rmtree(out, ignore_errors=True)
            seconds *= 0.7
            continue
        harness.kill(process)
        figures.kills += 1
    harness.run("run", film, "--out", out, "--jobs", "1", "-q", *GRADIENT)
    found = harness.outputs(out)
    figures.differ = sum(found.get(name) != reference.get(name) for name in {*found, *reference})
    return figures


def _watched(film: Path, out: Path, options: tuple[str, ...], figures: Figures) -> float:
    """Run to the end and note the memory of the run and its worker, the most until `EARLY` frames and the most after; seconds."""
    begin = time.perf_counter()
    process = harness.start("run", film, "--out", out, "--jobs", "1", "-q", *options)
    while process.poll() is None:
        size = harness.resident_mb([process.pid, *harness.children(process.pid)])
        if sum(1 for _ in (out / "masks").glob("*.png")) <= EARLY:
            figures.early_mb = max(figures.early_mb, size)
        else:
            figures.end_mb = max(figures.end_mb, size)
        time.sleep(0.05)
    if process.returncode != 0:
        raise RuntimeError(f"the undisturbed run ended with {process.returncode}")
    return time.perf_counter() - begin


if __name__ == "__main__":
    arguments = harness.parser(__doc__)
    arguments.add_argument("--frames", type=int, default=3000)
    arguments.add_argument("--kills", type=int, default=10)
    given = arguments.parse_args()
    harness.say(json.dumps(asdict(campaign(given.work, given.frames, given.kills)), indent=2))
