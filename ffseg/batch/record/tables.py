"""The tables of an output folder, written from its valid records."""

from __future__ import annotations

import contextlib
import json
import os
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ffseg.batch.outputs.table import MAP_BAG, MAP_FILES, OBSTACLES, OUTPUTS, PARQUET, RUN, TIMINGS, Output
from ffseg.batch.tar.members import output_bytes
from ffseg.batch.values import Record
from ffseg.errors import ImageReadError, OutputError
from ffseg.io.files import atomic_stream, printable, remove_files, write_all_atomic
from ffseg.io.tables import csv_lines
from ffseg.plugins import load

TIMING_COLUMNS = (
    "image", "status", "error", "width", "height", "method", "initial_points", "final_points", "patches", "iterations",
    "splits", "flips", "components", "holes", "area_px", "decode_ms", "edges_ms", "evolve_ms", "obstacles_ms",
    "write_ms", "total_ms",
)  # fmt: skip
EDGES = ("source", "score", "canny_low", "canny_high", "doubts")
"""What decided where edges are, how sure the result is (0 to 1), the thresholds in grey levels per pixel, and why not sure."""
START_COLUMNS = ("start_x", "start_y", "start_radius")
"""With ``--starts``: the start circle of the image, in pixels."""
TIME_COLUMN = "time_s"
"""Of frames: seconds after the first of the film."""
PAST_COLUMNS = ("flicker", "steady_px")
"""With ``--flicker`` and ``--steady``: one less the IoU with the mask before, carried by motion; pixels that the past changed."""
OBSTACLE_COLUMNS = (
    "image", "component", "area_px", "centroid_x", "centroid_y", "matched_points", "max_altitude_m", "verdict",
    "against", "ground_x_m", "ground_y_m", "track",
)  # fmt: skip
MAX_ROWS_IN_MEMORY = 10_000
"""Rows up to which the tables are made in memory and written together, so that the disk is waited for once."""
_MAX_NAMED = 1000
"""Stale images that ``run.json`` names; their number is always given."""

Pieces = Iterator[bytes]


@dataclass(slots=True)
class Records(ABC):
    """The records that stand in the tables, gone through as often as needed and never held together."""

    count: int = field(default=0, init=False)
    columns: set[str] = field(default_factory=set, init=False)
    """Of all rows together."""
    num_made: int = field(default=0, init=False)
    """Of images that did not fail."""
    with_outputs: Counter[str] = field(default_factory=Counter, init=False)
    """Folders of outputs, and how many records have any there."""
    stale: list[tuple[str, str]] = field(default_factory=list, init=False)
    """Names of images that are no longer what their record says, and why; `num_stale` counts those not named, too."""
    num_stale: int = field(default=0, init=False)
    left: list[str] = field(default_factory=list, init=False)
    """Outputs that belong to no image any longer, but hold something else than was written."""

    @abstractmethod
    def records(self) -> Iterator[Record]:
        """Records in the order of the tables, anew at every call."""

    def note(self, record: Record) -> None:
        """Take a record into account."""
        self.count += 1
        self.columns |= record.row.keys()
        self.num_made += record.made
        self.with_outputs.update({path.split("/", 1)[0] for path in record.outputs})
        self.left += record.left

    def miss(self, name: str, reason: str) -> None:
        """Take into account that an image is no longer what its record says."""
        self.num_stale += 1
        if len(self.stale) < _MAX_NAMED:
            self.stale.append((name, reason))


@dataclass(frozen=True, slots=True)
class Tables:
    """What is written at the end of a run, besides each image's own outputs."""

    out: str
    """Folder of the images' outputs."""
    folder: str
    """Folder of the tables: the same, or a shard's."""
    survey: Records
    camera: bool = False
    """Whether components were tested."""
    asked: frozenset[str] = field(default_factory=frozenset)
    """Columns and output folders that are written even if no image has them."""
    parquet: bool = False
    """Write ``timings.parquet``, too."""
    kinds: tuple[Output, ...] = OUTPUTS
    """That may have to be merged."""
    films: tuple[str, ...] = ()
    """Kinds of outputs to be written as films, too."""

    def columns(self) -> tuple[str, ...]:
        """Columns of ``timings.csv``."""
        there = self.survey.columns | self.asked
        iou = ("iou",) if "iou" in there else ()
        starts = START_COLUMNS if "start_x" in there else ()
        pair, time = ("pair",) if self.camera else (), (TIME_COLUMN,) if TIME_COLUMN in there else ()
        past = tuple(column for column in PAST_COLUMNS if column in there)
        return (*TIMING_COLUMNS, *iou, "stop_reason", "note", *EDGES, *pair, *starts, *time, *past)

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of ``timings.csv``."""
        for record in self.survey.records():
            yield {"image": printable(record.name), **record.row}

    def pieces(self, run: Mapping[str, Any]) -> dict[str, Pieces]:
        """Every table and ``run.json``, which says so much of the run, by name, as pieces of bytes."""
        columns = self.columns()
        made = {TIMINGS: csv_lines(columns, ([row.get(column) for column in columns] for row in self.rows()))}
        if self.camera:
            made[OBSTACLES] = csv_lines(OBSTACLE_COLUMNS, self._obstacles())
        for output in self._merged():
            made[output.merged] = _merged_by(output, self._contents(output), run["parameters"]["region"]["label"])
        made[RUN] = iter([f"{json.dumps(run, indent=2, default=str)}\n".encode()])
        return made

    def _merged(self) -> list[Output]:
        there = {*self.survey.with_outputs, *self.asked}
        return [output for output in self.kinds if output.merge and output.folder in there]

    def partial(self) -> list[str]:
        """A sentence for each file for all images that lacks some: they were made without it."""
        count, made = self.survey.with_outputs, self.survey.num_made
        return [
            f"{kind.merged} has {count[kind.folder]} of {made} images; run the others again with --export {kind.name}"
            for kind in self._merged()
            if count[kind.folder] < made
        ]

    def _obstacles(self) -> Iterator[list[Any]]:
        from ffseg.freespace.tracks import with_track_numbers

        lines = {printable(record.name): record.extra for record in self.survey.records()}
        found = with_track_numbers(map(printable, in_time(self.survey.records())), lines)
        for name in lines:
            yield from ([name, *(line.get(column) for column in OBSTACLE_COLUMNS[1:])] for line in found[name])

    def _contents(self, output: Output) -> Callable[[], Iterable[bytes]]:
        """Gives the contents of all outputs of a kind, in the order of the tables."""

        def contents() -> Iterator[bytes]:
            for record in self.survey.records():
                for path in record.outputs:
                    if path.startswith(f"{output.folder}/") and path.endswith(output.suffix):
                        with contextlib.suppress(ImageReadError):  # removed in this very moment
                            yield output_bytes(self.out, path, record.members.get(path))

        return contents

    def write(self, run: Mapping[str, Any], tell: Callable[[str], None]) -> list[str]:
        """Write every table and ``run.json``; `tell` hears of each that cannot be written. Gives their names."""
        tables = self.pieces(run)
        names = [*tables, *((PARQUET,) if self.parquet else ())]
        if self.parquet:
            self._write_parquet(tell)
        if self.films:
            from ffseg.batch.record.films import write_films

            names += write_films(self.out, self.films, self.survey, tell)
        if self.survey.count > MAX_ROWS_IN_MEMORY:
            self._write_each(tables.items(), tell)
            return names
        try:
            write_all_atomic([(os.path.join(self.folder, name), b"".join(pieces)) for name, pieces in tables.items()])
        except OutputError:
            self._write_each(self.pieces(run).items(), tell)
        return names

    def _write_parquet(self, tell: Callable[[str], None]) -> None:
        from ffseg.batch.outputs.parquet import write_parquet

        try:
            write_parquet(os.path.join(self.folder, PARQUET), self.columns(), self.rows())
        except OutputError as error:
            tell(str(error))

    def _write_each(self, tables: Iterable[tuple[str, Iterable[bytes]]], tell: Callable[[str], None]) -> None:
        for name, pieces in tables:
            try:
                with atomic_stream(os.path.join(self.folder, name)) as file:
                    file.writelines(pieces)
            except OutputError as error:
                tell(str(error))


def _merged_by(output: Output, contents: Callable[[], Iterable[bytes]], label: str) -> Pieces:
    """Pieces of a file of all images.

    Raises
    ------
    OutputError
        Whatever the function does wrong, which may be somebody's.
    """
    try:
        for piece in load(output.merge)(contents, label):
            yield memoryview(piece).tobytes()
    except Exception as error:
        what = f"{output.merge} of --export {output.name} failed ({type(error).__name__}: {error})"
        raise OutputError(f"{output.merged} cannot be written: {what}; mend it and run again") from error


def in_time(records: Iterable[Record]) -> list[str]:
    """Names of images in an order in which each comes after those it was judged against."""
    chains = {
        record.files["image"][0]: (record.name, _earlier(record)) for record in records if "image" in record.files
    }
    ordered: dict[str, None] = {}
    for name, earlier in chains.values():
        ordered |= dict.fromkeys((*(chains[path][0] for path in reversed(earlier) if path in chains), name))
    return list(ordered)


def _earlier(record: Record) -> list[str]:
    """Paths of the images before an image, the nearest first."""
    roles = (f"earlier {number}" for number in range(len(record.files)))
    return [record.files[role][0] for role in roles if role in record.files]


def remove_old(folder: str, before: Sequence[str], now: Sequence[str]) -> None:
    """Remove tables that an earlier run wrote and this one has nothing for."""
    ours = (name for name in set(before) - set(now) if name == os.path.basename(name) or name in (*MAP_FILES, MAP_BAG))
    remove_files(os.path.join(folder, name) for name in ours)
