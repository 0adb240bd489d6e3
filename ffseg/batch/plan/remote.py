"""Images behind a URL, read through fsspec with the limits of files."""

from __future__ import annotations

import os
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from ffseg.batch.plan.discover import SUFFIXES, Source, natural_key
from ffseg.errors import ImageReadError, UsageError
from ffseg.io.files import printable

PROTOCOLS = ("s3", "gs", "gcs", "http", "https", "memory")
"""What is read; ``memory`` is for tests."""


def is_remote(text: str) -> bool:
    """Whether an input is a URL that is read through fsspec."""
    return "://" in text and text.partition("://")[0] in PROTOCOLS


def _file_system(url: str) -> tuple[Any, str]:
    """File system of a URL and the path in it.

    Raises
    ------
    ImportError
        If a package for this protocol is missing.
    """
    if find_spec("fsspec") is None:
        raise ImportError("fsspec is not installed; install it with: pip install 'ffseg[remote]'")
    core: Any = import_module("fsspec.core")
    system, path = core.url_to_fs(url)
    return system, path


def remote_sources(url: str) -> list[Source]:
    """Images of a URL: one, those of a pattern, or those below a folder of a store.

    Raises
    ------
    UsageError
        If they cannot be listed.
    """
    try:
        system, path = _file_system(url)
        if any(mark in path for mark in "*?["):
            base = path[: min(path.find(mark) for mark in "*?[" if mark in path)].rpartition("/")[0]
            paths = [one for one in system.glob(path) if not system.isdir(one)]
        elif url.startswith("http") or not system.isdir(path):
            return [Source(url, os.path.basename(path.rstrip("/").partition("?")[0]) or "index")]
        else:
            base, paths = path.rstrip("/"), system.find(path)
    except Exception as error:  # every store raises its own kinds
        raise UsageError(f"{printable(url)} cannot be listed ({type(error).__name__}: {error})"[:500]) from error
    named = [(one[len(base) :].lstrip("/"), one) for one in paths]
    images = [(name, one) for name, one in named if os.path.splitext(name)[1].lower() in SUFFIXES]
    return [
        Source(system.unstrip_protocol(one), name)
        for name, one in sorted(images, key=lambda pair: natural_key(pair[0]))
    ]


def read_remote(url: str, max_bytes: int) -> bytes:
    """Content behind a URL, no more than so many bytes of it.

    Raises
    ------
    ImageReadError
        With the reason ``missing``, ``unreadable``, ``empty`` or ``too-many-bytes``.
    """
    try:
        system, path = _file_system(url)
        with system.open(path, "rb") as file:
            data: bytes = file.read(max_bytes + 1)
    except FileNotFoundError as error:
        raise ImageReadError("missing", "there is no such object") from error
    except Exception as error:  # every store raises its own kinds
        raise ImageReadError("unreadable", f"it cannot be read ({type(error).__name__}: {error})"[:300]) from error
    if not data:
        raise ImageReadError("empty", "the object is empty; copy it again")
    if len(data) > max_bytes:
        raise ImageReadError("too-many-bytes", f"the object has more than {max_bytes} bytes, the limit")
    return data
