"""R4: kill -9 at random moments leaves no partial file, and resumed runs end in the bytes of an uninterrupted one.

``python -m tests.campaigns.killed --work DIR --kills 200 --jobs 2 [--pack] [--film]``
"""

import random
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

from tests.campaigns import harness


@dataclass
class Figures:
    kills: int = 0
    partial: int = 0
    orphans: int = 0
    slowest_end_s: float = 0.0
    most_redone: int = 0
    resumed_differ: int = 0
    left_over: int = 0
    rounds: int = 0


def campaign(
    work: harness.Work, kills: int = 200, jobs: int = 2, images: int = 150, *, pack: bool = False, film: bool = False
) -> Figures:
    """Kill runs into one folder until `kills` have hit a run at work; start anew whenever the folder is complete."""
    source, straight, out = work / "in", work / "straight", work / "out"
    if film:
        source = harness.draw_film(work / "in.mp4", images)
    else:
        harness.draw_blobs(source, images)
    options = ("--set", harness.CONFIG, "--jobs", str(jobs), "-q", *(harness.PACK if pack else ()))
    begin = time.perf_counter()
    assert harness.run("run", source, "--out", straight, *options).code == 0
    longest = time.perf_counter() - begin
    reference = harness.outputs(straight)
    figures, rng = Figures(), random.Random(1)  # noqa: S311 - moments to kill at
    while figures.kills < kills:
        shutil.rmtree(out, ignore_errors=True)
        figures.rounds += 1
        while figures.kills < kills and _one_kill(source, out, options, rng.uniform(0.15, longest), figures, reference):
            pass
        ended = harness.run("run", source, "--out", out, *options)
        figures.resumed_differ += ended.code != 0 or harness.outputs(out) != reference
        figures.left_over += len(harness.temporaries(out))
    return figures


def _one_kill(
    source: Path, out: Path, options: tuple[str, ...], delay: float, figures: Figures, reference: dict[str, bytes]
) -> bool:
    process = harness.start("run", source, "--out", out, *options)
    time.sleep(delay)
    if process.poll() is not None:
        return False
    harness.kill(process)
    figures.kills += 1
    begin = time.perf_counter()
    figures.orphans += not harness.group_is_gone(process)
    figures.slowest_end_s = max(figures.slowest_end_s, time.perf_counter() - begin)
    found = harness.outputs(out)
    figures.partial += sum(reference[name] != data for name, data in found.items())
    whole = sum(f"contours/{Path(name).stem}.svg" in found for name in found if name.startswith("masks/"))
    lines = harness.journal(out).splitlines(keepends=True)
    known = sum(b'"status":"ok"' in line and line.endswith(b"\n") for line in lines)
    figures.most_redone = max(figures.most_redone, whole - known)
    return True


if __name__ == "__main__":
    harness.as_command(campaign)
