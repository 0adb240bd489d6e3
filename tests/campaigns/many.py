"""R10: resident memory of the run and its workers over many images.

``python tests/campaigns/many.py --work DIR --images 10000 --jobs 2``
"""

from __future__ import annotations

import os
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

import harness

LONG = 5000
"""Images from which on a run lasts long enough to be looked at four times a second."""


@dataclass
class Figures:
    """Resident memory in MB when the first 500 images were done and the most of it after that."""

    images: int
    seconds: float
    early_mb: float
    late_mb: float
    code: int

    @property
    def growth(self) -> float:
        """Relative growth after the first 500 images."""
        return self.late_mb / self.early_mb - 1


def campaign(work: Path, images: int, jobs: int, first: int = 500) -> Figures:
    """Run over copies of a few small images and sample the memory of all processes."""
    source, out = work / "in", work / "out"
    for folder in (source, out):
        shutil.rmtree(folder, ignore_errors=True)
    harness.draw_blobs(work / "few", 20)
    source.mkdir(parents=True)
    for index in range(images):
        shutil.copy(work / "few" / f"i{index % 20}.png", source / f"i{index}.png")
    begin = time.monotonic()
    process = harness.start("run", source, "--out", out, "--jobs", str(jobs), "--set", harness.CONFIG, "-q")
    early: list[float] = []
    late: list[float] = []
    pause = 0.02 if images < LONG else 0.25
    journal = out / ".ffseg" / "journal.jsonl"
    while process.poll() is None:
        time.sleep(pause)
        size = journal.stat().st_size if journal.exists() else 0
        done = size / 800  # a line has about 800 bytes: this only tells early from late
        memory = harness.resident_mb([process.pid, *harness.children(process.pid)])
        if done > first / 2:  # every worker has loaded what it needs
            (late if done > first else early).append(memory)
    code = process.returncode
    at_first = max(early or late[:1])
    return Figures(images, time.monotonic() - begin, at_first, max(late[:-2] or [0.0]), code)


if __name__ == "__main__":
    arguments = harness.parser(__doc__)
    arguments.add_argument("--images", type=int, default=10_000)
    arguments.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    given = arguments.parse_args()
    figures = campaign(given.work, given.images, given.jobs)
    harness.say(f"{figures} growth {figures.growth:.1%}")
