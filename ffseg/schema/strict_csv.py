"""A strict reader of small CSV files with a fixed header, with errors by line."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Iterator, Sequence

from ffseg.errors import FfsegError
from ffseg.schema.nodes import Problems
from ffseg.schema.strict_text import read_text

MAX_BYTES = 64_000_000
"""Hundreds of thousands of rows, which take some seconds at worst: every reader of a table is linear in them."""


def read_table(path: str | os.PathLike[str], error: type[FfsegError]) -> str:
    """Text of a table of at most `MAX_BYTES`; what `read_text` finds wrong is raised."""
    problems = Problems()
    text = read_text(path, problems, MAX_BYTES)
    problems.raise_as(error)
    return text


def rows_of(text: str, name: str, headers: Sequence[list[str]], problems: Problems) -> Iterator[tuple[int, list[str]]]:
    """Rows after the header with their line numbers; blank lines are skipped, cells stripped.

    Parameters
    ----------
    name : str
        Of the file, for what is said.
    headers : sequence of lists of str
        Headers allowed; each row has as many cells as the header that was found.
    problems : Problems
        Receives what is wrong, each with ``file:line``.
    """
    reader = csv.reader(io.StringIO(text.lstrip("\ufeff"), newline=""), strict=True)
    try:
        header = [cell.strip() for cell in next(reader, [])]
        if header not in headers:
            allowed = " or ".join(",".join(words) for words in headers)
            problems.add(f"{name}:1", f"the header must be {allowed}, it is {','.join(header)[:60]!r}")
            return
        for row in reader:
            if not row or row == [""]:
                continue
            if len(row) != len(header):
                problem = f"{len(row)} columns, must be {len(header)}: {','.join(header)}"
                problems.add(f"{name}:{reader.line_num}", problem)
            else:
                yield reader.line_num, [cell.strip() for cell in row]
    except csv.Error as error:
        problems.add(f"{name}:{reader.line_num}", f"not valid CSV ({error})")


def finite(word: str, limit: float) -> float:
    """The number in a cell; NaN for anything else, and for numbers beyond `limit` either way."""
    try:
        value = float(word) if "_" not in word else math.nan
    except ValueError:
        return math.nan
    return value if abs(value) <= limit else math.nan
