"""R10: resident memory of the run and its workers over many images.

``python -m tests.campaigns.many --work DIR --images 10000 --jobs 2 [--film]``
"""

import os
import shutil
import time
from dataclasses import dataclass

from tests.campaigns import harness

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

    def __str__(self) -> str:
        return f"{self!r} growth {self.growth:.1%}"


def campaign(
    work: harness.Work, images: int = 10_000, jobs: int = os.cpu_count() or 1, first: int = 500, *, film: bool = False
) -> Figures:
    """Run over copies of a few small images, or the frames of a film, and sample the memory of all processes."""
    source, out = work / "in", work / "out"
    for folder in (source, out):
        shutil.rmtree(folder, ignore_errors=True)
    harness.draw_blobs(work / "few", 20)
    source.mkdir(parents=True)
    if film:
        harness.draw_film(source / "in.mp4", images)
    for index in range(0 if film else images):
        shutil.copy(work / "few" / f"i{index % 20}.png", source / f"i{index}.png")
    begin = time.monotonic()
    process = harness.start("run", source, "--out", out, "--jobs", str(jobs), "--set", harness.CONFIG, "-q")
    early: list[float] = []
    late: list[float] = []
    pause = 0.02 if images < LONG else 0.25
    while process.poll() is None:
        time.sleep(pause)
        done = len(harness.journal(out)) / 800  # a line has about 800 bytes: this only tells early from late
        memory = harness.resident_mb([process.pid, *harness.children(process.pid)])
        if done > first / 2:  # every worker has loaded what it needs
            (late if done > first else early).append(memory)
    code = process.returncode
    return Figures(images, time.monotonic() - begin, max(early or late[:1]), max(late[:-2] or [0.0]), code)


if __name__ == "__main__":
    harness.as_command(campaign)
