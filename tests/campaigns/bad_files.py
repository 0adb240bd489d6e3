"""R1, R2: every bad file costs a row with a known reason, 2 s and 500 MB at most, and never the run.

``python -m tests.campaigns.bad_files --work DIR [--folder BAD]``; without ``--folder`` the files of
``tests/bad_images.py`` are used. Each file is read by a process of its own, then all of them in one run.
"""

import json
import shutil
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from batches import table

from ffseg.io.images import REASONS
from tests.campaigns import harness

READ_ONE = """
import json, re, sys, time
from pathlib import Path
from ffseg.errors import ImageReadError
from ffseg.io.images import read_image

def peak_kb():
    return int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1])

Path("/proc/self/clear_refs").write_text("5")  # forget the peak of start-up; rusage would count the parent's as well
base, begin = peak_kb(), time.process_time()  # waiting for a turn on a busy machine is not in it
try:
    reason, shape = "", read_image(sys.argv[1]).shape
except ImageReadError as error:
    reason, shape = error.reason, ()
spent = (time.process_time() - begin) * 1e3
print(json.dumps([reason, shape, spent, (peak_kb() - base) / 1e3]))
"""


@dataclass
class Figures:
    """What the files did; `wrong` names each that crashed, hung, or ended without a known reason."""

    files: int = 0
    read: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    slowest_ms: tuple[float, str] = (0.0, "")
    largest_mb: tuple[float, str] = (0.0, "")


def campaign(folder: Path, work: Path) -> Figures:
    """Read every file of a folder alone, then run over all of them."""
    figures, paths = Figures(), sorted(path for path in folder.iterdir() if path.suffix not in (".npy", ".json"))
    for path in paths:
        read_alone(path, figures)
    _run_over(paths, work, figures)
    return figures


def read_alone(path: Path, figures: Figures) -> None:
    """Read one file in a process of its own and note what it cost."""
    figures.files += 1
    done = subprocess.run([sys.executable, "-c", READ_ONE, str(path)], capture_output=True, timeout=60, check=False)
    if done.returncode != 0:
        figures.wrong.append(f"{path.name}: exit {done.returncode}")
        return
    reason, _, spent, grown = json.loads(done.stdout)
    figures.read += reason == ""
    figures.reasons[reason] += reason != ""
    if reason and reason not in REASONS:
        figures.wrong.append(f"{path.name}: {reason}")
    figures.slowest_ms = max(figures.slowest_ms, (spent, path.name))
    figures.largest_mb = max(figures.largest_mb, (grown, path.name))


def _run_over(paths: list[Path], work: Path, figures: Figures) -> None:
    """One run over all files, each in a folder of its own because many differ in their suffix only."""
    source, out = work / "files", work / "out"
    for place in (source, out):
        shutil.rmtree(place, ignore_errors=True)
    for path in paths:
        place = source / path.name.replace(".", "_")
        place.mkdir(parents=True)
        shutil.copy(path, place)
    ended = harness.run("run", source, "--out", out, "--jobs", "2", "-q", "--set", "init.radius=12")
    if ended.code not in (0, 3) or "Traceback" in ended.stderr:
        figures.wrong.append(f"the run ended with {ended.code}: {ended.stderr[-300:]}")
        return
    rows = table(out / "timings.csv")
    if len(rows) != len(paths):
        figures.wrong.append(f"{len(rows)} rows for {len(paths)} files")
    for row in rows:
        if row["status"] == "failed" and row["error"].split(":")[0] not in (*REASONS, "segmentation"):
            figures.wrong.append(f"{row['image']}: {row['error']}")


def main(work: harness.Work, folder: Path | None = None) -> Figures:
    """Read all files alone and in one run."""
    if folder is None:
        import bad_images

        folder = work / "bad"
        folder.mkdir(parents=True, exist_ok=True)
        bad_images.write_all(folder)
    return campaign(folder, work)


if __name__ == "__main__":
    harness.as_command(main)
