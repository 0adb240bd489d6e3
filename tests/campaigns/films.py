"""A film killed (-9) many times ends in the bytes of an undisturbed run, in flat memory, beside what decoding alone takes.

``python tests/campaigns/films.py --work DIR --frames 3000 --kills 10``
"""

from __future__ import annotations

import json
import random
import shutil
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import av
import cv2
import harness
import numpy as np

SIZE = (800, 600)
EARLY = 100
"""Frames after which memory counts as settled."""
WAYS = {"gradient": ("--set", "edges.source=gradient"), "default": ()}


@dataclass
class Figures:
    """What came of it; rates are frames a second."""

    frames: int = 0
    kills: int = 0
    differ: int = 0
    early_mb: float = 0.0
    end_mb: float = 0.0
    rates: dict[str, float] = field(default_factory=dict)


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


def campaign(work: Path, frames: int, kills: int, size: tuple[int, int] = SIZE, *, rates: bool = True) -> Figures:
    """Run a film undisturbed and under kills, and measure."""
    work.mkdir(parents=True, exist_ok=True)
    film, straight, out = draw(work / "film.mp4", frames, size), work / "straight", work / "out"
    figures = Figures(frames)
    for name in (straight, out):
        shutil.rmtree(name, ignore_errors=True)
    seconds = _watched(film, straight, WAYS["gradient"], figures)
    reference = harness.outputs(straight)
    rng = random.Random(1)  # noqa: S311 - moments to kill at
    while figures.kills < kills:
        process, delay = harness.start("run", film, "--out", out, "--jobs", "1", "-q", *WAYS["gradient"]), rng.random()
        time.sleep(0.4 + delay * seconds / kills)
        if process.poll() is not None:  # the machine has become quicker: once more
            shutil.rmtree(out)
            seconds *= 0.7
            continue
        harness.kill(process)
        figures.kills += 1
    harness.run("run", film, "--out", out, "--jobs", "1", "-q", *WAYS["gradient"])
    found = harness.outputs(out)
    figures.differ = sum(found.get(name) != reference.get(name) for name in {*found, *reference})
    if rates:
        figures.rates = _rates(film, straight, work)
    return figures


def _rates(film: Path, straight: Path, work: Path) -> dict[str, float]:
    """Frames a second of decoders alone and of runs."""
    found = {"PyAV decodes": _rate(_by_av(film)), "OpenCV decodes": _rate(_by_opencv(film))}
    for name, options in {**WAYS, "model": ("--set", f"edges.model={_learned(film, straight, work)}")}.items():
        found |= _stages(film, work / name, name, options)
    return found


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


def _learned(film: Path, straight: Path, work: Path) -> Path:
    """A model of three frames and their masks."""
    (work / "truth").mkdir(exist_ok=True)
    for number in (0, 10, 20):
        shutil.copy(straight / "masks" / f"film_{number:06d}.png", work / "truth")
    ended = harness.run("learn", film, "--truth", work / "truth", "--out", work / "film.ffmodel", "-q", limit=600)
    if ended.code:
        raise RuntimeError(ended.stderr)
    return work / "film.ffmodel"


def _rate(frames: Iterator[np.ndarray]) -> float:
    begin = time.perf_counter()
    count = sum(1 for _ in frames)
    return count / (time.perf_counter() - begin)


def _by_av(film: Path) -> Iterator[np.ndarray]:
    with av.open(str(film)) as container:
        container.streams.video[0].codec_context.thread_count = 1
        yield from (frame.to_ndarray(format="bgr24") for frame in container.decode(video=0))


def _by_opencv(film: Path) -> Iterator[np.ndarray]:
    cv2.setNumThreads(1)
    capture = cv2.VideoCapture(str(film), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
    while (read := capture.read())[0]:
        yield read[1]


def _stages(film: Path, out: Path, name: str, options: tuple[str, ...]) -> dict[str, float]:
    """Frames a second of one worker: edges and evolution alone, and all that a frame takes."""
    shutil.rmtree(out, ignore_errors=True)
    ended = harness.run("run", film, "--out", out, "--jobs", "1", "-q", *options)
    if ended.code:
        raise RuntimeError(ended.stderr)
    lines = (out / "timings.csv").read_text().splitlines()
    head = lines[0].split(",")
    cells = [dict(zip(head, line.split(","), strict=False)) for line in lines[1:]]
    found = np.median([float(row["edges_ms"]) + float(row["evolve_ms"]) for row in cells])
    whole = np.median([float(row["total_ms"]) for row in cells])
    return {f"{name}: edges and evolution": 1e3 / found, f"{name}: a frame in all": 1e3 / whole}


if __name__ == "__main__":
    arguments = harness.parser(__doc__)
    arguments.add_argument("--frames", type=int, default=3000)
    arguments.add_argument("--kills", type=int, default=10)
    given = arguments.parse_args()
    harness.say(json.dumps(asdict(campaign(given.work, given.frames, given.kills)), indent=2))
