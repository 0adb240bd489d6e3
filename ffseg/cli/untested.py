"""What a run over pairs says of those that could not be tested."""

from __future__ import annotations

import csv
import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ffseg.io.tables import counted

_MOST_REASONS = 5
"""Reasons said; the column ``note`` of ``timings.csv`` has one for each image."""


def nothing_tested(rows: Sequence[Mapping[str, Any]], out: str) -> list[str]:
    """Lines for people: how much stayed untested and why, by number of images; none when something was tested.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of ``timings.csv`` of the finished images.
    out : str
        Output folder, with ``obstacles.csv``.
    """
    if all(row.get("obstacles_ms") is None for row in rows):  # no camera: a table of verdicts is of an earlier run
        return []
    verdicts, images = _verdicts(os.path.join(out, "obstacles.csv"))
    if not verdicts or set(verdicts) != {"untested"}:
        return []
    notes = [row["note"] for row in rows if row.get("note") and row["image"] in images]
    components, of = counted(verdicts.total(), "enclosed component"), counted(len(images), "image")
    said = f"nothing was tested: {components} of {of} stay untested"
    return [said, *_reasons(notes, "image")]


def untested_pairs(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Lines for people: how many of the pairs could not be tested and why; none when all were."""
    pairs = [row for row in rows if row.get("pair") in ("tested", "untested")]
    notes = [row["note"] for row in pairs if row["pair"] == "untested"]
    return [f"{len(notes)} of {counted(len(pairs), 'pair')} untested:", *_reasons(notes, "pair")] if notes else []


def motions(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Lines for people: what came of comparing each image with those before."""
    return [f"{row['image']}: {row['note']}" for row in rows if row.get("pair") and row.get("note")]


def _reasons(notes: Sequence[str], what: str) -> list[str]:
    """Why, by number: notes that differ in their figures only are one reason, said as the first has it."""
    examples: dict[str, str] = {}
    for note in notes:
        examples.setdefault(_alike(note), note)
    counts = Counter(map(_alike, notes)).most_common()
    lines = [f"  {counted(count, what)}: {examples[key]}" for key, count in counts[:_MOST_REASONS]]
    return [*lines, "  further reasons are in the column note of timings.csv"] if len(counts) > _MOST_REASONS else lines


def _verdicts(path: str) -> tuple[Counter[str], set[str]]:
    try:
        with Path(path).open(encoding="utf-8-sig", newline="") as file:
            rows = [(row["verdict"], row["image"]) for row in csv.DictReader(file)]
    except (OSError, KeyError, csv.Error):
        return Counter(), set()
    return Counter(verdict for verdict, _ in rows), {image for _, image in rows}


def _alike(note: str) -> str:
    """A note without its numbers: those of one reason are one."""
    return re.sub(r"\d+(\.\d+)?", "#", note)
