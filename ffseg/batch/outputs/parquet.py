"""``timings.csv`` as a Parquet file, written in pieces, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from typing import Any

from ffseg.io.files import replacement

_BATCH = 20_000
_TEXTS = frozenset({"image", "status", "error", "method", "stop_reason", "note", "source", "pair", "doubts"})
_REALS = frozenset(
    {"iou", "start_x", "start_y", "start_radius", "score", "canny_low", "canny_high", "time_s", "flicker"}
)


def write_parquet(path: str, columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> None:
    """Write rows, whole or not at all."""
    import pyarrow
    from pyarrow import parquet

    schema = pyarrow.schema([(column, _type(pyarrow, column)) for column in columns])
    rows = iter(rows)
    with replacement(path) as temporary, parquet.ParquetWriter(temporary, schema) as writer:
        while batch := list(islice(rows, _BATCH)):
            cells = [[_cell(row.get(column), column) for row in batch] for column in columns]
            writer.write_batch(pyarrow.record_batch(cells, schema=schema))


def _type(pyarrow: Any, column: str) -> Any:  # noqa: ANN401 - a module without types
    if column in _TEXTS:
        return pyarrow.string()
    return pyarrow.float64() if column in _REALS or column.endswith("_ms") else pyarrow.int64()


def _cell(value: Any, column: str) -> Any:  # noqa: ANN401 - a cell
    return float(value) if isinstance(value, int) and (column in _REALS or column.endswith("_ms")) else value
