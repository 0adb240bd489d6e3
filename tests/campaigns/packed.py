"""Tiny images by the hundred thousand, in shards and packed: planned out of a tar file, run, killed, resumed and merged.

``python -m tests.campaigns.packed --work DIR --images 100000 --shards 4``

Every shard but the first is killed once with SIGKILL at a random moment and run again; the first is left out of the first
merge, which has to name it. At the end the tables must hold every image once, in order, and the tar files every output once,
in order, with the bytes that the first image of the same content has. Prints what each step took. `--files` leaves out
``--pack``; `--whole` makes one run of all images too and compares the tar files.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import os
import random
import resource
import subprocess
import sys
import tarfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image

DISTINCT = 100
"""Images of different content."""


@dataclass
class Figures:
    """What came of it; `faults` names everything that is not as promised."""

    images: int = 0
    kills: int = 0
    most_redone: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    processor_s: dict[str, float] = field(default_factory=dict)
    largest_mb: float = 0.0
    faults: list[str] = field(default_factory=list)

    def step(self, name: str, work: Callable[[], None]) -> None:
        """Do a step and remember what it took."""
        begin, before = time.monotonic(), _processor()
        work()
        self.seconds[name], self.processor_s[name] = time.monotonic() - begin, _processor() - before
        print(f"{name}: {self.seconds[name]:.1f} s, {self.processor_s[name]:.1f} s of processors", flush=True)


def parser() -> argparse.ArgumentParser:
    """Options of the command."""
    made = argparse.ArgumentParser(description=__doc__)
    made.add_argument("--work", type=Path, required=True)
    made.add_argument("--images", type=int, default=2000)
    made.add_argument("--size", type=int, default=24, help="pixels of a side")
    made.add_argument("--shards", type=int, default=4)
    made.add_argument("--jobs", type=int, default=2)
    made.add_argument("--seed", type=int, default=1)
    made.add_argument("--files", action="store_true", help="a file each instead of tar files")
    made.add_argument("--whole", action="store_true", help="compare with one run of all images")
    return made


def campaign(options: argparse.Namespace) -> Figures:
    """Do all of it."""
    options.work.mkdir(parents=True, exist_ok=True)
    archive, out, figures = options.work / "images.tar", options.work / "out", Figures(options.images)
    figures.step("images written", lambda: pack(archive, options.images, options.size))
    plan = [*command(archive, out, options)[:-1], "--dry-run"]
    figures.step("planned", lambda: expect(0, plan))
    rng = random.Random(options.seed)  # noqa: S311 - moments, not secrets
    for number in range(2, options.shards + 1):
        shard = command(archive, out, options, number)
        state = out / ".ffseg" / "shards" / f"{number}-of-{options.shards}"
        known: list[int] = []
        moment = rng.uniform(0.05, 0.95) * options.images / options.shards

        def stop(shard: list[str] = shard, state: Path = state, moment: float = moment) -> None:
            known.append(killed(shard, state / "journal.jsonl", moment, figures))  # noqa: B023 - called at once

        figures.step(f"shard {number}, killed", stop)
        figures.step(f"shard {number}, resumed", lambda shard=shard: expect(0, shard))
        counts = json.loads((state / "run.json").read_text())["counts"]
        figures.most_redone = max(figures.most_redone, known[0] - counts["unchanged"])
    figures.step("merge without shard 1", lambda: expect(3, merge(out), "shard 1/"))
    figures.step("shard 1", lambda: expect(0, command(archive, out, options, 1)))
    figures.step("merge", lambda: expect(0, merge(out)))
    figures.step("checked", lambda: figures.faults.extend(check(out, options)))
    if options.whole:
        figures.step("one run", lambda: expect(0, command(archive, options.work / "one", options)))
        figures.faults += differing(out, options.work / "one")
    figures.largest_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    return figures


def pack(path: Path, count: int, size: int) -> None:
    """A tar file of small discs, a hundred different ones."""
    pictures = [picture(index, size) for index in range(DISTINCT)]
    with tarfile.open(path, "w") as archive:
        for index in range(count):
            member = tarfile.TarInfo(name_of(index))
            member.size = len(pictures[index % DISTINCT])
            archive.addfile(member, io.BytesIO(pictures[index % DISTINCT]))


def name_of(index: int) -> str:
    """Name of an image."""
    return f"{index // 1000}/{index}.png"


def picture(index: int, size: int) -> bytes:
    """A disc of its own size and shade."""
    y, x = np.mgrid[:size, :size]
    disc = np.hypot(x - size / 2, y - size / 2) < size / 4 + index % 9 * size / 72
    buffer = io.BytesIO()
    Image.fromarray(np.where(disc, 200, 30 + index // 9).astype(np.uint8)).save(buffer, "png")
    return buffer.getvalue()


def command(archive: Path, out: Path, options: argparse.Namespace, number: int = 0) -> list[str]:
    """Command that runs one shard, or all images."""
    run = [sys.executable, "-m", "ffseg", "run", str(archive), "--out", str(out), "--set", "init.radius=3"]
    run += [] if options.files else ["--pack", "tar"]
    run += ["--shard", f"{number}/{options.shards}"] if number else []
    return [*run, "--jobs", str(options.jobs), "--quiet"]


def merge(out: Path) -> list[str]:
    """Command that merges."""
    return [sys.executable, "-m", "ffseg", "merge", str(out)]


def expect(code: int, words: list[str], said: str = "") -> None:
    """Run a command that has to end with an exit code, and say something."""
    done = subprocess.run(words, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode != code or said not in done.stderr:
        raise SystemExit(f"{' '.join(words)} ended with {done.returncode}, not {code}: {done.stderr[-2000:]}")


def killed(words: list[str], journal: Path, lines: float, figures: Figures) -> int:
    """Run a command and kill it when its journal has so many lines; how many images it knows then."""
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as run:
        seen = place = 0
        while run.poll() is None and seen < lines:
            time.sleep(0.02)
            if journal.exists():
                with journal.open("rb") as file:
                    file.seek(place)
                    data = file.read()
                seen, place = seen + data.count(b"\n"), place + len(data)
        figures.kills += run.poll() is None
        run.kill()
    with journal.open("rb") as file:
        return sum(b'"status":"ok"' in line and line.endswith(b"\n") for line in file)


def check(out: Path, options: argparse.Namespace) -> list[str]:
    """What is wrong with the merged folder."""
    with (out / "timings.csv").open(newline="", encoding="utf-8") as file:
        rows = [(row["image"], row["status"]) for row in csv.DictReader(file)]
    expected = [name_of(index) for index in range(options.images)]
    faults = []
    if [name for name, _ in rows] != expected:
        faults.append(f"the table has {len(rows)} rows that are not the images in order")
    faults += [f"{name} is {status}" for name, status in rows if status != "ok"]
    faults += [f"{path} is left" for path in out.rglob("*.tmp")]
    if options.files:
        return faults + [f"{name} has no mask" for name in expected if not (out / "masks" / name).is_file()]
    faults += [f"{path} is left" for path in out.rglob("packs/*")]
    return faults + _check_members(out / "masks.tar", [f"masks/{name}" for name in expected])


def _check_members(path: Path, expected: list[str]) -> list[str]:
    first: dict[int, bytes] = {}
    faults, count = [], 0
    with tarfile.open(path) as archive:
        for index, member in enumerate(archive):
            archive.members = []  # it would keep them all
            count += 1
            stored = archive.extractfile(member)
            data = stored.read() if stored else b""
            if index >= len(expected) or member.name != expected[index]:
                faults.append(f"{path} has {member.name} as member {index}")
            elif data != first.setdefault(index % DISTINCT, data) or not data:
                faults.append(f"{member.name} in {path} has other bytes than the first image of its content")
    return faults if count == len(expected) else [*faults, f"{path} has {count} members, not {len(expected)}"]


def differing(one: Path, other: Path) -> list[str]:
    """Tar files of two folders that are not the same."""
    names = sorted({path.name for folder in (one, other) for path in folder.glob("*.tar")})
    return [f"{name} differs" for name in names if not _same(one / name, other / name)]


def _same(one: Path, other: Path) -> bool:
    if not (one.exists() and other.exists()) or os.path.getsize(one) != os.path.getsize(other):
        return False
    with one.open("rb") as first, other.open("rb") as second:
        while piece := first.read(1 << 20):
            if piece != second.read(1 << 20):
                return False
    return True


def _processor() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    found = campaign(parser().parse_args())
    print(found)
    sys.exit(bool(found.faults))
