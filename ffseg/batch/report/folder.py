"""Contents of an output folder, read for its report with limits on every size.

Folders come from elsewhere too: nothing here walks a folder, and lengths, counts and depths are bounded.
"""

from __future__ import annotations

import csv
import glob
import io
import json
import os
import tarfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

from ffseg.batch.outputs.table import tar_name
from ffseg.batch.plan.discover import fixed_folder
from ffseg.batch.tar.members import Member, output_bytes
from ffseg.errors import ImageReadError, UsageError
from ffseg.io.files import printable, read_bytes
from ffseg.io.tables import names_meant_by

TABLES = {"run": "timings.csv", "compare": "compare.csv"}
MAX_BYTES = 1 << 26
"""Of a table: a hundred thousand images have 30 MB."""
MAX_SVG_BYTES = 1 << 24
"""Of the contours of one image; those of a photograph have under 1 MB."""
MAX_ROWS = 200_000
MAX_CELL = 1000
"""Characters of a cell that are shown; messages have at most a few hundred."""
MAX_NAME = 16_384
"""Characters of a name: a path has 4096 bytes, each shown by four at most."""
MAX_COLUMNS = 200
MAX_INPUTS = 100_000
_TEXTS = frozenset({"image", "status", "error", "method", "verdict", "stop_reason", "note", "source"})
_OUTPUTS = {"overlays": ".png", "panels": ".png", "masks": ".png", "contours": ".svg"}

Row = dict[str, Any]


@dataclass(frozen=True)
class OutputFolder:
    """What an output folder holds."""

    path: Path
    kind: str
    """``run`` or ``compare``."""
    rows: list[Row]
    """The table of all images; empty cells are left out, numbers are numbers."""
    run: Mapping[str, Any]
    """``run.json``, empty where there is none."""
    verdicts: Mapping[str, list[Row]] = field(default_factory=dict)
    """Rows of ``obstacles.csv`` by image."""
    inputs: Sequence[str] = ()
    """Files, folders and patterns that images may lie under."""

    @cached_property
    def members(self) -> Mapping[str, Member]:
        """Where outputs lie that are in tar files."""
        found: dict[str, Member] = {}
        for kind in _OUTPUTS:
            found |= _listed(self.path, tar_name(kind), MAX_ROWS)
        return found

    def output(self, kind: str, image: str) -> str:
        """Path below the folder of an image's overlay, panel, mask or contours; empty where there is none."""
        suffix = _OUTPUTS[kind]
        for name in names_meant_by(image):
            for below in (os.path.splitext(name)[0] + suffix, name + suffix):
                if os.path.isfile(os.path.join(self.path, kind, below)) or f"{kind}/{below}" in self.members:
                    return f"{kind}/{below}"
        return ""

    def content(self, path: str, max_bytes: int) -> bytes:
        """Content of an output, be it a file or in a tar file; empty where it cannot be read or is longer."""
        member = self.members.get(path)
        try:
            if member is None:
                return read_bytes(self.path / path, max_bytes)
            return output_bytes(os.fspath(self.path), path, member) if member[2] <= max_bytes else b""
        except ImageReadError:
            return b""


def read_folder(path: Path, inputs: Sequence[str] = ()) -> OutputFolder:
    """Read the tables of an output folder.

    Parameters
    ----------
    inputs : sequence of str
        Where the images are; without it, what ``run.json`` says.
    """
    kind = next((kind for kind, table in TABLES.items() if os.path.isfile(path / table)), None)
    if kind is None:
        raise UsageError(
            f"{printable(path)} holds neither timings.csv nor compare.csv; give the --out folder of a run or comparison"
        )
    run = _json(path / "run.json")
    verdicts: dict[str, list[Row]] = {}
    if os.path.isfile(path / "obstacles.csv"):
        for row in _table(path / "obstacles.csv"):
            verdicts.setdefault(row.get("image", ""), []).append(row)
    stored = run.get("inputs")
    places = inputs or [
        text for text in islice(stored if isinstance(stored, list) else (), MAX_INPUTS) if type(text) is str
    ]
    return OutputFolder(path, kind, _table(path / TABLES[kind]), run, verdicts, places)


def sources(folder: OutputFolder, images: Sequence[str]) -> dict[str, str]:
    """Input images by the name the tables give them; inputs that are gone are no error, the outputs are here.

    Parameters
    ----------
    images : sequence of str
        Names as the tables show them.
    """
    files = {os.path.basename(text): text for text in folder.inputs if os.path.isfile(text)}
    places = [place for text in folder.inputs if (place := _place(text)) is not None]
    found = {}
    for image in images:
        names = names_meant_by(image)
        candidates = [files[name] for name in names if name in files]
        candidates += (path for name in names for place in places if os.path.isfile(path := os.path.join(place, name)))
        if candidates:
            found[image] = candidates[0]
    return found


def _place(text: str) -> str | None:
    """The folder that the names of an input's images are relative to."""
    if os.path.isdir(text):
        return text
    if not glob.has_magic(text) or os.path.lexists(text):
        return None
    return fixed_folder(text)


def _text(path: Path) -> str:
    try:
        return read_bytes(path, MAX_BYTES).decode("utf-8", "replace")
    except ImageReadError as error:
        if error.reason == "empty":
            return ""
        raise UsageError(f"{printable(path)}: {error}") from error


def _json(path: Path) -> Mapping[str, Any]:
    """A JSON object; empty where the file is not there yet. Numbers that JSON has not become their names."""
    if not os.path.isfile(path):
        return {}
    try:
        value = json.loads(_text(path) or "{}", parse_constant=str)
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{printable(path)} is no JSON ({error}); run again into this folder") from error
    return value if isinstance(value, dict) else {}


def _table(path: Path) -> list[Row]:
    rows = list(islice(_rows(path), MAX_ROWS + 1))
    if len(rows) > MAX_ROWS:
        raise UsageError(f"{printable(path)} has more than {MAX_ROWS} rows, the most that a page shows")
    return rows


def _rows(path: Path) -> Iterator[Row]:
    before = csv.field_size_limit(MAX_BYTES)  # a long cell is cut, not refused
    try:
        rows = csv.reader(io.StringIO(_text(path), newline=""))
        head = [name[:MAX_CELL] for name in next(rows, [])[:MAX_COLUMNS]]
        if "image" not in head:
            raise UsageError(f"{printable(path)} is no table of images; run again into this folder")
        for cells in rows:
            if cells:
                pairs = zip(head, cells, strict=False)
                yield {name: _cell(name, cell) for name, cell in pairs if cell}
    except csv.Error as error:
        raise UsageError(f"{printable(path)} is no table ({error}); run again into this folder") from error
    finally:
        csv.field_size_limit(before)


def _cell(column: str, text: str) -> str | float | int:
    most = MAX_NAME if column == "image" else MAX_CELL
    if len(text) > most:
        return f"{text[:most]}..."
    if column in _TEXTS:
        return text
    try:
        number = float(text)
    except ValueError:
        return text
    if abs(number) >= 1e15 or number != number:  # infinite, or no number to be shown
        return text
    return int(number) if number.is_integer() else number


def _listed(folder: Path, name: str, most: int) -> dict[str, Member]:
    """Places of the first so many regular members of a tar file in a folder, by name."""
    found: dict[str, Member] = {}
    if not (folder / name).is_file():
        return found
    try:
        with tarfile.open(folder / name, "r:", encoding="utf-8", errors="surrogateescape") as archive:
            kept: Any = archive
            for member in islice(archive, most):
                kept.members = []  # it would keep them all
                if member.isreg() and not member.issparse():
                    found[member.name] = (name, member.offset_data, member.size)
    except (tarfile.TarError, OSError, ValueError):
        return found
    return found
