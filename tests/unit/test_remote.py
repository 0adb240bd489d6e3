"""Images behind HTTP: read without a package of its own, with the limits of files, from the host that was named."""

import base64
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from ffseg.batch.plan.discover import discover
from ffseg.batch.plan.remote import read_remote
from ffseg.errors import ImageReadError, UsageError

SECRET = "Basic " + base64.b64encode(b"me:so/so").decode()


class Handler(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        if self.path.startswith("/to/"):
            host, _, rest = self.path.removeprefix("/to/").partition("/")
            self.send_response(302)
            self.send_header("Location", f"http://{host}:{self.server.server_port}/{rest}")
            self.end_headers()
        elif self.path == "/guarded.png" and self.headers.get("Authorization") != SECRET:
            self.send_error(401)
        elif self.path.partition("?")[0].endswith(".png"):
            self.send_response(200)
            if self.path == "/short.png":
                self.send_header("Content-Length", "7")
            self.end_headers()
            self.wfile.write(b"pixels" if self.path != "/empty.png" else b"")
        else:
            self.send_error(404)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server.server_port
        server.shutdown()
        thread.join()


def test_an_object_is_read_whole_and_named_by_its_path(port: int) -> None:
    url = f"http://127.0.0.1:{port}/sub/a.png?size=large"
    (source,) = discover([url])
    assert (source.path, source.name) == (url, "a.png")
    assert read_remote(url, 6) == b"pixels"
    assert read_remote(f"http://me:so%2Fso@127.0.0.1:{port}/guarded.png", 6) == b"pixels"


def test_a_scheme_in_capitals_is_the_same(port: int) -> None:
    url = f"HTTP://127.0.0.1:{port}/a.png"
    assert [one.name for one in discover([url])] == ["a.png"]
    assert len(discover([url, url.replace("HTTP", "http")])) == 1
    assert read_remote(url, 6) == b"pixels"


def test_an_address_that_is_none_says_which_are() -> None:
    with pytest.raises(UsageError, match="begin with one of .*http://.*; name what is on this machine by its path"):
        discover(["file:///tmp/a.png"])


def test_every_mark_in_an_address_is_its_own() -> None:
    for url in ("http://[::1]:80/a.png", "http://host/a[1]*.png", "http://host/a.png?of=[2]*"):
        assert [one.path for one in discover([url])] == [url]


def test_redirects_stay_on_the_host_that_was_named(port: int) -> None:
    same = f"http://127.0.0.1:{port}/to/127.0.0.1/a.png"
    assert read_remote(same, 10) == b"pixels"
    other = f"http://127.0.0.1:{port}/to/127.0.0.1/to/localhost/a.png"
    with pytest.raises(ImageReadError, match=rf"leads to another host, http://localhost:{port}/a.png; .*--follow-red"):
        read_remote(other, 10)
    assert read_remote(other, 10, redirects=True) == b"pixels"


REASONS = {"none": "missing", "empty.png": "empty", "guarded.png": "unreadable", "short.png": "truncated"}


@pytest.mark.parametrize(("path", "reason"), [*REASONS.items(), ("large.png", "too-many-bytes")])
def test_what_cannot_be_read_says_why(port: int, path: str, reason: str) -> None:
    with pytest.raises(ImageReadError) as caught:
        read_remote(f"http://127.0.0.1:{port}/{path}", 5 if path == "large.png" else 6)
    assert caught.value.reason == reason
