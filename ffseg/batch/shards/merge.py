"""The tables of one run from the journals of its shards, in bounded memory."""

from __future__ import annotations

import json
import os
import sqlite3
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Any

from ffseg import __version__
from ffseg.batch.outputs.table import GROUND, PARQUET, RUN
from ffseg.batch.plan.sources import STATE_FOLDER
from ffseg.batch.record.header import changes
from ffseg.batch.record.journal import (
    FORMAT,
    JOURNAL,
    SHARDS,
    journal_lines,
    read_header,
    shard_names,
    state_folder,
    tables_of,
)
from ffseg.batch.record.lock import OutputLock
from ffseg.batch.record.ordered import MAX_NAMED, OrderedPacks, is_gone, packs_of, publish, relocated
from ffseg.batch.record.survey import stale_reason, without_old_truth
from ffseg.batch.record.tables import Records, Tables, remove_old
from ffseg.batch.shards.assign import Shard, shard_of_folder
from ffseg.batch.values import Record, json_line, parsed_line, parsed_record, record_line
from ffseg.batch.workers.freshness import still_true
from ffseg.errors import ImageReadError, OutputError, UsageError
from ffseg.io.files import atomic_stream, is_temporary, printable, read_bytes, remove_files, temporary_path

_MAX_RUN_BYTES = 1 << 30
"""Bytes of a ``run.json``: it names every image that is no longer as it was."""


@dataclass(slots=True)
class Part:
    """What a shard left."""

    shard: Shard
    folder: str
    header: Mapping[str, Any]
    """Of its journal; empty when it never ran."""
    run: Mapping[str, Any]
    """Its ``run.json``; empty when it did not come to its end."""
    problem: str = ""
    """Why the merged tables lack images because of it."""


@dataclass(slots=True)
class Merge:
    """How a merge ended."""

    out: str
    num_stale: int = 0
    """Images that are no longer what their record says."""
    counts: dict[str, int] = field(default_factory=lambda: {"total": 0, "ok": 0, "failed": 0})
    """Images by status."""
    problems: list[str] = field(default_factory=list)
    """Shards that never ran or did not finish, or were made by another version, outputs that are gone, and tables that
    cannot be written."""
    notes: list[str] = field(default_factory=list)
    """What a merge does not do."""


@dataclass(slots=True)
class MergedRecords(Records):
    """Records in the order of the tables, in a file: as `Survey`, for any number of them."""

    path: str

    def records(self) -> Iterator[Record]:
        """Records in the order of the tables."""
        with Path(self.path).open("rb") as file:
            file.readline()
            for line in file:
                record = parsed_record(line)
                if record is not None and not record.stale:
                    yield without_old_truth(record)


def merge_shards(out: str, *, parquet: bool = False) -> Merge:
    """Write the tables of an output folder as one run over all its shards would have.

    Parameters
    ----------
    parquet : bool
        Write ``timings.parquet`` too.

    Raises
    ------
    UsageError
        If there are no shards, or shards of runs that do not belong together.
    OutputError
        If the journal cannot be written.
    """
    parts = find_parts(out)
    state = os.path.join(out, STATE_FOLDER)
    with OutputLock(out):
        _refuse_mixture(out, parts)
        merge = Merge(out, problems=[part.problem for part in parts if part.problem])
        there = [part for part in parts if part.header]
        merge.problems += _different_inputs(there)
        _sweep(out)
        header = there[0].header
        before = tables_of(read_header(state))
        asked = {name for part in there for name in tables_of(part.header)}
        tables_known = sorted({*before, *asked, *((PARQUET,) if parquet else ())})
        packs = {part.folder: packs_of(part.folder) for part in there}
        records = MergedRecords(os.path.join(state, JOURNAL))
        lines = chosen_record(last_lines(_all_lines(state, there), state), out, header["settings"])
        first = {**header, "format": FORMAT, "tables": tables_known}
        if header.get("pack"):
            tars = _write_packed(merge, records, first, lines)
            _remove_packs(out, packs)
        else:
            _write_journal(merge, records, first, lines)
            tars = []
        _write(merge, records, there, [name for name in before if name not in tars], parquet=parquet)
    return merge


def _write_journal(
    merge: Merge, records: MergedRecords, header: Mapping[str, Any], lines: Iterable[tuple[Record, bytes]]
) -> None:
    gone: list[str] = []  # of outputs with files of their own, or left on another machine
    versions = Counter[str]()
    with atomic_stream(records.path) as file:
        file.write(json_line(header))
        for record, line in lines:
            file.write(line)
            if record.stale:  # as the shard found it
                if record.made:
                    records.miss(record.name, record.stale)
                continue
            records.note(record)
            merge.counts["total"] += 1
            merge.counts[record.status] += 1
            versions[record.version] += record.version != __version__
            if changed := still_true(record.files):
                records.miss(record.name, f"{changed} has changed or is gone")
            files = (path for path in record.outputs if path not in record.members)
            away = (path for path in files if not os.path.lexists(os.path.join(merge.out, path)))
            gone += islice(away, MAX_NAMED - len(gone))
    merge.num_stale = records.num_stale
    merge.problems += [f"{printable(path)} is gone; run its shard again" for path in gone]
    for version, count in sorted(versions.items()):
        if count:
            shown = f"{count} image{'s were' if count > 1 else ' was'} made by ffseg {version}"
            merge.problems.append(f"{shown}, this is {__version__}; run the shards again, which makes them anew")


def _write_packed(
    merge: Merge, records: MergedRecords, header: Mapping[str, Any], lines: Iterable[tuple[Record, bytes]]
) -> list[str]:
    """Write the journal and the tar files of all outputs; names of these."""
    with OrderedPacks(merge.out) as ordered:
        moved = ordered.moved(record for record, _ in lines)
        _write_journal(merge, records, header, ((record, record_line(record)) for record in moved))
    merge.problems += [f"{printable(path)} is not what was written; run its shard again" for path in ordered.lost]
    return publish(merge.out, ordered.packs)


def _remove_packs(out: str, packs: Mapping[str, list[str]]) -> None:
    """Remove the tar files of shards, whose outputs are in those of all by now; not where a run has begun meanwhile."""
    remove_files(packs_of(os.path.join(out, STATE_FOLDER)))
    for folder, paths in packs.items():
        with suppress(UsageError), OutputLock(out, folder):
            remove_files(paths)


def _write(merge: Merge, records: MergedRecords, parts: list[Part], before: list[str], *, parquet: bool) -> None:
    asked = {folder for part in parts for folder in part.run.get("asked", ())}
    camera = any(part.header.get("files", {}).get("camera") for part in parts)
    tables = Tables(merge.out, merge.out, records, camera, frozenset(asked), parquet)
    merge.problems += tables.partial()
    written = tables.write(_run_json(merge, records, parts), merge.problems.append)
    remove_old(merge.out, before, written)
    if GROUND.folder in records.with_outputs:
        merge.notes.append(
            "no map of all frames: a merge knows neither camera nor poses; for it run the same command once more without "
            "--shard, which segments nothing again"
        )


def find_parts(out: str) -> list[Part]:
    """Every shard of an output folder, those that never ran among them.

    Raises
    ------
    UsageError
        If there is none, or there are shards of different numbers.
    """
    found = [shard for shard in map(shard_of_folder, shard_names(out)) if shard is not None]
    counts = sorted({shard.count for shard in found})
    if not counts:
        raise UsageError(f"{printable(out)} holds no shards; make them with: ffseg run ... --out DIR --shard 1/8")
    if len(counts) > 1:
        shown = " and ".join(f"{count}" for count in counts)
        raise UsageError(
            f"{printable(out)} holds shards of runs in {shown} parts; remove the folders of {STATE_FOLDER}/{SHARDS} "
            "that are not to be merged"
        )
    shards = (Shard(number, counts[0]) for number in range(1, counts[0] + 1))
    return [_part(state_folder(out, shard.name), shard) for shard in shards]


def _part(folder: str, shard: Shard) -> Part:
    header = (read_header(folder) if os.path.isdir(folder) else None) or {}
    try:
        run = json.loads(read_bytes(os.path.join(folder, RUN), _MAX_RUN_BYTES))
    except (ImageReadError, ValueError, RecursionError):
        run = {}
    part = Part(shard, folder, header, run if isinstance(run, dict) else {})
    if not header:
        part.problem = f"shard {shard} never ran; run it with --shard {shard}"
    elif part.run.get("shard", shard.name) != shard.name:
        part.problem = f"the folder of shard {shard} is another's ({part.run['shard']}); run it with --shard {shard}"
    elif part.run.get("status") != "finished":
        part.problem = f"shard {shard} did not finish; run it again with --shard {shard}"
    return part


def _refuse_mixture(out: str, parts: list[Part]) -> None:
    """Refuse shards that are being written, were made with different parameters, or none that ran at all."""
    there = [part for part in parts if part.header]
    if not there:
        raise UsageError(f"{printable(out)} holds shards of which none has begun; run them first")
    for part in there:
        with OutputLock(out, part.folder):  # nobody is writing it
            pass
    first = there[0]
    for part in there[1:]:
        if part.header["settings"] != first.header["settings"]:
            raise UsageError(
                f"{printable(out)}: shard {part.shard} was run with other parameters than shard {first.shard} "
                f"({changes(first.header, part.header)}); run one of them again with --overwrite"
            )
        if bool(first.header.get("pack")) != bool(part.header.get("pack")):
            raise UsageError(
                f"{printable(out)}: of shard {part.shard} and shard {first.shard} one was run with --pack, the other "
                "without; run one of them again as the other, with --overwrite"
            )


def _different_inputs(parts: list[Part]) -> list[str]:
    """A sentence when shards that have finished saw different images in all, by number or by name, or other poses of them."""
    runs = [(part.run, part.shard) for part in parts if part.run.get("status") == "finished"]
    named = all("names" in run for run, _ in runs)  # earlier versions did not
    seen = {(run.get("whole"), run["names"] if named else ""): shard for run, shard in runs}
    if len(seen) > 1:
        shown = ", ".join(f"{whole} by shard {shard}" for (whole, _), shard in seen.items())
        return [f"the shards found different images ({shown}); run them all again over the same inputs"]
    moved = {run["motion"]: shard for run, shard in runs if "motion" in run}
    if len(moved) > 1:
        shown = " and ".join(map(str, moved.values()))
        return [f"shards {shown} were run with other poses or pairs; run them all again with the same files"]
    return []


def _sweep(out: str) -> None:
    """Remove temporaries that killed shards left among the outputs; nobody is writing any."""
    for folder, _, files in os.walk(out):
        for name in filter(is_temporary, files):
            os.unlink(os.path.join(folder, name))


def _all_lines(state: str, parts: list[Part]) -> Iterator[tuple[bytes, int, bytes]]:
    """Lines of the journal of earlier merges and runs (rank 0), then of all shards, with keys in the order of the tables."""
    for rank, folder in enumerate([state, *(part.folder for part in parts)]):
        for line in journal_lines(folder):
            value = parsed_line(line)
            if value is not None and isinstance(value.get("order"), str) and isinstance(value.get("name"), str):
                key = f"{value['order']}\0{value['name']}".encode("utf-8", "surrogatepass")
                yield key, min(rank, 1), line


_INDEX_MEMORY_KB = 65_536
"""Of the index that is held in memory."""


def last_lines(lines: Iterable[tuple[bytes, int, bytes]], folder: str) -> Iterator[tuple[bytes, bytes]]:
    """Of each key the last line of rank 0 and the last of rank 1, empty where there is none, in the order of the keys.

    Parameters
    ----------
    lines : iterable of (key, rank, line)
    folder : str
        Where the index is as long as it is needed.
    """
    path = temporary_path(os.path.join(folder, "lines"))
    try:
        with closing(sqlite3.connect(path, isolation_level=None)) as store:
            for what in ("journal_mode=OFF", "synchronous=OFF", f"cache_size=-{_INDEX_MEMORY_KB}"):  # nobody resumes it
                store.execute(f"PRAGMA {what}")
            store.execute("CREATE TABLE lines (key BLOB, rank INT, line BLOB, PRIMARY KEY (key, rank))")
            store.execute("BEGIN")
            store.executemany("INSERT OR REPLACE INTO lines VALUES (?, ?, ?)", lines)
            pair = ", ".join(f"coalesce(max(CASE rank WHEN {rank} THEN line END), x'')" for rank in (0, 1))
            yield from store.execute(f"SELECT {pair} FROM lines GROUP BY key ORDER BY key")  # noqa: S608 - numbers only
    except sqlite3.Error as error:
        raise OutputError(f"{printable(folder)} cannot be written ({error}); free some space") from error
    finally:
        remove_files([path])


def chosen_record(lines: Iterable[tuple[bytes, bytes]], out: str, settings: str) -> Iterator[tuple[Record, bytes]]:
    """Of the folder's own line and the shards' line of each image the one that counts, if it is a record.

    A record of the folder's own journal stays only where it is still true, and no shard knows the image or one has found
    it gone.
    """
    for own, shards in lines:
        record = parsed_record(shards or own)
        if record is None or record.settings != settings:
            continue
        mine = parsed_record(own) if shards and record.stale else None
        if mine is not None and not stale_reason(mine, out, settings):
            yield mine, own
            continue
        merged = parsed_record(own) if shards and record.members else None
        if merged is not None:  # an earlier merge has moved the outputs
            record = relocated(out, record, merged)
            found = merged.members.items()
            lost = any(is_gone(out, member) for _, member in record.members.items() - found)
            if lost and not stale_reason(merged, out, settings):
                record = merged
        if shards or not stale_reason(record, out, settings):
            yield record, shards or own


def _run_json(merge: Merge, records: Records, parts: list[Part]) -> dict[str, Any]:
    runs = [part.run for part in parts if part.run]
    first: Mapping[str, Any] = runs[0] if runs else {}
    counts = {
        "total": merge.counts["total"],
        "done": merge.counts["ok"],
        "unchanged": 0,
        "failed": merge.counts["failed"],
    }
    stale = [{"image": printable(name), "reason": reason} for name, reason in records.stale]
    stale += [entry for run in runs for entry in run.get("stale", ()) if entry not in stale]
    num_stale = merge.num_stale + len(stale) - len(records.stale)
    return {
        "ffseg": __version__,
        "status": "incomplete" if merge.problems else "finished",
        "started": min((run["started"] for run in runs if "started" in run), default=""),
        "ended": datetime.now(UTC).isoformat(timespec="seconds"),
        "seconds": round(sum(run.get("seconds", 0.0) for run in runs), 3),
        "counts": {**counts, "stale": num_stale},
        "inputs": first.get("inputs", []),
        "parameters": parts[0].header["parameters"],
        "versions": first.get("versions", {}),
        "problems": [*merge.problems, *(text for run in runs for text in run.get("problems", ()))],
        "stale": stale,
    }
