"""The web server of the page: local only, and only for those who know its address."""

from __future__ import annotations

import hmac
import json
import secrets
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from time import perf_counter
from typing import Any
from urllib.parse import urlsplit

from ffseg.errors import FfsegError
from ffseg.picking.session import Session, StaleError

HOST = "127.0.0.1"
MAX_BYTES = 1 << 22
"""Of what a page sends: a thousand long strokes."""
_FILES = {"": "page.html"} | {name: name for name in ("page.css", "page.js", "view.js", "icon.svg")}
_TYPES = {"html": "text/html", "css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
_POLICY = (
    "default-src 'none'; img-src 'self'; style-src 'self'; script-src 'self'; connect-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors "
)


class Server(ThreadingHTTPServer):
    """Serves one session.

    Parameters
    ----------
    port : int
        0 for any that is free.
    framed : bool
        Whether another page on this machine, a notebook's, may hold this one in a frame.

    Attributes
    ----------
    address : str
        Of the page, with the token that makes it this user's.
    """

    daemon_threads = True

    def __init__(self, session: Session, port: int = 0, *, framed: bool = False) -> None:
        super().__init__((HOST, port), Handler)
        self.session, self.token = session, secrets.token_urlsafe(24)
        self._idle, self._working, self._ended = threading.Condition(), 0, False
        self.port = int(self.server_address[1])
        self.hosts = {f"{name}:{self.port}" for name in (HOST, "localhost")}
        self.policy = _POLICY + ("http://localhost:* http://127.0.0.1:*" if framed else "'none'")
        self.address = f"http://{HOST}:{self.port}/{self.token}/"

    def handle_error(self, *_of: object) -> None:
        """Say nothing of a page that is closed before its answer has come."""

    def begin(self) -> None:
        """Serve from a thread until `shutdown`."""
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True).start()

    @property
    def busy(self) -> bool:
        """Whether an answer is being found."""
        return self._working > 0

    def server_close(self) -> None:
        """Close; the answers that are being found are waited for, and none is begun any more.

        A thread in the native core or in OpenCV while the interpreter ends would end the process with an abort.
        """
        super().server_close()
        with self._idle:
            self._ended = True
            self._idle.wait_for(lambda: not self._working)

    @contextmanager
    def working(self) -> Iterator[None]:
        """Keep the server from being closed while an answer is found.

        Raises
        ------
        ConnectionResetError
            If it is closed.
        """
        with self._idle:
            if self._ended:
                raise ConnectionResetError
            self._working += 1
        try:
            yield
        finally:
            with self._idle:
                self._working -= 1
                self._idle.notify_all()


@cache
def _file(name: str) -> bytes:
    return resources.files("ffseg.picking").joinpath(name).read_bytes()


class Handler(BaseHTTPRequestHandler):
    """Answers one connection."""

    server: Server
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    wbufsize = -1  # head and body in one piece
    timeout = 600

    def do_GET(self) -> None:
        """The page, its parts and the pictures."""
        self._answer(self._get)

    def do_POST(self) -> None:
        """What the page asks and changes."""
        self._answer(self._post)

    def log_message(self, *_words: object) -> None:
        """Say nothing: the terminal is the user's, and the address is a secret."""

    def _answer(self, what: Callable[[str], None]) -> None:
        try:
            path = self._checked()
            if path is None:
                self._send(403, b"not for you: open the address that ffseg pick has printed\n", "text/plain")
            else:
                what(path)
        except StaleError:
            self._json(409, {"error": "changed in another tab"})
        except FfsegError as error:
            self._json(400, {"error": str(error)})
        except (ValueError, KeyError, TypeError, IndexError, OverflowError, RecursionError):
            self._json(400, {"error": "this was no question of the page; load it again"})
        except (BrokenPipeError, ConnectionResetError):
            self.close_connection = True
        except Exception as error:  # noqa: BLE001 - the last resort of an answer: the page says it, what is picked is kept
            self._json(500, {"error": f"unexpected {type(error).__name__}: {error}"})

    def _checked(self) -> str | None:
        """The path behind the token; None for whoever does not know it, or comes from elsewhere.

        The name of the host guards against a name of another site that is made to lead here; the origin against pages of
        other sites; the token against everybody else on this machine.
        """
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
        _, token, path = (*urlsplit(self.path).path.split("/", 2), "", "")[:3]
        known = hmac.compare_digest(token.encode(), self.server.token.encode())
        own = origin is None or origin in {f"http://{one}" for one in self.server.hosts}
        if host not in self.server.hosts or not own or not known:
            self.close_connection = True
            return None
        return path

    def _get(self, path: str) -> None:
        if path in _FILES:
            name = _FILES[path]
            self._send(200, _file(name), f"{_TYPES[name.rpartition('.')[2]]}; charset=utf-8")
        elif path.startswith("image/"):
            index = int(path[6:])
            if not 0 <= index < len(self.server.session.sources):
                raise IndexError(index)
            with self.server.working():
                picture = self.server.session.open_image(index).picture()
            self._send(200, picture, "image/jpeg", keep=True)
        else:
            self._send(404, b"there is no such page\n", "text/plain")

    def _post(self, path: str) -> None:
        length = int(self.headers.get("Content-Length", "0"))
        if not 0 <= length <= MAX_BYTES or self.headers.get("Content-Type") != "application/json":
            self.close_connection = True
            self._json(400, {"error": "too much, or no JSON"})
            return
        request = json.loads(self.rfile.read(length) or b"{}")
        if not isinstance(request, dict):
            raise TypeError("no object")
        begin = perf_counter()
        with self.server.working():
            answer = self._dispatch(path, request)
        self._json(200, answer | {"server_ms": round((perf_counter() - begin) * 1e3, 2)})

    def _dispatch(self, path: str, request: dict[str, Any]) -> dict[str, Any]:
        session = self.server.session
        if path == "about":
            return session.about()
        label, index = int(request.get("label", 0)), int(request.get("image", 0))
        if not (0 <= label < len(session.labels) and 0 <= index < len(session.sources)):
            raise IndexError(index)
        match path:
            case "image":
                return session.image(label, index)
            case "find":
                return session.find(label, index, request["picked"], quick=bool(request.get("quick")))
            case "change":
                seen = str(request.get("picture", ""))
                return session.change(
                    label, index, int(request["version"]), str(request["do"]), request.get("picked"), seen
                )
            case "statuses":
                return {"statuses": session.statuses(label)}
            case "following":
                place = session.following(label, index)
                return {"image": place, "picture": session.picture_address(place) if place >= 0 else ""}
            case "news":
                return session.news(label, index)
            case "run":
                session.run(label)
                return session.news(label, index)
        raise KeyError(path)

    def _json(self, code: int, answer: dict[str, Any]) -> None:
        self._send(code, json.dumps(answer, separators=(",", ":")).encode("ascii"), "application/json")

    def _send(self, code: int, data: bytes, kind: str, *, keep: bool = False) -> None:
        self.send_response(code)
        for name, value in (
            ("Content-Type", kind),
            ("Content-Length", str(len(data))),
            ("Cache-Control", "private, max-age=3600" if keep else "no-store"),
            ("Content-Security-Policy", self.server.policy),
            ("X-Content-Type-Options", "nosniff"),
            ("Referrer-Policy", "no-referrer"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
        ):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(data)
        self.wfile.flush()
