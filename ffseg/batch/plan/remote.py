"""Images behind URLs, read with the limits of files: HTTP with Python's own client, stores through fsspec."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from ffseg.errors import ImageReadError
from ffseg.io.files import printable

PROTOCOLS = ("s3", "gs", "gcs", "http", "https", "memory")
"""What is read; ``memory`` is for tests."""

_TIMEOUT_S = 60.0
"""Seconds without a byte."""
_GONE = (404, 410)


def is_remote(text: str) -> bool:
    """Whether an input is a URL that is read through fsspec."""
    return "://" in text and text.partition("://")[0].lower() in PROTOCOLS


def small_scheme(url: str) -> str:
    """The URL with its scheme in small letters."""
    scheme, mark, rest = url.partition("://")
    return scheme.lower() + mark + rest


def remote_name(url: str) -> str:
    """Name of the image behind a URL."""
    return url.partition("?")[0].rstrip("/").rpartition("/")[2] or "index"


def file_system(url: str) -> tuple[Any, str]:
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


def read_remote(url: str, max_bytes: int, *, redirects: bool = False) -> bytes:
    """Content behind a URL, no more than so many bytes of it.

    Parameters
    ----------
    redirects : bool
        Whether HTTP may lead to another host: whoever answers there was not named by anybody here.

    Raises
    ------
    ImageReadError
        With the reason ``missing``, ``unreadable``, ``truncated``, ``empty`` or ``too-many-bytes``.
    """
    url = small_scheme(url)
    try:
        with _open_http(url, redirects=redirects) if url.startswith("http") else _open_store(url) as file:
            data: bytes = file.read(max_bytes + 1)
            short = getattr(file, "length", None) if len(data) <= max_bytes else None
    except FileNotFoundError as error:
        raise ImageReadError("missing", "there is no such object") from error
    except _OtherHostError as error:
        remedy = "name that address, or add --follow-redirects to run"
        raise ImageReadError("unreadable", f"it leads to another host, {printable(str(error))}; {remedy}") from error
    except Exception as error:  # every store raises its own kinds
        raise ImageReadError("unreadable", f"it cannot be read ({type(error).__name__}: {error})"[:300]) from error
    if short:
        raise ImageReadError("truncated", f"the connection ended {short} bytes early; try again")
    if not data:
        raise ImageReadError("empty", "the object is empty; copy it again")
    if len(data) > max_bytes:
        raise ImageReadError("too-many-bytes", f"the object has more than {max_bytes} bytes, the limit")
    return data


def _open_store(url: str) -> Any:  # noqa: ANN401 - of fsspec
    system, path = file_system(url)
    return system.open(path, "rb")


class _OtherHostError(Exception):
    """A redirect away from the host that was named."""


def _open_http(url: str, *, redirects: bool) -> Any:  # noqa: ANN401 - the answer
    import base64
    from urllib.error import HTTPError
    from urllib.parse import unquote, urlsplit
    from urllib.request import HTTPRedirectHandler, Request, build_opener

    class Redirects(HTTPRedirectHandler):
        def redirect_request(self, *arguments: Any) -> Request | None:  # noqa: ANN401 - see urllib
            request, target = arguments[0], arguments[-1]
            if not redirects and urlsplit(target).hostname != urlsplit(request.full_url).hostname:
                arguments[1].close()
                raise _OtherHostError(target)
            return super().redirect_request(*arguments)

    parts = urlsplit(url)
    account, _, place = parts.netloc.rpartition("@")
    request = Request(parts._replace(netloc=place).geturl(), headers={"User-Agent": "ffseg"})  # noqa: S310 - http only
    if account:
        credentials = base64.b64encode(unquote(account).encode()).decode("ascii")
        request.add_unredirected_header("Authorization", f"Basic {credentials}")
    try:
        return build_opener(Redirects).open(request, timeout=_TIMEOUT_S)
    except HTTPError as error:
        error.close()
        if error.code in _GONE:
            raise FileNotFoundError(url) from error
        raise
