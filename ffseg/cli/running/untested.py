"""What a run over pairs says when not one enclosed component could be tested."""

from __future__ import annotations

import csv
import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

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
    examples: dict[str, str] = {}
    for note in notes:
        examples.setdefault(_alike(note), note)
    counts = Counter(map(_alike, notes)).most_common()
    lines = [
        f"nothing was tested: {_count(verdicts.total(), 'enclosed component')} of {_count(len(images), 'image')} stay untested"
    ]
    lines += [f"  {_count(count, 'image')}: {examples[key]}" for key, count in counts[:_MOST_REASONS]]
    if len(counts) > _MOST_REASONS:
        lines.append("  further reasons are in the column note of timings.csv")
    return lines


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


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"
