"""The table of a comparison as Markdown, in the paper's columns."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Sequence
from statistics import mean, median

import numpy as np

from ffseg import __version__
from ffseg.compare.shared import common_source
from ffseg.compare.values import Comparison, Row
from ffseg.plugins import method
from ffseg.schema.sections import Section, flat

_ABBREVIATIONS = {"freeform": "FF", "snake": "PM", "levelset": "LS", "paper": "FF as printed"}
"""What the paper's Table 1 calls them."""

_HEAD = (
    *("method", "initial points", "final points", "iterations", "edges ms", "evolution ms", "total ms"),
    *("IoU", "boundary mean px", "boundary max px", "boundary F 2 px", "holes"),
)


def markdown(task: Comparison, rows: Sequence[Row]) -> str:
    """Markdown of a comparison: what was run, one table per image, the means over all images."""
    images = list(dict.fromkeys(row.image for row in rows))
    lines = ["# Comparison", "", *_preface(task), ""]
    for image in images:
        lines += [f"## {_cell(image)}", "", *_table(_HEAD, (_cells(row) for row in rows if row.image == image)), ""]
    if len(images) > 1:
        lines += ["## All images", "", *_table(SUMMARY, summary_cells(task, rows)), ""]
    return "\n".join(lines)


def _preface(task: Comparison) -> list[str]:
    runs = "one run" if task.repeat == 1 else f"median of {task.repeat} runs"
    return [
        f"ffseg {__version__}, {platform.machine()}, {os.cpu_count()} cores of which one was used, Python "
        f"{platform.python_version()}, NumPy {np.__version__}. Times in milliseconds, {runs}.",
        "",
        "The edge map and the evolution are timed apart; a peer that needs no edge map is not charged for one. Reading",
        "files and scoring are not timed. Points and iterations are those of the paper's Table 1: the level set moves",
        "one node per iteration, its initial points are the first narrow band, its final points the nodes on edges.",
        "",
        *_given(task),
    ]


def _given(task: Comparison) -> list[str]:
    """What each method was given, and where the parameters of peers come from."""
    edges, peers = task.params.edges, [name for name in task.methods if method(name).module]
    if task.own_edges:
        lines = [
            "Each method had an edge map and starts of its own (`--own-edges`), as in a run; peers their own sigma."
        ]
    else:
        source = common_source(task.params, task.methods) if edges.model is None else "model"
        lines = [
            f"All methods had the same edge map (source {source}, sigma {edges.sigma:g} px) and the same starts. The columns",
            "`source` and `start_moved` of compare.csv say what `auto` decided, and where a start could not stay as asked.",
            "A peer's own sigma counts with `--own-edges` only.",
        ]
    if peers:
        lines += [
            "Parameters of peers are those of configs/peers.yaml, chosen on drawn scenes, or of `--peers`:",
            *(f"{name}: {_section(getattr(task.peers, name, None))}." for name in peers),
        ]
    return lines


def _section(section: object) -> str:
    values = flat(section) if isinstance(section, Section) else {}
    return ", ".join(f"{key} {value}" for key, value in values.items()) or "none"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows)]


def _cells(row: Row) -> list[str]:
    if row.status != "ok":
        return [_name(row.method), f"{row.status}: {_cell(row.error)}", *[""] * (len(_HEAD) - 2)]
    counts = [_number(row.initial_points, 0), _number(row.final_points, 0), _number(row.iterations, 0)]
    times = [_number(row.edges_ms, 1), _number(row.evolve_ms, 1), _number(row.total_ms, 1)]
    distances = [_number(row.boundary_mean_px, 2), _number(row.boundary_max_px, 1), _number(row.boundary_f_2px, 4)]
    return [_name(row.method), *counts, *times, _number(row.iou, 4), *distances, _number(row.holes, 0)]


SUMMARY = ("method", "images", "median evolution ms", "median total ms", "mean IoU", "lowest IoU", "best on")
"""Columns of the summary over all images; the last counts images on which no other method has a higher IoU."""


def summary_cells(task: Comparison, rows: Sequence[Row]) -> list[list[str]]:
    """One row of `SUMMARY` for each method; empty cells where nothing was measured."""
    lines, best = [], dict[str, float]()
    for row in rows:
        best[row.image] = max(best.get(row.image, 0.0), row.iou or 0.0)
    for name in task.methods:
        done = [row for row in rows if row.method == name and row.status == "ok"]
        wins = sum(row.iou is not None and row.iou >= best[row.image] for row in done)
        ious = [row.iou for row in done if row.iou is not None]
        evolve = [row.evolve_ms for row in done if row.evolve_ms is not None]
        total = [row.total_ms for row in done if row.total_ms is not None]
        times = [_number(median(evolve) if evolve else None, 1), _number(median(total) if total else None, 1)]
        overlaps = [_number(mean(ious) if ious else None, 4), _number(min(ious, default=None), 4)]
        lines.append([_name(name), str(len(done)), *times, *overlaps, str(wins) if ious else ""])
    return lines


def _name(method: str) -> str:
    short = _ABBREVIATIONS.get(method)
    return f"{method} ({short})" if short else method


def _number(value: float | None, digits: int) -> str:
    return "" if value is None or value != value else f"{value:.{digits}f}"


def _cell(text: str) -> str:
    for mark in "\\`*_[]<>|#":
        text = text.replace(mark, f"\\{mark}")
    return text
