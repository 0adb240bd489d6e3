"""The only printing module: data to stdout, messages to stderr, both safe for a terminal."""

from __future__ import annotations

import re
import sys
from typing import TextIO

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
    """Write ``ffseg: error: TEXT`` to stderr."""
    message(f"ffseg: error: {text}")


def _write(stream: TextIO, text: str) -> None:
    print(text.encode("utf-8", "backslashreplace").decode("utf-8"), file=stream, flush=True)
