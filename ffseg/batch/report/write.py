"""The report page of an output folder of ``run`` or ``compare``."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ffseg import __version__
from ffseg.batch.outputs.table import MAP_PICTURE, REPORT
from ffseg.batch.report.contours import packed_components, read_contours
from ffseg.batch.report.folder import MAX_CELL, MAX_SVG_BYTES, OutputFolder, Row, read_folder, sources
from ffseg.batch.report.page import page
from ffseg.batch.report.thumbnails import MAX_BYTES, thumbnail, thumbnail_of
from ffseg.io.files import printable, write_bytes_atomic
from ffseg.io.images import REASONS

EMBEDDED_BYTES = 20_000_000
"""Of thumbnails that stand in the page, about 2000 of them, so that it can be sent alone; beyond, pictures are linked."""

_SHOWN = frozenset({".png", ".jpg", ".jpeg", ".jpe", ".jfif", ".webp", ".gif", ".bmp", ".avif"})
"""Files every current browser shows."""
MAX_LINES = 1000
"""Parameters and other facts that are shown of a ``run.json``, and _DEPTH levels of them."""
_DEPTH = 20
MAX_CONTOURS = 10_000
"""Contours of one image that are drawn; those of a photograph are a few hundred."""
MAX_SVG_CHARACTERS = 1 << 27
"""Characters of contours that are read for one page; the images beyond are shown without."""


def write_report(folder: str | os.PathLike[str], inputs: Sequence[str] = (), embed_bytes: int = EMBEDDED_BYTES) -> Path:
    """Write ``report.html`` into an output folder of ``run`` or ``compare``.

    Parameters
    ----------
    inputs : sequence of str
        Where the images are, as given to ``run``; without it, what ``run.json`` says under ``inputs``. Images that are
        found nowhere are shown by their overlay or mask.
    embed_bytes : int
        Of thumbnails that stand in the page itself; the pictures of the images after that are linked.

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
    found = read_folder(Path(folder), inputs)
    failed = sum(row.get("status") == "failed" for row in found.rows)
    title = f"{printable(found.path.resolve().name)} - ffseg {found.kind}"
    data = {
        "kind": found.kind,
        "title": printable(os.fspath(folder)),
        "version": __version__,
        "failed": failed,
        "about": _about(found.run),
        "parameters": _parameters(found.run.get("parameters")),
        "map": thumbnail(found.path / MAP_PICTURE),
        "images": list(_images(found, embed_bytes)),
    }
    target = found.path / REPORT
    write_bytes_atomic(target, page(title, data).encode("utf-8"))
    return target


def _about(run: Mapping[str, Any]) -> dict[str, Any]:
    problems, seconds = run.get("problems"), run.get("seconds")
    return {
        **{name: _short(run[name]) for name in ("status", "started", "ended") if name in run},
        **({"seconds": seconds} if isinstance(seconds, (int, float)) else {}),
        "problems": [_short(text) for text in (problems if isinstance(problems, list) else ())[:MAX_LINES]],
        "counts": _facts(run.get("counts")),
        "versions": _facts(run.get("versions")),
    }


def _facts(values: object) -> dict[str, Any]:
    items = list(values.items())[:MAX_LINES] if isinstance(values, dict) else ()
    return {_short(name): value if isinstance(value, (int, float)) else _short(value) for name, value in items}


def _short(value: object) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= MAX_CELL else f"{text[:MAX_CELL]}..."


def _parameters(values: object) -> list[tuple[str, str, bool]]:
    """Key, value and whether it differs from the default, in the order of the parameter page."""
    from ffseg.parameter_files import load_params

    defaults = dict(_flat(json.loads(json.dumps(asdict(load_params())))))
    found = dict(islice(_flat(values if isinstance(values, dict) else {}), MAX_LINES))
    return [(_short(key), _short(json.dumps(value)), defaults.get(key, value) != value) for key, value in found.items()]


def _flat(value: object, key: str = "", depth: int = 0) -> Iterator[tuple[str, object]]:
    if isinstance(value, dict) and depth < _DEPTH:
        for name, inner in value.items():
            yield from _flat(inner, f"{key}.{name}".strip("."), depth + 1)
    else:
        yield key, value


def _images(found: OutputFolder, embed_bytes: int) -> Iterator[dict[str, Any]]:
    """One entry for each image, with a row for each method it was segmented by."""
    by_image: dict[str, list[Row]] = {}
    for row in found.rows:
        by_image.setdefault(row.get("image", ""), []).append(row)
    images = sources(found, list(by_image))
    room = MAX_SVG_CHARACTERS if found.kind == "run" else 0
    for name, rows in by_image.items():
        entry: dict[str, Any] = {
            "name": name,
            "rows": [{key: row[key] for key in row if key != "image"} for row in rows],
        }
        done = any(row.get("status") == "ok" for row in rows)
        readable = done or not _unreadable(rows)
        pictures = _pictures(found, name, images.get(name, ""), done=done) if readable else {}
        entry["contours"], spent = _contours(found, name) if done and room > 0 else ("", 0)
        room -= spent
        if embed_bytes > 0 and pictures:
            entry["thumbnail"] = _thumbnail(found, pictures, images.get(name, "") if entry["contours"] else "")
            embed_bytes -= len(entry["thumbnail"])
        linked = {kind: path for kind, path in pictures.items() if path not in found.members}
        entry["pictures"] = {kind: quote(os.fsencode(path)) for kind, path in linked.items()}
        yield entry


def _thumbnail(found: OutputFolder, pictures: Mapping[str, str], source: str) -> str:
    """The image, for contours that are drawn over it; where there is none, the picture that shows most."""
    plain = thumbnail(source) if source else ""
    if plain:
        return plain
    best = next(pictures[kind] for kind in ("overlay", "panel", "image", "mask") if kind in pictures)
    return thumbnail_of(found.content(best, MAX_BYTES))


def _unreadable(rows: Sequence[Row]) -> bool:
    """Whether the image itself was refused: a browser must not be made to open what the reader would not."""
    return all(
        str(row.get("error", "")).partition(":")[0] in {*REASONS, "crash", "timeout", "out-of-memory"} for row in rows
    )


def _pictures(found: OutputFolder, name: str, source: str, *, done: bool) -> dict[str, str]:
    """Paths, relative to the page, of what a browser can show of an image."""
    pictures = {}
    if source and os.path.splitext(source)[1].lower() in _SHOWN:
        pictures["image"] = os.path.relpath(source, found.path).replace(os.sep, "/")
    for kind, folder in (("overlay", "overlays"), ("panel", "panels"), ("mask", "masks")) if done else ():
        path = found.output(folder, name)
        if path:
            pictures[kind] = path
    return pictures


def _contours(found: OutputFolder, name: str) -> tuple[str, int]:
    """Packed contours of one image, and the characters read; empty where ffseg wrote no file."""
    path = found.output("contours", name)
    text = found.content(path, MAX_SVG_BYTES).decode("utf-8", "replace") if path else ""
    if not text:
        return "", 0
    try:
        contours = read_contours(text, MAX_CONTOURS)
    except ValueError:
        return "", len(text)
    return packed_components(contours, found.verdicts.get(name, ())), len(text)
