"""CSV tables whose cells spreadsheets do not take for formulas."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence

from ffseg.io.files import unprintable

Cell = str | int | float | None
_FORMULA_STARTS = ("=", "+", "-", "@")
_CONTROLS = {code: f"\\u{code:04x}" for code in (*range(32), 127)}


def neutral(cell: Cell) -> str:
    r"""Text of one cell.

    Numbers are written as they are: floats as the shortest text that reads back equal, None and NaN as nothing. Text
    that a spreadsheet would run as a formula, also behind blanks, is put behind an apostrophe, also behind one of its
    own, so that different texts stay different; control characters become ``\uNNNN``, so that a row is a line.
    """
    if cell is None:
        return ""
    if isinstance(cell, str):
        text = cell if cell.isprintable() else cell.translate(_CONTROLS)
        return f"'{text}" if text.lstrip("'").lstrip().startswith(_FORMULA_STARTS) else text
    if isinstance(cell, float):
        return "" if math.isnan(cell) else repr(cell)
    return str(int(cell))


def meant_by(cell: str) -> list[str]:
    """Texts that `neutral` writes as this cell: one that begins with an apostrophe may have been given it."""
    return [cell[1:], cell] if cell.startswith("'") else [cell]


def without_nan(values: Mapping[str, object]) -> dict[str, object]:
    """Values as JSON holds them: None for what is not a number."""
    return {key: None if value != value else value for key, value in values.items()}


def counted(number: int, what: str) -> str:
    """A number of things in words: ``1 hole``, ``2 holes``."""
    return f"{number} {what}{'s' * (number != 1)}"


def names_meant_by(cell: str) -> list[str]:
    """Relative names of images that a table shows as this cell; none that leads out of its folder."""
    names = [unprintable(text) for text in meant_by(cell)]
    return [name for name in names if ".." not in name.split("/") and not os.path.isabs(name) and "\0" not in name]


def csv_row(cells: Iterable[Cell]) -> str:
    """One line of a table, with its line end."""
    buffer = io.StringIO(newline="")
    csv.writer(buffer, lineterminator="\n").writerow([neutral(cell) for cell in cells])
    return buffer.getvalue()


def csv_table(columns: Sequence[str], rows: Iterable[Sequence[Cell]]) -> bytes:
    """A whole table as UTF-8 with a header line.

    Parameters
    ----------
    rows : iterable of sequences
        Each as long as `columns`.
    """
    return b"".join(csv_lines(columns, rows))


def csv_lines(columns: Sequence[str], rows: Iterable[Sequence[Cell]]) -> Iterator[bytes]:
    """The same line by line, so that a table of any length needs no memory."""
    yield csv_row(columns).encode("utf-8")
    for row in rows:
        if len(row) != len(columns):
            raise ValueError(f"a row of {len(row)} cells in a table of {len(columns)} columns")
        yield csv_row(row).encode("utf-8")
