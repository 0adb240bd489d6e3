"""The header of a journal: what all images of a run share; runs with other parameters are refused."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any

from ffseg.batch.record.journal import journal_lines, read_header
from ffseg.batch.tar.members import digest
from ffseg.batch.values import parsed_record
from ffseg.batch.workers.messages import Setup
from ffseg.errors import ImageReadError, UsageError
from ffseg.io.files import printable, read_bytes
from ffseg.parameters import Parameters
from ffseg.schema.kinds import FilePath
from ffseg.schema.sections import Section, declarations

_SHOWN = 5


def run_header(setup: Setup) -> dict[str, Any]:
    """Parameters, digests of the files they name, and the digest of both, by which records know what they were made with."""
    named = {**dict(parameter_files(setup.params)), **setup.files}
    files = {key: _digest_of(key, path, setup.max_bytes) for key, path in named.items()}
    views = setup.views
    files["camera"] = digest(views.camera_text().encode()) if views else ""
    past = {"past": setup.past} if setup.past else {}
    header: dict[str, Any] = json.loads(json.dumps({"parameters": asdict(setup.params) | past, "files": files}))
    return {"settings": digest(json.dumps(header, sort_keys=True).encode()), **header}


def parameter_files(params: Parameters) -> Iterator[tuple[str, str]]:
    """Keys and paths of the files that a parameter set names; a folder of files is each image's own affair."""
    for top in fields(params):
        section = getattr(params, top.name)
        if isinstance(section, Section):
            for key, kind, _ in declarations(type(section)):
                path = getattr(section, key)
                if isinstance(kind, FilePath) and path is not None and not os.path.isdir(path):
                    yield f"{top.name}.{key}", path


def _digest_of(key: str, path: str, max_bytes: int) -> str:
    try:
        return digest(read_bytes(path, max_bytes))
    except ImageReadError as error:
        raise UsageError(f"{key}: {printable(path)} cannot be used: {error}") from error


def refuse_mixing(out: str, folder: str, header: Mapping[str, Any], *, pack: bool) -> None:
    """Refuse to mix results, or outputs in tar files with files of their own; where every image failed, there are none.

    Raises
    ------
    UsageError
        If an earlier run into this output folder had other parameters, other files of theirs, or packed otherwise.
    """
    old = read_header(folder)
    same = old is None or (old.get("settings") == header["settings"] and bool(old.get("pack")) == pack)
    records = filter(None, map(parsed_record, journal_lines(folder)))
    if old is None or same or not any(record.made for record in records):
        return
    if old.get("settings") != header["settings"]:
        what, remedy = f"results with other parameters ({changes(old, header)})", ""
    else:
        way, remedy = ("files of their own", "leave out --pack, ") if pack else ("tar files", "add --pack tar, ")
        what = f"outputs in {way}"
    raise UsageError(
        f"{printable(out)} holds {what}; {remedy}use --overwrite to do them again, or another output folder"
    )


def changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """What differs between two headers, for a message."""
    found = [*_differences(old.get("parameters", {}), new["parameters"]), *_changed_files(old, new)]
    return "; ".join(found[:_SHOWN]) + ("; ..." if len(found) > _SHOWN else "") or "of an unknown kind"


def _differences(old: Any, new: Any, key: str = "") -> list[str]:  # noqa: ANN401 - JSON values
    if isinstance(old, dict) and isinstance(new, dict):
        keys: Sequence[str] = sorted({*old, *new})
        return [
            text for name in keys for text in _differences(old.get(name), new.get(name), f"{key}.{name}".strip("."))
        ]
    return [] if old == new else [f"{key} was {json.dumps(old)}, is {json.dumps(new)}"]


def _changed_files(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    before = old.get("files")
    before = before if isinstance(before, dict) else {}
    names = sorted({*before, *new["files"]})
    changed = [key for key in names if before.get(key, "") != new["files"].get(key, "")]
    return [
        "the camera file or --footprint has changed" if key == "camera" else f"the file of {key} has changed"
        for key in changed
    ]
