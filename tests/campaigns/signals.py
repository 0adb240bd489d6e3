"""R7 and R8: runs stopped by SIGINT and SIGTERM, and workers killed, at random moments.

``python -m tests.campaigns.signals --work DIR [--stops 100] [--deaths 100]``

A stop ends the run with 130 or 143, without a process or a temporary file left, and the tables written; within two
seconds on a machine that is not busy (``slowest_stop_s``). A worker that is killed
costs at most the image it had, which is named; all others are done.
"""

import json
import os
import random
import shutil
import signal
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

from batches import table

from tests.campaigns import harness

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143}


@dataclass
class Figures:
    """What the signals did; `wrong` names each that broke a promise."""

    stops: int = 0
    slowest_stop_s: float = 0.0
    deaths: int = 0
    images_lost: int = 0
    wrong: list[str] = field(default_factory=list)


def campaign(work: harness.Work, stops: int = 0, deaths: int = 0, images: int = 300, seed: int = 1) -> Figures:
    """Signal runs with two workers after a random while of work."""
    source, out, figures, rng = work / "in", work / "out", Figures(), random.Random(seed)  # noqa: S311 - moments
    harness.draw_blobs(source, images)
    while figures.stops < stops:
        process = _at_work(source, out, rng)
        _stop(process, out, rng.choice(list(CODES)), figures)
    while figures.deaths < deaths:
        process = _at_work(source, out, rng)
        _death(process, out, images, rng, figures)
    return figures


def _at_work(source: Path, out: Path, rng: random.Random) -> subprocess.Popen[bytes]:
    """Start a run into an empty folder and wait until a random part of it is done."""
    shutil.rmtree(out, ignore_errors=True)
    process = harness.start("run", source, "--out", out, "--jobs", "2", "--set", harness.CONFIG, "-q")
    wanted = rng.uniform(0, 40_000)
    while process.poll() is None and len(harness.journal(out)) <= wanted:
        time.sleep(0.005)
    return process


def _stop(process: subprocess.Popen[bytes], out: Path, number: signal.Signals, figures: Figures) -> None:
    if process.poll() is not None:
        return  # it was done first
    begin = time.perf_counter()
    code = harness.kill(process, number)
    seconds = time.perf_counter() - begin
    if code == 0:
        return  # it was done before the signal came
    figures.stops += 1
    figures.slowest_stop_s = max(figures.slowest_stop_s, seconds)
    label = f"stop {figures.stops} by {number.name}"
    if code != CODES[number]:
        figures.wrong.append(f"{label}: exit code {code} after {seconds:.2f} s")
    if not harness.group_is_gone(process):
        figures.wrong.append(f"{label}: a process is left")
    if harness.temporaries(out):
        figures.wrong.append(f"{label}: {harness.temporaries(out)} left")
    ended = json.loads((out / "run.json").read_text())
    if ended["status"] != "interrupted" and ended["counts"]["done"] < ended["counts"]["total"]:
        figures.wrong.append(f"{label}: run.json does not say so")


def _death(process: subprocess.Popen[bytes], out: Path, images: int, rng: random.Random, figures: Figures) -> None:
    workers = harness.children(process.pid)
    try:
        os.kill(rng.choice(workers), signal.SIGKILL)
    except (IndexError, ProcessLookupError):  # there is none, or none any more
        process.wait()
        return
    code = process.wait(timeout=300)
    rows = table(out / "timings.csv")
    failed = [row for row in rows if row["status"] == "failed"]
    figures.deaths += 1
    figures.images_lost += len(failed)
    # A worker without an image costs none.
    if len(rows) != images or len(failed) > 1 or code != (3 if failed else 0):
        figures.wrong.append(f"death {figures.deaths}: exit code {code}, {len(failed)} of {len(rows)} failed")
    if any("SIGKILL" not in row["error"] for row in failed):
        figures.wrong.append(f"death {figures.deaths}: {failed[0]['error']}")


if __name__ == "__main__":
    harness.as_command(campaign)
