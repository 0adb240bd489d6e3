"""Outputs of earlier comparisons in a folder, and the rows of an interrupted one, kept until it is finished."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

from ffseg import __version__
from ffseg.batch.plan.sources import Job
from ffseg.batch.record.header import run_header
from ffseg.batch.tar.members import digest
from ffseg.batch.values import json_line, parsed_line
from ffseg.batch.workers.freshness import read_job
from ffseg.batch.workers.messages import Setup
from ffseg.compare.values import COLUMNS, Comparison, Row
from ffseg.errors import ImageReadError, UsageError
from ffseg.io.files import printable, read_bytes, remove_files, unwritten, write_bytes_atomic
from ffseg.io.tables import names_meant_by
from ffseg.plugins import check

NAME = "compare.jsonl"
TABLE, PAGE = "compare.csv", "compare.md"
_MAX_BYTES = 1 << 28
"""Of an earlier table or journal that is looked at."""


def panel_of(out: str, name: str) -> str:
    """Path of an image's panel."""
    return os.path.join(out, "panels", f"{os.path.splitext(name)[0]}.png")


def refuse_foreign(out: str, panels: Iterable[str]) -> None:
    """Refuse to replace what no comparison has made, by the table and the journal in its folder.

    Raises
    ------
    UsageError
        If a table, the journal or one of the panels exists and is not known; naming it.
    """
    table, (comparison, images, _) = _table(out), _journal(out)
    made = {panel_of(out, name) for name in images.union(table or ())}
    tables = (TABLE, PAGE) if table is not None else ()
    made |= {os.path.join(out, name) for name in ((*tables, NAME) if comparison else tables)}
    outputs = (*(os.path.join(out, name) for name in (TABLE, PAGE, NAME)), *panels)
    foreign = next((path for path in outputs if os.path.lexists(path) and path not in made), "")
    if foreign:
        raise UsageError(f"{printable(foreign)} exists and no comparison made it; choose another folder")


def _table(out: str) -> set[str] | None:
    """Names of the images in a table; None where it is not of a comparison."""
    try:
        text = read_bytes(os.path.join(out, TABLE), _MAX_BYTES).decode("utf-8")
        head, *rows = list(csv.reader(io.StringIO(text, newline="")))
    except (ImageReadError, ValueError, csv.Error):
        return None
    if "status" not in head or tuple(head) != COLUMNS[: len(head)]:
        return None
    return {name for row in rows if row for name in names_meant_by(row[0])}


def _journal(out: str) -> tuple[str, set[str], list[bytes]]:
    """Digest of a comparison, names of all images that may have a panel, lines of those done; of a journal's file."""
    try:
        first, *lines = read_bytes(os.path.join(out, NAME), _MAX_BYTES).splitlines(keepends=True)
        head = parsed_line(first) or {}
        images = {name for image in head["images"] for name in names_meant_by(image)[-1:]}
        return str(head["comparison"]), images, lines
    except (ImageReadError, KeyError, TypeError, AttributeError):
        return "", set(), []


class Journal:
    """Rows of the images that are done, in a file that `end` removes; one of another comparison is begun anew.

    Attributes
    ----------
    panels : set of str
        Panels of this comparison, and of those before it that were not removed, also of those that were killed.
    """

    def __init__(self, task: Comparison) -> None:
        self._path = os.path.join(task.out, NAME)
        files = {name: path for name in task.methods if (path := check("methods", name))}
        self._setup = Setup(params=task.params, files=files, truth_label=task.truth_label)
        identity = [__version__, run_header(self._setup)["settings"], asdict(task.peers)]
        identity += [task.methods, task.repeat, task.truth_label, task.own_edges]
        comparison = digest(json.dumps(identity, sort_keys=True).encode())
        before, images, lines = _journal(task.out)
        images |= {job.source.name for job in task.jobs if not job.source.problem} | (_table(task.out) or set())
        self.panels = {panel_of(task.out, name) for name in images}
        self._done: dict[str, list[Row]] = {}
        for value in filter(None, map(parsed_line, lines if before == comparison else ())):
            with contextlib.suppress(KeyError, TypeError):  # a line of another shape is not known
                self._done[value["image"]] = [Row(**row) for row in value["rows"]]
        first = json_line({"comparison": comparison, "images": sorted(map(printable, images))})
        kept = (self._line(image, rows) for image, rows in self._done.items())
        write_bytes_atomic(self._path, first + b"".join(kept))

    @staticmethod
    def _line(image: str, rows: list[Row]) -> bytes:
        return json_line({"image": image, "rows": [asdict(row) for row in rows]})

    def key(self, job: Job) -> str:
        """Name and content of everything particular to an image; empty where it cannot be read."""
        try:
            seen = read_job(job, self._setup).digests
        except ImageReadError:
            return ""
        return f"{job.source.name} {seen.content} {seen.truth}"

    def rows(self, key: str) -> list[Row]:
        """Rows of an image that is done; none of another."""
        return self._done.get(key, [])

    def add(self, key: str, rows: list[Row]) -> None:
        """Remember an image."""
        if key:
            try:
                with Path(self._path).open("ab") as file:
                    file.write(self._line(key, rows))
            except OSError as error:
                raise unwritten(self._path, error) from error

    def end(self) -> None:
        """Remove the file: a finished comparison begins anew."""
        remove_files([self._path])
