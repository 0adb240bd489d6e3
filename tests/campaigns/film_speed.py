"""Speed of films, beside OpenCV's decoding: ``python -m tests.campaigns.film_speed --work DIR [--frames 120]``.

Two films of 800x600 are decoded by OpenCV and run on one core: a drawn disc that moves, with the image's own edges, and a drawn
street with grain, over which the camera pans, with the defaults and with a model of three of its frames, which finds its own
starts, with and without the prior. Says for each, in ms a frame, medians: OpenCV's decoding, ours,
edges, evolution, everything; frames a second of edges and evolution alone; and of the street the mean IoU with the truth.
"""

import csv
import time
from dataclasses import replace
from pathlib import Path
from statistics import mean, median

import cv2
import numpy as np
from drawn_films import pictures, write_film

from ffseg.evidence.forest import load_model, to_bytes
from ffseg.learning.drawn.sights import sights
from ffseg.learning.training import PRIOR_WEIGHT
from tests.campaigns import harness
from tests.campaigns.harness import Work, say

SIZE, PANNED = (800, 600), (900, 700)
STREET, TAUGHT, NOISE = 5_002, 3, 5.0
START = "init.center=[400,520]"
"""On the road in every frame."""


def draw(work: Path, frames: int) -> tuple[Path, Path]:
    """The film, and a folder with the truths of its frames."""
    seen, random, shown = next(sights("street", 1, STREET)), np.random.default_rng(0), []
    image = cv2.resize(seen.image, PANNED, interpolation=cv2.INTER_CUBIC)
    truth = cv2.resize(seen.truth, PANNED, interpolation=cv2.INTER_NEAREST)
    folder = work / "truth"
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(frames):
        x, y = 10 + 80 * number // frames, 20 + 60 * number // frames
        window = np.s_[y : y + SIZE[1], x : x + SIZE[0]]
        shown.append(
            (image[window][..., ::-1] + random.normal(0, NOISE, (*SIZE[::-1], 3))).clip(0, 255).astype(np.uint8)
        )
        cv2.imwrite(str(folder / f"street_{number:06d}.png"), truth[window])
    return write_film(work / "street.mp4", shown, options={"crf": "18"}), folder


def taught(work: Path, film: Path, truths: Path, frames: int) -> dict[str, Path]:
    """A model of some frames, with and without the prior, whichever it has chosen."""
    few = work / "few"
    few.mkdir(exist_ok=True)
    for number in range(0, frames, frames // TAUGHT):
        name = f"street_{number:06d}.png"
        (few / name).write_bytes((truths / name).read_bytes())
    made = harness.run("learn", film, "--truth", few, "--out", work / "model.ffmodel")
    assert made.code == 0, made.stderr
    model, paths = load_model(work / "model.ffmodel"), {}
    for name, weight in (("model and prior", PRIOR_WEIGHT), ("model, no prior", 0.0)):
        paths[name] = work / f"{name}.ffmodel"
        paths[name].write_bytes(to_bytes(replace(model, prior=weight)))
    return paths


def decoding_ms(film: Path) -> float:
    """Milliseconds a frame of OpenCV's decoding, on one core."""
    capture, found = cv2.VideoCapture(str(film), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1]), list[float]()
    while True:
        begin = time.perf_counter()
        if not capture.read()[0]:
            return median(found) * 1e3
        found.append(time.perf_counter() - begin)


def measured(film: Path, out: Path, *options: str | Path) -> str:
    """A run's figures."""
    ran = harness.run("run", film, "--out", out, "--jobs", "1", *options)
    assert ran.code == 0, ran.stderr
    with (out / "timings.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    times = [median(float(row[name]) for row in rows) for name in ("decode_ms", "edges_ms", "evolve_ms", "total_ms")]
    overlaps = [float(row["iou"]) for row in rows if row.get("iou")]
    figures = f"{decoding_ms(film):8.1f}" + "".join(f"{one:8.1f}" for one in (*times, 1e3 / (times[1] + times[2])))
    return figures + (f"{mean(overlaps):8.3f}" if overlaps else "")


def main(work: Work, frames: int = 120) -> None:
    """See the module."""
    work.mkdir(parents=True, exist_ok=True)
    disc = write_film(work / "disc.mp4", pictures(frames, SIZE, noise=8))
    film, truths = draw(work, frames)
    say(f"{'':16}" + "".join(f"{name:>8}" for name in ("OpenCV", "decode", "edges", "evolve", "total", "1/s", "IoU")))
    say(f"{'gradient':16}" + measured(disc, work / "gradient", "--set", "edges.source=gradient"))
    say(f"{'defaults':16}" + measured(film, work / "defaults", "--truth", truths, "--set", START))
    for name, path in taught(work, film, truths, frames).items():
        say(f"{name:16}" + measured(film, work / name, "--truth", truths, "--set", f"edges.model={path}"))


if __name__ == "__main__":
    harness.as_command(main)
