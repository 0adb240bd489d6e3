"""What an interrupted comparison has found, kept until it is finished: one line for each image."""

from __future__ import annotations

import contextlib
import json
import os
from dataclasses import asdict
from pathlib import Path

from ffseg import __version__
from ffseg.batch.plan.sources import Job
from ffseg.batch.record.header import run_header
from ffseg.batch.tar.members import digest
from ffseg.batch.values import json_line, parsed_line
from ffseg.batch.workers.freshness import read_job
from ffseg.batch.workers.messages import Setup
from ffseg.compare.values import Comparison, Row
from ffseg.errors import ImageReadError
from ffseg.io.files import remove_files, unwritten, write_bytes_atomic
from ffseg.plugins import check

NAME = "compare.jsonl"


class Journal:
    """Rows of the images that are done, in a file that `end` removes; one of another comparison is begun anew."""

    def __init__(self, task: Comparison) -> None:
        self._path = os.path.join(task.out, NAME)
        files = {name: path for name in task.methods if (path := check("methods", name))}
        self._setup = Setup(params=task.params, files=files, truth_label=task.truth_label)
        asked = [__version__, run_header(self._setup)["settings"], asdict(task.peers)]
        asked += [task.methods, task.repeat, task.truth_label, task.own_edges]
        head = json_line({"comparison": digest(json.dumps(asked, sort_keys=True).encode())})
        self._done: dict[str, list[Row]] = {}
        with contextlib.suppress(OSError):
            first, *lines = Path(self._path).read_bytes().splitlines(keepends=True) or [b""]
            for value in filter(None, map(parsed_line, lines if first == head else ())):
                self._done[value["image"]] = [Row(**row) for row in value["rows"]]
        kept = (self._line(image, rows) for image, rows in self._done.items())
        write_bytes_atomic(self._path, head + b"".join(kept))

    @staticmethod
    def _line(image: str, rows: list[Row]) -> bytes:
        return json_line({"image": image, "rows": [asdict(row) for row in rows]})

    def key(self, job: Job) -> str:
        """Name and content of everything particular to an image; empty where it cannot be read."""
        try:
            seen = read_job(job, self._setup).digests if job.source.span is None else None
        except ImageReadError:
            return ""
        return f"{job.source.name} {seen.content} {seen.truth}" if seen is not None else ""

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
