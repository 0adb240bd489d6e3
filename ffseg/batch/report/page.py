"""The report page: one HTML file that holds its data, its style and its script."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from ffseg.io.svg import escape


def page(title: str, data: Mapping[str, object]) -> str:
    """HTML of a report.

    Parameters
    ----------
    title : str
        Any text; escaped.
    data : mapping
        Values JSON can hold; what the script shows. Texts in it are shown as texts, whatever they hold.

    Returns
    -------
    str
        ASCII beside the title. It loads nothing but pictures beside it, and its content policy lets no script run but
        its own, told by hash.
    """
    parts = {
        "POLICY": _policy(),
        "TITLE": escape(title),
        "STYLE": _part("page.css"),
        "DATA": script_json(data),
        "SCRIPT": _part("page.js"),
    }
    pieces = _part("page.html").split("@@")
    return "".join(parts[piece] if index % 2 else piece for index, piece in enumerate(pieces))


def script_json(data: object) -> str:
    """JSON that can stand in a ``<script>`` element: nothing in it can end or open a tag or a comment."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


@cache
def _part(name: str) -> str:
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


def _policy() -> str:
    digests = (hashlib.sha256(_part(name).encode("utf-8")).digest() for name in ("page.css", "page.js"))
    style, script = (f"sha256-{base64.b64encode(digest).decode('ascii')}" for digest in digests)
    return f"default-src 'none'; img-src 'self' file: data:; style-src '{style}'; script-src '{script}'"
