"""Folders of small images and runs over them, for tests of the batch."""

import csv
import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import stand_in

from ffseg.batch.executors.base import Options
from ffseg.batch.outputs.table import Products
from ffseg.batch.plan.jobs import Plan, make_plan
from ffseg.batch.plan.sources import Job
from ffseg.batch.record.ledger import Summary
from ffseg.batch.runner import Run
from ffseg.batch.shards.assign import read_shard, shard_plan
from ffseg.batch.workers.messages import Setup
from ffseg.parameter_files import load_params
from ffseg.parameters import Parameters
from tests.masks import write_image


@dataclass
class Silent:
    """Observer and stop in one: remembers what it hears, and asks for the end after `last` images."""

    last: int = 1 << 60
    heard: list[tuple[str, str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    signal: int = 0
    descriptor: int = field(default_factory=lambda: os.eventfd(0))

    def finished(self, job: Job, status: str, error: str) -> None:
        self.heard.append((job.source.name, status, error))
        if len(self.heard) >= self.last:
            self.signal = 15

    def note(self, text: str) -> None:
        self.notes.append(text)

    def __del__(self) -> None:
        os.close(self.descriptor)


def make_images(folder: Path, names: Iterable[str], levels: dict[str, int] | None = None) -> None:
    """Write small grey images; `levels` sets the first pixel of some (see `stand_in`)."""
    for index, name in enumerate(names):
        pixels = np.random.default_rng(index).integers(0, 250, (12, 16), dtype=np.uint8)
        pixels[0, 0] = (levels or {}).get(name, 0)
        write_image(folder / name, pixels)


def images_fixture(names: Sequence[str], levels: dict[str, int] | None = None) -> Callable[[Path], Path]:
    @pytest.fixture
    def images(tmp_path: Path) -> Path:
        make_images(tmp_path / "in", names, levels)
        return tmp_path / "in"

    return images


def run_batch(
    folder: Path | list[Path],
    out: Path,
    *,
    params: Parameters | None = None,
    observer: Silent | None = None,
    **options: object,
) -> Summary:
    """Run the stand-in over a folder; options are those of `Options`, `make_plan` and `Setup` by name."""
    plan_keys = ("products", "truth", "exclude", "keep_suffix", "film")
    plan_options = {key: options.pop(key) for key in plan_keys if key in options}
    setup_options = {key: options.pop(key) for key in ("memory_bytes", "truth_label") if key in options}
    inputs = folder if isinstance(folder, list) else [folder]
    plan = make_plan([str(path) for path in inputs], str(out), **plan_options)
    setup = Setup(params=params or load_params(), segmenter=stand_in.NAME, products=plan.products, **setup_options)
    return run_plan(plan, setup, observer, **options)


def run_plan(plan: Plan, setup: Setup, observer: Silent | None = None, **options: object) -> Summary:
    """Run what is planned; options are those of `Options` by name."""
    observer = observer or Silent()
    with Run(plan, setup, Options(**options), observer, observer) as run:
        return run.execute()


def run_shard(
    folder: Path, out: Path, shard: str, params: Parameters | None = None, *, products: Products,
    executor: str = "inprocess", **options: object,
) -> None:  # fmt: skip
    """Run the stand-in over a part of a folder."""
    plan = shard_plan(make_plan([str(folder)], str(out), products=products), read_shard(shard))
    setup = Setup(params=params or load_params(), segmenter=stand_in.NAME, products=products)
    run_plan(plan, setup, executor=executor, **options)


def table(path: Path) -> list[dict[str, str]]:
    """Rows of a CSV file."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def snapshot(out: Path) -> dict[str, bytes]:
    """Content of the masks, contours and overlays under an output folder."""
    files = (path for kind in ("masks", "contours", "overlays") for path in (out / kind).rglob("*") if path.is_file())
    return {str(path.relative_to(out)): path.read_bytes() for path in files}


TIMES = ("decode_ms", "edges_ms", "evolve_ms", "write_ms", "total_ms")


def tree(out: Path) -> dict[str, bytes]:
    """Every file but the state, with times and the words about the run itself left out."""
    found = {}
    for path in out.rglob("*"):
        name = str(path.relative_to(out))
        if path.is_file() and not name.startswith(".ffseg/"):
            found[name] = path.read_bytes()
    rows = table(out / "timings.csv")
    found["timings.csv"] = repr([{key: row[key] for key in row if key not in TIMES} for row in rows]).encode()
    run, kept = json.loads(found["run.json"]), ("status", "counts", "inputs", "parameters", "versions", "stale")
    found["run.json"] = repr([run[key] for key in kept]).encode()
    return found
