"""The report page of an output folder of ``run`` or ``compare``."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ffseg import __version__
from ffseg.batch.discover import discover
from ffseg.errors import ImageReadError, UsageError
from ffseg.formats.files import is_temporary, printable, read_bytes, write_bytes_atomic
from ffseg.formats.images import REASONS
from ffseg.formats.report.contours import packed_components, read_contours
from ffseg.formats.report.page import page
from ffseg.formats.report.thumbnails import thumbnail
from ffseg.formats.tables import neutral

REPORT = "report.html"
EMBEDDED_UP_TO = 200
"""Images whose thumbnails stand in the page: 2 MB in all, made within 3 s. Of more images they are linked."""

_TABLES = {"run": "timings.csv", "compare": "compare.csv"}
_TEXTS = frozenset({"image", "status", "error", "method", "verdict", "stop_reason"})
_SHOWN = frozenset({".png", ".jpg", ".jpeg", ".jpe", ".jfif", ".webp", ".gif", ".bmp", ".avif"})
"""Files every current browser shows."""
_PICTURES = ("overlays", "panels", "masks", "contours")
_MAX_BYTES = 1 << 28

Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class _Folder:
    """What an output folder holds.

    Attributes
    ----------
    path : Path
    kind : str
        ``run`` or ``compare``.
    rows : list of dict
        The table of all images; empty cells are left out, numbers are numbers.
    run : mapping
        ``run.json``, empty where there is none.
    verdicts : mapping
        Rows of ``obstacles.csv`` by image.
    outputs : mapping
        For each of `_PICTURES`, names as the tables show them, without suffix, to paths below the folder.
    sources : mapping
        Names as the tables show them to paths of input images.
    """

    path: Path
    kind: str
    rows: list[Row]
    run: Mapping[str, Any]
    verdicts: Mapping[str, list[Row]] = field(default_factory=dict)
    outputs: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)


def write_report(folder: str | os.PathLike[str], inputs: Sequence[str] = ()) -> Path:
    """Write ``report.html`` into an output folder of ``run`` or ``compare``.

    Parameters
    ----------
    folder : path
    inputs : sequence of str
        Where the images are, as given to ``run``; without it, what ``run.json`` says under ``inputs``. Images that are
        found nowhere are shown by their overlay or mask.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    UsageError
        If the folder is no output folder, or a table in it cannot be read.
    OutputError
        If the page cannot be written.
    """
    found = _read_folder(Path(folder), inputs)
    failed = sum(row.get("status") == "failed" for row in found.rows)
    title = f"{printable(found.path.resolve().name)} - ffseg {found.kind}"
    data = {
        "kind": found.kind,
        "title": printable(os.fspath(folder)),
        "version": __version__,
        "failed": failed,
        "about": _about(found.run),
        "parameters": _parameters(found.run.get("parameters")),
        "images": list(_images(found)),
    }
    target = found.path / REPORT
    write_bytes_atomic(target, page(title, data).encode("utf-8"))
    return target


def _read_folder(path: Path, inputs: Sequence[str]) -> _Folder:
    kind = next((kind for kind, table in _TABLES.items() if (path / table).is_file()), None)
    if kind is None:
        raise UsageError(
            f"{printable(path)} holds neither timings.csv nor compare.csv; give the --out folder of a run or comparison"
        )
    run = _json(path / "run.json")
    verdicts: dict[str, list[Row]] = {}
    if (path / "obstacles.csv").is_file():
        for row in _table(path / "obstacles.csv"):
            verdicts.setdefault(row.get("image", ""), []).append(row)
    outputs = {name: _by_stem(path, name) for name in _PICTURES}
    sources = _sources(inputs or run.get("inputs") or ())
    return _Folder(path, kind, _table(path / _TABLES[kind]), run, verdicts, outputs, sources)


def _text(path: Path) -> str:
    try:
        return read_bytes(path, _MAX_BYTES).decode("utf-8", "replace")
    except ImageReadError as error:
        if error.reason == "empty":
            return ""
        raise UsageError(f"{printable(path)}: {error}") from error


def _json(path: Path) -> Mapping[str, Any]:
    """A JSON object; empty where the file is not there yet."""
    if not path.is_file():
        return {}
    try:
        value = json.loads(_text(path) or "{}")
    except ValueError as error:
        raise UsageError(f"{printable(path)} is no JSON ({error}); run again into this folder") from error
    return value if isinstance(value, dict) else {}


def _table(path: Path) -> list[Row]:
    rows = csv.DictReader(io.StringIO(_text(path), newline=""))
    return [
        {
            name: _cell(name, cell)
            for name, cell in row.items()
            if isinstance(name, str) and isinstance(cell, str) and cell
        }
        for row in rows
    ]


def _cell(column: str, text: str) -> str | float | int:
    if column in _TEXTS:
        return text
    try:
        number = float(text)
    except ValueError:
        return text
    if abs(number) == float("inf") or number != number:
        return text
    return int(number) if number.is_integer() else number


def _by_stem(folder: Path, name: str) -> dict[str, str]:
    """Outputs of one kind: path below ``folder/name`` without suffix, as the tables write it, to path below `folder`."""
    found = {}
    root = os.path.join(folder, name)
    for place, _, files in os.walk(root):
        for file in files:
            if not is_temporary(file):
                below = os.path.relpath(os.path.join(place, file), root).replace(os.sep, "/")
                found[_shown(os.path.splitext(below)[0])] = f"{name}/{below}"
    return found


def _shown(name: str) -> str:
    """A file name as a cell of a table."""
    return neutral(printable(name))


def _sources(inputs: Sequence[str]) -> dict[str, str]:
    """Input images by the name the tables give them; inputs that are gone are no error, the outputs are here."""
    found: dict[str, str] = {}
    for text in inputs:
        try:
            sources = discover([str(text)])
        except UsageError:
            continue
        for source in sources:
            found.setdefault(_shown(source.name), source.path)
    return found


def _about(run: Mapping[str, Any]) -> dict[str, Any]:
    counts, versions = run.get("counts"), run.get("versions")
    return {
        **{name: run[name] for name in ("status", "started", "ended", "seconds", "problems") if name in run},
        "counts": counts if isinstance(counts, dict) else {},
        "versions": versions if isinstance(versions, dict) else {},
    }


def _parameters(values: object) -> list[tuple[str, str, bool]]:
    """Key, value and whether it differs from the default, in the order of the parameter page."""
    from ffseg.parameters import load_params

    defaults = dict(_flat(json.loads(json.dumps(asdict(load_params())))))
    found = dict(_flat(values if isinstance(values, dict) else {}))
    return [(key, json.dumps(value), defaults.get(key, value) != value) for key, value in found.items()]


def _flat(value: object, key: str = "") -> Iterator[tuple[str, object]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flat(inner, f"{key}.{name}".strip("."))
    else:
        yield key, value


def _images(found: _Folder) -> Iterator[dict[str, Any]]:
    """One entry for each image, with a row for each method it was segmented by."""
    by_image: dict[str, list[Row]] = {}
    for row in found.rows:
        by_image.setdefault(row.get("image", ""), []).append(row)
    embed = len(by_image) <= EMBEDDED_UP_TO
    for name, rows in by_image.items():
        entry: dict[str, Any] = {
            "name": name,
            "rows": [{key: row[key] for key in row if key != "image"} for row in rows],
        }
        done = any(row.get("status") == "ok" for row in rows)
        pictures = _pictures(found, name, done=done) if done or not _unreadable(rows) else {}
        if embed and pictures:
            best = pictures.get("overlay") or pictures.get("panel") or pictures.get("image") or pictures["mask"]
            entry["thumbnail"] = thumbnail(found.path / best)
        entry["pictures"] = {kind: quote(os.fsencode(path)) for kind, path in pictures.items()}
        entry["contours"] = _contours(found, name) if done and found.kind == "run" else ""
        yield entry


def _unreadable(rows: Sequence[Row]) -> bool:
    """Whether the image itself was refused: a browser must not be made to open what the reader would not."""
    return all(
        str(row.get("error", "")).partition(":")[0] in {*REASONS, "crash", "timeout", "out-of-memory"} for row in rows
    )


def _pictures(found: _Folder, name: str, *, done: bool) -> dict[str, str]:
    """Paths, relative to the page, of what a browser can show of an image."""
    pictures = {}
    source = found.sources.get(name)
    if source and os.path.splitext(source)[1].lower() in _SHOWN and os.path.isfile(source):
        pictures["image"] = os.path.relpath(source, found.path).replace(os.sep, "/")
    if done:
        for kind, folder in (("overlay", "overlays"), ("panel", "panels"), ("mask", "masks")):
            outputs = found.outputs[folder]
            path = outputs.get(os.path.splitext(name)[0]) or outputs.get(name)
            if path:
                pictures[kind] = path
    return pictures


def _contours(found: _Folder, name: str) -> str:
    """Packed contours of one image; empty where there is no file, or it was not written by ffseg."""
    path = found.outputs["contours"].get(os.path.splitext(name)[0])
    if path is None:
        return ""
    try:
        contours = read_contours(_text(found.path / path))
    except (UsageError, ValueError):
        return ""
    return packed_components(contours, found.verdicts.get(name, ()))
