"""Output folders as ``run`` and ``compare`` leave them, made small and by hand, for tests of what reads them."""

import json
import re
import shutil
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import ffseg
from ffseg.io.files import printable
from ffseg.io.masks import encode_mask
from ffseg.io.overlays import Polyline, encode_overlay
from ffseg.io.svg import svg_document
from ffseg.io.tables import csv_table
from ffseg.samples.scenes import SCENES

ROOT = Path(__file__).resolve().parent.parent
COLUMNS = (
    "image", "status", "error", "width", "height", "method", "initial_points", "final_points", "patches", "iterations",
    "splits", "flips", "components", "holes", "area_px", "decode_ms", "edges_ms", "evolve_ms", "obstacles_ms",
    "write_ms", "total_ms", "iou", "stop_reason",
)  # fmt: skip
COMPARED = (
    "image", "method", "initial_points", "final_points", "iterations", "edges_ms", "evolve_ms", "total_ms", "iou",
    "boundary_mean_px", "boundary_max_px", "holes", "status", "error",
)  # fmt: skip


def done_row(name: str, result: ffseg.Segmentation, index: int = 0) -> list[object]:
    """A line of timings.csv; the times are made up, so that tests know them."""
    stats, areas = result.stats, [contour.signed_area for contour in result.contours]
    height, width = result.mask.shape
    counts = [stats.initial_points, stats.final_points, stats.patches, stats.iterations, stats.splits, stats.flips]
    found = [sum(a > 0 for a in areas), sum(a < 0 for a in areas), int(result.mask.sum())]
    times = [3.5, 2.25, 4.0 + index % 300, None, 1.5, 11.25 + index % 300]
    quality = [0.99 - (index % 100) / 1000, "converged"]
    return [printable(name), "ok", "", width, height, "freeform", *counts, *found, *times, *quality]


def failed_row(name: str, error: str) -> list[object]:
    return [printable(name), "failed", error, None, None, "freeform", *[None] * (len(COLUMNS) - 6)]


def write_outputs(out: Path, stem: str, image: np.ndarray, result: ffseg.Segmentation, *, overlay: bool = True) -> None:
    height, width = result.mask.shape
    lines = [Polyline(c.flatten(0.1), "outer" if c.signed_area > 0 else "obstacle") for c in result.contours]
    made = {
        f"masks/{stem}.png": encode_mask(result.mask),
        f"contours/{stem}.svg": svg_document(result.contours, width, height).encode(),
    }
    if overlay:
        made[f"overlays/{stem}.png"] = encode_overlay(image, lines)
    for path, data in made.items():
        (out / path).parent.mkdir(parents=True, exist_ok=True)
        (out / path).write_bytes(data)


def write_tables(out: Path, rows: Iterable[Sequence[object]], inputs: Sequence[Path]) -> None:
    (out / "timings.csv").write_bytes(csv_table(COLUMNS, rows))
    params = {
        "method": "freeform",
        "contour": {"degree": 2, "balloon": 2.0},
        "init": {"radius": 60.0, "center": "auto"},
    }
    run = {"ffseg": ffseg.__version__, "status": "finished", "seconds": 1.5, "parameters": params}
    (out / "run.json").write_text(json.dumps({**run, "inputs": [str(path) for path in inputs]}))


@cache
def sample(name: str) -> tuple[np.ndarray, ffseg.Segmentation]:
    """One of the project's samples and what the default parameters find in it."""
    image = ffseg.read_image(ROOT / "samples" / f"{name}.png")
    return image, ffseg.segment(image)


def sample_run(
    out: Path, *, failures: Sequence[tuple[str, str]] = (), overlay: bool = True
) -> list[ffseg.Segmentation]:
    """A run over the project's samples with the default parameters, and rows that failed."""
    rows, results = [], []
    for index, name in enumerate(sorted(SCENES)):
        image, result = sample(name)
        results.append(result)
        write_outputs(out, name, image, result, overlay=overlay)
        rows.append(done_row(f"{name}.png", results[-1], index))
    rows += [failed_row(name, error) for name, error in failures]
    write_tables(out, rows, [ROOT / "samples"])
    return results


def large_run(out: Path, count: int) -> None:
    """Many rows and outputs with the content of one small image each."""
    first = out / "masks" / "0000.png"
    yy, xx = np.mgrid[:60, :80]
    image = np.where((xx - 40) ** 2 + (yy - 30) ** 2 < 500, 220, 30).astype(np.uint8)
    result = ffseg.segment(image, ffseg.load_params(None, {"init.radius": 8}))
    write_outputs(out, "0000", image, result)
    for index in range(1, count):
        for folder, suffix in (("masks", "png"), ("contours", "svg"), ("overlays", "png")):
            shutil.copyfile(out / folder / f"0000.{suffix}", first.parent.parent / folder / f"{index:04}.{suffix}")
    write_tables(out, [done_row(f"{index:04}.png", result, index) for index in range(count)], [])


def data_of(path: Path) -> dict[str, Any]:
    """What the page's script gets."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', path.read_text("utf-8"), re.DOTALL)
    assert found
    return dict(json.loads(found[1]))
