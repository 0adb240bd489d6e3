"""Tiny images by the hundred thousand, in shards: planned out of a tar file, run, killed, resumed and merged.

``python -m tests.campaigns.sharded --work DIR --images 100000 --shards 4``

Every shard is killed once with SIGKILL at a random moment and run again; one is left out of the first merge, which has to
name it. At the end the tables must hold every image once, in order, and every mask must be there. Prints what each step
took.
"""

from __future__ import annotations

import argparse
import csv
import io
import random
import resource
import subprocess
import sys
import tarfile
import time
from pathlib import Path

import numpy as np
from PIL import Image


def main() -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--images", type=int, default=2000)
    parser.add_argument("--shards", type=int, default=4)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    archive, out = options.work / "images.tar", options.work / "out"
    step("packed", lambda: pack(archive, options.images))
    rng = random.Random(options.seed)  # noqa: S311 - moments, not secrets
    numbers = list(range(1, options.shards + 1))
    for number in numbers[1:]:
        step(f"shard {number}, killed", lambda number=number: killed(command(archive, out, number, options), rng))
        step(f"shard {number}", lambda number=number: expect(0, command(archive, out, number, options)))
    step("merge without shard 1", lambda: expect(3, merge(out)))
    step("shard 1", lambda: expect(0, command(archive, out, 1, options)))
    step("merge", lambda: expect(0, merge(out)))
    faults = check(out, options.images)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"{options.images} images in {options.shards} shards, {len(faults)} faults, largest process {peak:.0f} MB")
    for fault in faults:
        print(fault)
    return 1 if faults else 0


def step(name: str, work) -> None:
    """Do a step and say what it took."""
    begin = time.monotonic()
    work()
    print(f"{name}: {time.monotonic() - begin:.1f} s", flush=True)


def pack(path: Path, count: int) -> None:
    """A tar file of small discs, a hundred different ones."""
    pictures = [picture(index) for index in range(100)]
    with tarfile.open(path, "w") as archive:
        for index in range(count):
            member = tarfile.TarInfo(f"{index // 1000}/{index}.png")
            member.size = len(pictures[index % 100])
            archive.addfile(member, io.BytesIO(pictures[index % 100]))


def picture(index: int) -> bytes:
    """A disc of its own size on 48x32 pixels."""
    y, x = np.mgrid[:32, :48]
    disc = np.hypot(x - 24, y - 16) < 6 + index % 9
    buffer = io.BytesIO()
    Image.fromarray(np.where(disc, 200, 30 + index // 9).astype(np.uint8)).save(buffer, "png")
    return buffer.getvalue()


def command(archive: Path, out: Path, number: int, options: argparse.Namespace) -> list[str]:
    """Command that runs one shard."""
    run = [sys.executable, "-m", "ffseg", "run", str(archive), "--out", str(out), "--quiet", "--set", "init.radius=3"]
    return [*run, "--shard", f"{number}/{options.shards}", "--jobs", str(options.jobs)]


def merge(out: Path) -> list[str]:
    """Command that merges."""
    return [sys.executable, "-m", "ffseg", "merge", str(out)]


def expect(code: int, words: list[str]) -> None:
    """Run a command that has to end with an exit code."""
    done = subprocess.run(words, check=False, capture_output=True, text=True)
    if done.returncode != code:
        raise SystemExit(f"{' '.join(words)} ended with {done.returncode}, not {code}: {done.stderr[-2000:]}")


def killed(words: list[str], rng: random.Random) -> None:
    """Run a command and kill it some seconds after its start, if it lasts so long."""
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as run:
        try:
            run.wait(rng.uniform(1.5, 8.0))
        except subprocess.TimeoutExpired:
            run.kill()


def check(out: Path, count: int) -> list[str]:
    """What is wrong with the merged folder."""
    faults = []
    with (out / "timings.csv").open(newline="", encoding="utf-8") as file:
        rows = [(row["image"], row["status"]) for row in csv.DictReader(file)]
    expected = [f"{index // 1000}/{index}.png" for index in range(count)]
    if [name for name, _ in rows] != expected:
        faults.append(f"the table has {len(rows)} rows that are not the images in order")
    faults += [f"{name} is {status}" for name, status in rows if status != "ok"]
    faults += [f"{name} has no mask" for name, _ in rows if not (out / "masks" / name).is_file()]
    faults += [f"{path} is left" for path in out.rglob("*.tmp")]
    return faults


if __name__ == "__main__":
    sys.exit(main())
