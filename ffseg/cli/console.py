"""The only printing module: data to stdout, messages to stderr, both safe for a terminal."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.console import Console

FAILED_IMAGES = 3
"""Exit code when at least one image or frame failed, an output could not be written, or a shard or mask is missing."""
MISSED_GATE = 4
"""Exit code when a figure lies below what is asked for."""
_UNSAFE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def escape(text: str) -> str:
    r"""Write control characters, bidirectional marks and undecodable bytes of `text` as ``\xNN`` escapes."""
    return _UNSAFE.sub(lambda match: match[0].encode("unicode_escape", "surrogatepass").decode("ascii"), text)


def data(text: str) -> None:
    """Write data to stdout, with a line end."""
    _write(sys.stdout, text)


def message(text: str) -> None:
    """Write a message to stderr, with a line end; control characters are escaped."""
    _write(sys.stderr, escape(text))


def error(text: str) -> None:
    """Write ``ffseg: error: TEXT`` to stderr, its beginning red where that is a terminal."""
    if not _for_people(sys.stderr):
        message(f"ffseg: error: {text}")
        return
    from rich.text import Text

    _rich(sys.stderr).print(Text.assemble(("ffseg: error: ", "bold red"), escape(text)))


def summary(lines: Sequence[tuple[str, str]]) -> None:
    """Write labels and what they stand for to stdout, one below the other; labels are dim on a terminal."""
    width = max(len(label) for label, _ in lines)
    if not _for_people(sys.stdout):
        for label, text in lines:
            data(f"{label:{width}}  {text}")
        return
    from rich.text import Text

    for label, text in lines:
        _rich(sys.stdout).print(Text.assemble((f"{label:{width}}  ", "bold cyan"), escape(text)))


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Write a table to stdout: ruled on a terminal, else in columns two spaces apart; numbers stand to the right."""
    if _for_people(sys.stdout):
        from rich import box
        from rich.table import Table

        ruled = Table(box=box.SIMPLE_HEAD)
        for place, title in enumerate(head):
            ruled.add_column(title, justify="right" if place else "left")
        for row in rows:
            ruled.add_row(*map(escape, row))
        _rich(sys.stdout).print(ruled)
        return
    widths = [max(len(cell) for cell in column) for column in zip(head, *rows, strict=True)]
    for row in (head, *rows):
        cells = [
            f"{cell:>{width}}" if place else f"{cell:<{width}}"
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        data("  ".join(cells).rstrip())


def markdown(text: str) -> None:
    """Write Markdown to stdout: laid out on a terminal, as it stands elsewhere."""
    if not _for_people(sys.stdout):
        data(text)
        return
    from rich.markdown import Markdown

    _rich(sys.stdout).print(Markdown(text))


def _for_people(stream: TextIO) -> bool:
    """Whether a stream ends on a terminal that can do more than show lines."""
    return stream.isatty() and os.environ.get("TERM", "") not in ("", "dumb")


def _rich(stream: TextIO) -> Console:
    from rich.console import Console

    return Console(file=stream, highlight=False, markup=False, emoji=False, soft_wrap=True)


def _write(stream: TextIO, text: str) -> None:
    print(text.encode("utf-8", "backslashreplace").decode("utf-8"), file=stream, flush=True)
