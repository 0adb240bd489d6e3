"""Shards of every number, worked on by every executor: merged, they are what one run writes, byte for byte.

``python -m tests.campaigns.sharded --work DIR [--images 300] [--shards 1,2,3,8] [--executors inprocess,processes,dask]``

For each executor and number of shards, as files and packed: the shards run in a shuffled order, one of them is left out of
a first merge, another killed with SIGKILL and named by a second merge, then both are run (one of them twice) and merged. A
shard of other parameters is refused by name at the end. The merged tree must equal that of one run with ``--jobs 2``, times
apart, and nothing may be done twice. Dask is one local cluster of two workers for all.
"""

import contextlib
import json
import random
import re
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from batches import tree

from tests.campaigns import harness

EXECUTORS = ("inprocess", "processes", "dask")
KINDS = ("files", "tar")


@dataclass
class Figures:
    """What was run, and what was not as one run would have left it."""

    merged: int = 0
    shards: int = 0
    kills: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)


def campaign(
    work: Path,
    images: int,
    counts: tuple[int, ...],
    executors: tuple[str, ...] = EXECUTORS,
    kinds: tuple[str, ...] = KINDS,
) -> Figures:
    """Run every executor with every number of shards, as files and packed."""
    source, figures, rng = work / "in", Figures(), random.Random(1)  # noqa: S311 - an order, not secrets
    harness.draw_blobs(source / "a", images - images // 3)
    harness.draw_blobs(source / "b", images // 3)
    (source / "a" / "broken.png").write_bytes(b"no image")
    for kind in kinds:
        out = _fresh(work / f"one {kind}")
        assert harness.run(*_command(source, out, kind, "processes")).code == 3
        expected = tree(out)
        for executor in executors:
            with _cluster(executor) as more:
                for count in counts:
                    name = f"{executor}, {count} shards, {kind}"
                    begin = time.perf_counter()
                    out = _fresh(work / "parts")
                    _shards(_command(source, out, kind, executor, *more), count, rng, figures)
                    figures.faults += [f"{name}: {text}" for text in _differences(expected, tree(out), count)]
                    figures.merged += 1
                    figures.seconds[name] = round(time.perf_counter() - begin, 1)
                    harness.say(f"{name}: {figures.seconds[name]} s, {len(figures.faults)} faults so far")
    return figures


def _fresh(folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    return folder


def _command(source: Path, out: Path, kind: str, executor: str, *more: str) -> list[str]:
    run = ["run", str(source), "--out", str(out), "--set", harness.CONFIG, "--export", "coco", "-q", "--jobs", "2"]
    return [*run, "--executor", executor, *more, *(("--pack", "tar") if kind == "tar" else ())]


@contextlib.contextmanager
def _cluster(executor: str) -> Iterator[tuple[str, ...]]:
    """Options that name a cluster of two workers of this machine; none for other executors."""
    if executor != "dask":
        yield ()
        return
    import distributed

    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        yield ("--dask", cluster.scheduler_address, "--chunk", "20")


def _shards(command: list[str], count: int, rng: random.Random, figures: Figures) -> None:
    """Run all shards, with everything that can happen to them, and merge them."""
    out, numbers = command[3], rng.sample(range(1, count + 1), count)
    broken = {0, 3}  # the shard with the broken image ends with 3
    for number in numbers[2:]:
        figures.shards += 1
        _expect(figures, harness.run(*command, "--shard", f"{number}/{count}"), broken)
    if count > 1:
        left, dying = numbers[:2]
        process = harness.start(*command, "--shard", f"{dying}/{count}")
        journal = Path(out, ".ffseg", "shards", f"{dying}-of-{count}", "journal.jsonl")
        while process.poll() is None and not (journal.exists() and journal.read_bytes().count(b"\n") > 2):
            time.sleep(0.005)
        figures.kills += process.poll() is None
        harness.kill(process)
        ended = harness.run("merge", out)
        _expect(figures, ended, {3}, f"shard {left}/{count} never ran")
        run = journal.with_name("run.json")  # the signal may come after the last record
        if process.returncode == -9 and not (run.exists() and json.loads(run.read_text())["status"] == "finished"):
            _expect(figures, ended, {3}, f"shard {dying}/{count} did not finish")
    for number in [*numbers[:2], numbers[0]]:
        figures.shards += 1
        _expect(figures, harness.run(*command, "--shard", f"{number}/{count}"), broken)
    if count > 1:
        other = harness.run(*command, "--shard", f"{numbers[0]}/{count}", "--set", "contour.degree=2")
        _expect(figures, other, {2}, "contour.degree was 3, is 2")
    _expect(figures, harness.run("merge", out), {3})  # for the broken image


def _expect(figures: Figures, ended: harness.Ended, codes: set[int], said: str = "") -> None:
    if ended.code not in codes or said not in ended.stderr:
        figures.faults.append(f"exit {ended.code} instead of {codes}, or without {said!r}: {ended.stderr[-500:]}")


def _differences(expected: dict[str, bytes], found: dict[str, bytes], count: int) -> list[str]:
    names = sorted({*expected, *found})
    places = re.compile(rb"\.ffseg/shards/\d+-of-%d" % count)
    same = {name: places.sub(b".ffseg", data) for name, data in found.items()}
    return [f"{name} differs" for name in names if expected.get(name) != same.get(name)]


def main(work: harness.Work, images: int = 300, shards: str = "1,2,3,8", executors: str = ",".join(EXECUTORS)) -> int:
    """Say what was run; 1 after a fault."""
    result = campaign(work, images, tuple(map(int, shards.split(","))), tuple(executors.split(",")))
    harness.say(str(result))
    return int(bool(result.faults))


if __name__ == "__main__":
    harness.as_command(main)
